"""Made motions beside real ones, measure by measure, each motion for itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray
from motionlake.evaluation.synthesis.angles import TOLD, angular_ranges, never_turned
from motionlake.evaluation.synthesis.contact import footing
from motionlake.evaluation.synthesis.movement import (
    bone_length_drift,
    energy,
    energy_windows,
    jerk,
    path_turns,
    travel_speed,
    travel_windows,
)
from motionlake.motion.ground import Ground, ground_of
from motionlake.motion.skeleton import INDEX, JOINTS

USUAL: Final = (0.05, 0.95)  # quantiles of the seconds of real clips between which a second is usual


@dataclass(frozen=True, eq=False)
class Stretch:
    """A motion to be measured, made or real.

    Attributes:
        clips: names of the recordings that it is of, goes on from or stands beside.
        label: its class.
        positions: [F, 21, 3] joints in the world, metres, y up; two frames at least.
        fps: frames a second.
        rest_offsets: [21, 3] of its body, metres.
        ground: that of the whole recording.
        rotations: [G, 21, 4] local rotations at any rate; None where nothing tells them.
    """

    clips: frozenset[str]
    label: str
    positions: Float64Array
    fps: float
    rest_offsets: Float64Array
    ground: Ground
    rotations: FloatArray | None = None

    @classmethod
    def alone(cls, positions: Float64Array, fps: float, rest_offsets: Float64Array, **other: Any) -> Stretch:
        """Of a recording that is the whole motion."""
        given: dict[str, Any] = {"clips": frozenset(), "label": "", "ground": ground_of(positions)}
        return cls(positions=positions, fps=fps, rest_offsets=rest_offsets, **given | other)


def described(motion: Stretch) -> dict[str, float | None]:
    """The measures of `UNITS` of one motion; None where it is too short for one.

    Raises:
        ValueError: fewer than two frames, or a body without size.
    """
    feet = footing(motion.positions, motion.fps, motion.ground)
    jolts, turns = jerk(motion.positions, motion.fps), path_turns(motion.positions, motion.fps)
    return {
        "energy": energy(motion.positions, motion.fps),
        "travel_speed": travel_speed(motion.positions, motion.fps),
        "jerk": float(jolts.mean()) if len(jolts) else None,
        "jerk_peak": float(jolts.max()) if len(jolts) else None,
        "skate_ratio": feet.skates,
        "slide_speed": feet.slide,
        "contact": feet.contact,
        "penetration": feet.depth,
        "sunk": feet.sunk,
        "airborne": feet.airborne,
        "height": feet.height,
        "path_turns": turns and turns[0],
        "path_circling": turns and turns[1],
        "bone_length_drift": bone_length_drift(motion.positions, motion.rest_offsets),
    }


UNITS: Final[Mapping[str, str]] = {
    "energy": "m²/s²", "travel_speed": "m/s", "jerk": "m/s³", "jerk_peak": "m/s³", "skate_ratio": "share of frames",
    "slide_speed": "m/s", "contact": "share of frames", "penetration": "m", "sunk": "share of frames", "airborne": "s",
    "height": "m", "path_turns": "turns a metre", "path_circling": "turns a metre", "bone_length_drift": "%",
}  # fmt: skip
# Of these the worst motion counts, not the mean alone.
WORST: Final = ("jerk_peak", "penetration", "airborne", "height", "bone_length_drift")


@dataclass(frozen=True)
class Usual:
    """Between which energies and speeds of travel nine of ten seconds of the real clips of a class lie."""

    energy: tuple[float, float]
    travel: tuple[float, float]

    @classmethod
    def of(cls, motions: Sequence[Stretch]) -> Usual:
        """Of the clips of one class, one at least."""
        ranges = []
        for windows in (energy_windows, travel_windows):
            low, high = np.quantile(np.concatenate([windows(m.positions, m.fps) for m in motions]), USUAL)
            ranges.append((float(low), float(high)))
        return cls(*ranges)

    def fits(self, motion: Stretch) -> Float64Array:
        """[w] 1 where the second that begins at a frame has an energy and a speed that are usual, else 0."""
        sides = ((energy_windows, self.energy), (travel_windows, self.travel))
        each = [(windows(motion.positions, motion.fps), low, high) for windows, (low, high) in sides]
        count = min(len(values) for values, _, _ in each)
        fits = [(values[:count] >= low) & (values[:count] <= high) for values, low, high in each]
        return np.logical_and(*fits).astype(float)


def usual_of(motions: Sequence[Stretch]) -> dict[str, Usual]:
    """`Usual` of every class of real motions."""
    return {
        label: Usual.of([motion for motion in motions if motion.label == label])
        for label in sorted({motion.label for motion in motions})
    }


def beside(made: float | None, real: float | None) -> dict[str, float | None]:
    """Both, and their ratio where the real one is not zero."""
    ratio = made / real if made is not None and real else None
    return {"made": made, "real": real, "ratio": ratio}


class Measured:
    """Made motions, real ones, and what each is like."""

    def __init__(self, made: Sequence[Stretch], real: Sequence[Stretch], usual: Mapping[str, Usual]) -> None:
        self._sides = (list(made), list(real))
        self._found = tuple([described(motion) for motion in side] for side in self._sides)
        self._turned = tuple(
            [None if m.rotations is None else angular_ranges(m.rotations) for m in side] for side in self._sides
        )
        self._usual = tuple(
            [float(usual[m.label].fits(m).mean()) if m.label in usual else None for m in side] for side in self._sides
        )

    def of(self, made: Sequence[int], real: Sequence[int]) -> dict[str, Any]:
        """The measures of `UNITS` and `angular_range`, `never_turned`, of some motions of either side.

        Each {"made", "real", "ratio"}, means over motions, and "worst" of those of `WORST`: the greatest of both sides.
        """
        rows = (made, real)
        found: dict[str, Any] = {}
        for name in UNITS:
            sides = [[each[i][name] for i in at] for each, at in zip(self._found, rows, strict=True)]
            found[name] = beside(*map(_mean, sides))
            if name in WORST:
                found[name]["worst"] = dict(zip(("made", "real"), map(_greatest, sides), strict=True))
        found["usual"] = beside(*(_mean([each[i] for i in at]) for each, at in zip(self._usual, rows, strict=True)))
        ranges = [
            np.stack([one for i in at if (one := each[i]) is not None] or [np.full(len(JOINTS), np.nan)]).mean(axis=0)
            for each, at in zip(self._turned, rows, strict=True)
        ]
        found["angular_range"] = {
            name: beside(*(None if np.isnan(side).any() else float(side[at].mean()) for side in ranges))
            for name, at in (*((name, [INDEX[name]]) for name in TOLD), ("all", list(range(len(JOINTS)))))
        }
        turns = [
            [q for i in at if (q := side[i].rotations) is not None] for side, at in zip(self._sides, rows, strict=True)
        ]
        found["never_turned"] = dict(zip(("made", "real"), map(never_turned, turns), strict=True))
        return found


def _mean(values: Sequence[float | None]) -> float | None:
    return _over(np.mean, values)


def _greatest(values: Sequence[float | None]) -> float | None:
    return _over(np.max, values)


def _over(how: Callable[[list[float]], Any], values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(how(known)) if known else None
