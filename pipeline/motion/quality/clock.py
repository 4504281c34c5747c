"""Whether a clip plays as fast as it was recorded: what gravity and the size of a body say about its frame rate.

Each kind of evidence is a number that grows with the factor by which a clip plays too fast, as log2 of it; recorded
motion has a usual value of it, with a spread (`USUAL`). Each counts by one over the square of its spread, and where
they contradict one another the spread of their mean grows (Birge ratio, as the Particle Data Group has it).

- fall: bodies in flight fall with g.
- steps: of an even walk, as long over as frequent as people's (walk ratio; Sekiya and Nagasaki 1998).
- balance: who stands on one foot is a pendulum upside down. The centre of mass is pushed away from the foot with g over
  its height times its distance from it (Winter 1995), to the side, and less exactly ahead, where the pressure wanders
  from heel to toe.
- tempo: how quickly people move at all. Nobody moves much more quickly, but anybody may move slowly.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array
from motionlake.motion.quality.faults import Recording, velocity
from motionlake.motion.quality.feet import GRAVITY, Ground
from motionlake.motion.runs import runs
from motionlake.motion.skeleton import INDEX


@dataclass(frozen=True)
class Usual:
    """What of recorded motion a kind of evidence says: log2 of a factor, and by how much it differs."""

    value: float
    spread: float


# Measured by `python -m bench.quality --usual` on recorded sets.
USUAL: Final[Mapping[str, Usual]] = {
    "fall": Usual(-0.04, 0.17),
    "steps": Usual(0.03, 0.34),
    "balance_aside": Usual(0.22, 0.40),
    "balance_ahead": Usual(0.09, 0.44),
    "tempo": Usual(-0.14, 0.51),
}
SLOW: Final = 2.0  # times the spread of the tempo of motion slower than usual
# Metres a step over steps a minute, of a leg of 0.85 m: what people keep while they walk slowly or fast.
WALK_RATIO: Final = 0.0065
LEG: Final = 0.85
STEPS: Final = 3  # in a row, that differ little
STRIDE: Final = 0.25  # of a leg between the ankles, fore and aft, and travelled in a step
STRAIGHT: Final = 0.95  # distance over way of steps that go one way
EVEN: Final = 0.5  # by which steps of a walk differ
OFF: Final = 0.08  # metres above the ground of both feet in flight
LEAST: Final = 6  # frames of a flight
STANDS: Final = 0.04  # metres about its level, of a foot that stands
LIFTED: Final = 0.03  # metres above it, of one that does not
ONE_FOOT: Final = 8  # frames on one foot
LIKE: Final = 0.3  # correlation of the distance from the foot and the acceleration
SHORTEST: Final = 20  # frames of a clip
QUANTILE: Final = 0.95
BUMP: Final = 0.12  # seconds over which the acceleration of the centre of mass is taken
# Share of the body's mass, with the place of its centre between two joints (Winter 2009, table 4.1).
MASSES: Final[tuple[tuple[float, str, str, float], ...]] = (
    (0.081, "head", "head", 0.0),
    (0.497, "hips", "neck", 0.5),
    *(
        (mass, f"{side}_{start}", f"{side}_{stop}", share)
        for side in ("left", "right")
        for mass, start, stop, share in (
            (0.028, "shoulder", "elbow", 0.436), (0.022, "elbow", "wrist", 0.682), (0.1, "hip", "knee", 0.433),
            (0.0465, "knee", "ankle", 0.433), (0.0145, "ankle", "toe", 0.5),
        )
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Rate:
    """What is known of a clip's frame rate.

    Attributes:
        factor: how many times too fast it plays, as far as anything tells.
        odds: how many times likelier that is twice or half as fast as recorded than that it is right; below 1, the
            other way round.
    """

    factor: float
    odds: float


def judged(found: Mapping[str, float], usual: Mapping[str, Usual] = USUAL) -> Rate:
    """What evidence (`evidence`) says together; odds of 1 where there is none."""
    apart = np.array([value - usual[kind].value for kind, value in found.items()])
    slow = np.array([SLOW if kind == "tempo" else 1.0 for kind in found])
    spreads = np.array([usual[kind].spread for kind in found]) * np.where(apart < 0, slow, 1.0)
    if not len(apart):
        return Rate(1.0, 1.0)
    weights = spreads**-2.0
    mean = float((weights * apart).sum() / weights.sum())
    contradiction = float((weights * (apart - mean) ** 2).sum()) / max(len(apart) - 1, 1)
    variance = max(contradiction, 1.0) / float(weights.sum())
    # Of normal errors the ratio of the likelihoods of one octave off, and of none.
    return Rate(2.0**mean, float(np.exp(np.clip((abs(mean) - 0.5) / variance, -50, 50))))


def evidence(recording: Recording) -> dict[str, float]:
    """What tells how fast a clip plays: log2 of a factor, by kinds of `USUAL`; {} of a clip that is too short."""
    if len(recording) < SHORTEST:
        return {}
    ground = Ground.of(recording)
    centre = centre_of_mass(recording)
    found: dict[str, float] = {"tempo": tempo(recording, centre)}
    for kind, factors in (("fall", falls(recording, ground)), ("steps", steps(recording))):
        if factors:
            found[kind] = float(np.log2(np.median(factors)))
    return found | balance(recording, ground, centre)


def centre_of_mass(recording: Recording) -> Float64Array:
    """[F, 3] of the body, metres."""
    total = sum(mass for mass, *_ in MASSES)
    centre = np.zeros((len(recording), 3))
    for mass, start, stop, share in MASSES:
        centre += mass / total * ((1 - share) * recording.joint(start) + share * recording.joint(stop))
    return centre


def falls(recording: Recording, ground: Ground) -> list[float]:
    """How many times too fast each flight goes, by the acceleration of the hips."""
    factors = []
    for start, stop in runs(ground.above.min(axis=1) > OFF, 0, LEAST):
        height = recording.positions[start:stop, 0, 1]
        time = np.arange(stop - start) / recording.fps
        curve = np.polyfit(time, height, 2)
        miss = height - np.polyval(curve, time)
        if curve[0] < 0 and np.ptp(height) > 0.05 and np.std(miss) < 0.08 * np.ptp(height):
            factors.append(float(np.sqrt(-2 * curve[0] / GRAVITY)))
    return factors


def steps(recording: Recording) -> list[float]:
    """How many times too fast a walk goes, by the length of its steps and how many there are; nothing where none is."""
    left = recording.joint("left_hip") - recording.joint("right_hip")
    front = np.cross(left, [0.0, 1.0, 0.0])
    front /= np.maximum(np.linalg.norm(front, axis=1, keepdims=True), 1e-9)
    apart: Float64Array = ((recording.joint("left_ankle") - recording.joint("right_ankle")) * front).sum(axis=1)
    turns: list[int] = []
    wide = STRIDE * recording.leg
    for start, stop in sorted([*runs(apart > wide), *runs(apart < -wide)]):
        peak = start + int(np.abs(apart[start:stop]).argmax())
        if turns and apart[turns[-1]] * apart[peak] > 0:
            if abs(apart[peak]) > abs(apart[turns[-1]]):
                turns[-1] = peak
        else:
            turns.append(peak)
    root = recording.positions[:, 0][:, [0, 2]]
    best: list[float] = []
    for first in range(len(turns) - STEPS):
        at = np.array(turns[first : first + STEPS + 1])
        lengths, counts = np.linalg.norm(np.diff(root[at], axis=0), axis=1), np.diff(at)
        straight = np.linalg.norm(root[at[-1]] - root[at[0]]) > STRAIGHT * lengths.sum()
        even = np.ptp(counts) < EVEN * counts.mean() and np.ptp(lengths) < EVEN * lengths.mean()
        if straight and even and lengths.min() > 2 * STRIDE * recording.leg:
            cadence = 60 * recording.fps / counts.mean()
            best.append(float(WALK_RATIO * (recording.leg / LEG) * cadence / lengths.mean()))
    return [float(np.median(best))] if best else []


def balance(recording: Recording, ground: Ground, centre: Float64Array) -> dict[str, float]:
    """log2 of how many times too fast a body sways while it stands on one foot, to the side and ahead."""
    stands = list(_on_one_foot(recording, ground, centre))
    if not stands:
        return {}
    away, pushed, height = (np.concatenate(rows) for rows in zip(*stands, strict=True))
    length = float(np.median(height))
    found = {}
    for column, kind in enumerate(("balance_aside", "balance_ahead")):
        size, push = (float(np.sqrt(np.square(each[:, column]).sum())) for each in (away, pushed))
        together = float((away[:, column] * pushed[:, column]).sum())
        if len(away) >= ONE_FOOT and length > 0 and together > LIKE * size * push > 0:
            found[kind] = float(0.5 * np.log2(length * push / (GRAVITY * size)))
    return found


def _on_one_foot(
    recording: Recording, ground: Ground, centre: Float64Array
) -> Iterator[tuple[Float64Array, Float64Array, Float64Array]]:
    """Of each stand on one foot: [n, 2] distance from it to the side and ahead, [n, 2] acceleration, [n] height.

    They are smoothed over half of the stand, so that the frame rate does not matter to how much.
    """
    from scipy.signal import savgol_filter

    for side, pair, other in (("left", (0, 2), (1, 3)), ("right", (1, 3), (0, 2))):
        ankle, toe = recording.joint(f"{side}_ankle"), recording.joint(f"{side}_toe")
        stands: BoolArray = np.all(np.abs(ground.above[:, pair]) < STANDS, axis=1)
        for start, stop in runs(stands & (ground.above[:, other].min(axis=1) > LIFTED), 1, ONE_FOOT):
            window = max(5, (stop - start) // 4 * 2 + 1)
            within = slice(window // 2, stop - start - window // 2)
            body = savgol_filter(centre[start:stop], window, 2, axis=0)[within]
            pushed = savgol_filter(centre[start:stop], window, 2, deriv=2, delta=1 / recording.fps, axis=0)[within]
            away = body - ((ankle + toe) / 2)[start:stop][within]
            ahead = np.median((toe - ankle)[start:stop], axis=0)[[0, 2]]
            ahead /= max(float(np.linalg.norm(ahead)), 1e-6)
            axes = np.array([[-ahead[1], ahead[0]], ahead]).T
            yield away[:, [0, 2]] @ axes, pushed[:, [0, 2]] @ axes, away[:, 1] + STANDS


def tempo(recording: Recording, centre: Float64Array) -> float:
    """log2 of the mean of four numbers that grow with the speed of playing: how hard the centre of mass is pushed, how
    often it and the elbows go to and fro, and how fast the head moves."""
    from scipy.signal import savgol_filter

    window = max(5, round(BUMP * recording.fps) // 2 * 2 + 1)
    window = min(window, (len(centre) - 1) // 2 * 2 + 1)
    pushed = savgol_filter(centre, window, 3, deriv=2, delta=1 / recording.fps, axis=0)
    push = float(np.quantile(np.hypot(pushed[:, 0], pushed[:, 2]), QUANTILE))
    places = recording.positions - recording.positions[:, :1]
    speeds = velocity(places[:, [INDEX[name] for name in ("left_elbow", "right_elbow", "head")]], recording.fps, 0.0)
    head = float(np.quantile(np.linalg.norm(speeds[:, 2], axis=1), 0.9)) / max(recording.height, 1e-6)
    parts = (
        push**0.5,
        _frequency(speeds[:, :2].reshape(len(speeds), -1), recording.fps, 0.5),
        _frequency(velocity(centre, recording.fps, 0.0), recording.fps, 0.8),
        head,
    )
    return float(np.mean(np.log2(np.maximum(parts, 1e-3))))


def _frequency(speeds: Float64Array, fps: float, share: float) -> float:
    """Hz below which that share of the power of velocities [F, n] lies."""
    count = max(len(speeds), 512)
    waves = np.fft.rfft((speeds - speeds.mean(axis=0)) * np.hanning(len(speeds))[:, None], n=count, axis=0)
    power = np.cumsum(np.square(np.abs(waves)).sum(axis=1))
    return float(np.interp(share, power / max(power[-1], 1e-12), np.fft.rfftfreq(count, 1 / fps)))
