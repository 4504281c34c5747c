"""Two seconds of motion as numbers that no generator has seen, and whether made ones are like real ones.

Two spaces: descriptors of the network of the package, which pay little heed to pace, and how fast joints move in the
world (Onuma et al. 2008), which say nothing of poses.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array, FloatArray, Int64Array
from motionlake.deephums.sequence import clip_sequence
from motionlake.evaluation.synthesis.copying import rank_z
from motionlake.evaluation.synthesis.motions import Stretch
from motionlake.evaluation.synthesis.variety import WINDOW, held_in_balls, neighbourhoods
from motionlake.motion.features import body_length
from motionlake.motion.skeleton import body_poses
from scipy.spatial.distance import cdist

from bench.glogen.measured import package_descriptor

SPAN: Final = 0.1  # seconds over which speeds are taken
EVERY: Final = 3  # frames at 30 a second, of windows that are compared pose by pose
# Neighbours that a ball reaches to. With five, as is usual, and some twenty windows one walk again and again has more
# than half of the coverage that other walks have.
NEAREST: Final = 3
LEAST: Final = 4  # windows of a set, to have neighbours
MOST: Final = 4000  # windows that copies are looked for among
NEAR: Final = 0.05  # quantile of unseen real windows, nearer than which a made one is near
SHARES: Final = ("coverage", "density")
INTERVAL: Final = (0.05, 0.95)
Space = Callable[[Sequence[Float64Array], float], FloatArray]


def width_of(known: Sequence[Stretch]) -> float:
    """Seconds of a window: two, or what half of the real motions have, where that is less."""
    return float(min(WINDOW, np.median([len(each.positions) / each.fps for each in known])))


def windows(motions: Sequence[Stretch], seconds: float) -> list[Float64Array]:
    """Parts of motions, one after the other; a rest is left out, a shorter motion is a window."""
    found = []
    for motion in motions:
        width = max(2, round(seconds * motion.fps))
        stops = range(width, max(width, len(motion.positions)) + 1, width)
        found += [motion.positions[stop - width : stop] for stop in stops]
    return found


def descriptors(parts: Sequence[Float64Array], fps: float) -> FloatArray:
    """[n, 512] of the network of the package."""
    return package_descriptor().embed([clip_sequence(part, fps) for part in parts])


def paces(parts: Sequence[Float64Array], fps: float) -> Float64Array:
    """[n, 63] root mean squares of the speed of each joint along the ground, up and down, and of its acceleration.

    Body lengths, seconds; logarithms, so that slow joints count as fast ones do.
    """
    step, found = max(1, round(SPAN * fps)), []
    for part in parts:
        joints = part.astype(float) / body_length(part)
        step = min(step, max(1, (len(joints) - 1) // 2))
        speed = (joints[step:] - joints[:-step]) * fps / step
        change = (speed[step:] - speed[:-step]) * fps / step
        squares = [
            np.square(speed[..., [0, 2]]).sum(axis=-1), np.square(speed[..., 1]), np.square(change).sum(axis=-1)
        ]  # fmt: skip
        found.append(np.concatenate([np.log(0.02 + np.sqrt(each.mean(axis=0))) for each in squares]))
    return np.array(found)


SPACES: Final[dict[str, Space]] = {"descriptors": descriptors, "paces": paces}


def likeness(
    unseen: Sequence[Stretch], known: Sequence[Stretch], made: Sequence[Stretch], space: Space
) -> dict[str, Any] | None:
    """Coverage and density of unseen real motions by made ones, beside what as many of the known real ones reach.

    None where there are too few for neighbours. `balls` is what `intervals` reads.
    """
    seconds, fps = width_of(known), unseen[0].fps
    real, own, other = (space(windows(some, seconds), fps) for some in (unseen, known, made))
    count = min(len(own), len(other))
    if min(len(real), count) < LEAST:
        return None
    sides = {"made": _some(other, count), "known": _some(own, count)}
    return {
        **{side: neighbourhoods(real, some, NEAREST) for side, some in sides.items()},
        "n": {"unseen": len(real), "each": count},
        "balls": Balls(
            np.repeat(np.arange(len(unseen)), [len(windows([motion], seconds)) for motion in unseen]),
            *(held_in_balls(real, some, NEAREST) for some in sides.values()),
        ),
    }


@dataclass(frozen=True)
class Balls:
    """The unseen windows [n] of one fold, and which of m made and known ones are in the balls about them.

    Attributes:
        of: [n] the motion that each is of.
        made, known: [n, m].
    """

    of: Int64Array
    made: BoolArray
    known: BoolArray

    def drawn(self, rng: np.random.Generator) -> list[list[float]]:
        """Coverage and, but for a factor, density by made and by known windows, all drawn again: unseen by motion."""
        count = int(self.of.max()) + 1
        times = np.bincount(rng.integers(count, size=count), minlength=count)[self.of]
        found = []
        for inside in (self.made, self.known):
            some = inside[:, rng.integers(inside.shape[1], size=inside.shape[1])]
            found.append([float(times @ each / times.sum()) for each in (some.any(axis=1), some.sum(axis=1))])
        return found


def intervals(folds: Sequence[Balls], draws: int = 1000) -> dict[str, list[float]]:
    """Between which shares of made over known nine in ten draws are, all windows drawn again in every fold."""
    rng = np.random.default_rng(0)
    sums = np.array([np.sum([fold.drawn(rng) for fold in folds], axis=0) for _ in range(draws)])
    shares = sums[:, 0] / np.maximum(sums[:, 1], 1e-9)
    return {name: np.quantile(shares[:, i], INTERVAL).tolist() for i, name in enumerate(SHARES)}


def _some(rows: FloatArray, count: int) -> FloatArray:
    """So many at even distances."""
    return np.asarray(rows[np.linspace(0, len(rows) - 1, count).round().astype(int)])


def _poses(parts: Sequence[Float64Array]) -> Float64Array:
    """[n, d] joints seen from the body, body lengths, every tenth of a second; the mean distance of windows."""
    size = [body_length(part) for part in parts]
    return np.stack([(body_poses(p)[::EVERY] / s).ravel() for p, s in zip(parts, size, strict=True)])


def all_windows(motions: Sequence[Stretch], seconds: float) -> list[Float64Array]:
    """Parts of motions from every frame on, and mirrored ones: where copies are looked for."""
    from motionlake.motion.skeleton import mirrored_positions

    found: list[Float64Array] = []
    for motion in motions:
        width = max(2, round(seconds * motion.fps))
        for joints in (motion.positions, np.asarray(mirrored_positions(motion.positions), dtype=float)):
            found += [joints[start : start + width] for start in range(len(joints) - width + 1)]
    return found


def copies(unseen: Sequence[Stretch], known: Sequence[Stretch], made: Sequence[Stretch]) -> dict[str, Any] | None:
    """How near the nearest windows of known and of unseen real motions are: medians, body lengths a pose of 63 numbers.

    As many windows of either are looked among. `near`: share of made windows that are nearer to known ones than all but
    5 % of unseen real windows are; `z` (Meehan et al. 2020): below -3 made motions are copies of known ones. None where
    there is no window.
    """
    seconds = width_of(known)
    wide = [[m for m in some if len(m.positions) >= round(seconds * m.fps)] for some in (unseen, known, made)]
    parts = [windows(some, seconds) for some in wide]
    among = [all_windows(some, seconds) for some in wide[:2]]
    if not all(parts) or not all(among):
        return None
    count = min(MOST, *map(len, among))
    others, own = (_poses([some[i] for i in _places(len(some), count)]) for some in among)
    real, _, asked = map(_poses, parts)
    nearest = partial(_nearest, scale=np.sqrt(real.shape[1] / 63))
    to_known, to_unseen, usual = nearest(asked, own), nearest(asked, others), nearest(real, own)
    return {
        "made_known": float(np.median(to_known)), "made_unseen": float(np.median(to_unseen)),
        "unseen_known": float(np.median(usual)), "near": float(np.mean(to_known < np.quantile(usual, NEAR))),
        "z": rank_z(to_known, usual), "n": len(asked),
    }  # fmt: skip


def _places(length: int, count: int) -> list[int]:
    return [int(place) for place in np.linspace(0, length - 1, count).round()]


def _nearest(asked: Float64Array, among: Float64Array, scale: float) -> Float64Array:
    return np.asarray(cdist(asked, among).min(axis=1) / scale)
