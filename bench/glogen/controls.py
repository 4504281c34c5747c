"""Controls of the measures of synthesis: real motions, and what is made of them that a measure must tell from them.

Each control takes real motions that follow a seed, and the clips that a generator may know, and gives as many motions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.evaluation.synthesis.copying import Aligned, copying
from motionlake.evaluation.synthesis.likeness import Describe
from motionlake.evaluation.synthesis.motions import Measured, Stretch, Usual, beside
from motionlake.evaluation.synthesis.variety import Windows, likeness, pose_spread, spread
from motionlake.motion.dtw import nearest_stretch
from motionlake.motion.features import body_length
from motionlake.motion.ground import FEET
from motionlake.motion.resampling import interpolated
from motionlake.motion.rotations import turn_about_y
from motionlake.motion.skeleton import INDEX

PACE: Final = 1.5  # of a copy that is warped in time
GLIDE: Final = 0.6  # metres a second to the side
DEEP: Final = 0.08  # metres
HIGH: Final = 0.15  # metres, above what a foot that swings clears
LIFT: Final = 0.025  # body lengths, as `glogen.feet` lifts feet
FAST: Final = 0.6  # body lengths a second
BEND: Final = 0.5  # radians a metre
STIFF: Final = ("head", "left_wrist", "right_wrist", "left_toe", "right_toe")
Control = Callable[[Sequence[Stretch], Sequence[Stretch]], list[Stretch]]


def _each(change: Callable[[Stretch], Stretch]) -> Control:
    return lambda real, known: [change(motion) for motion in real]


def _placed(motion: Stretch, positions: Float64Array) -> Stretch:
    return replace(motion, positions=positions)


def held(motion: Stretch) -> Stretch:
    """The first pose, held."""
    turned = None if motion.rotations is None else np.repeat(motion.rotations[:1], len(motion.rotations), axis=0)
    return replace(motion, positions=np.repeat(motion.positions[:1], len(motion.positions), axis=0), rotations=turned)


def shuffled(motion: Stretch) -> Stretch:
    """The same frames in another order, each where the body was then."""
    return _placed(motion, motion.positions[np.random.default_rng(0).permutation(len(motion.positions))])


def nearest(real: Sequence[Stretch], known: Sequence[Stretch]) -> list[Stretch]:
    """Of each the known clip with the nearest stretch: what a generator makes that only remembers."""
    frames = [Aligned.of(each.positions, each.fps).frames for each in known]
    found = []
    for motion in real:
        own = Aligned.of(motion.positions, motion.fps).frames
        costs = [
            nearest_stretch(own, other).cost if len(other) > 1 and not each.clips & motion.clips else np.inf
            for each, other in zip(known, frames, strict=True)
        ]
        found.append(replace(known[int(np.argmin(costs))], clips=motion.clips))
    return found


def warped(real: Sequence[Stretch], known: Sequence[Stretch]) -> list[Stretch]:
    """The same copies, half as fast again."""
    copies = nearest(real, known)
    return [_placed(copy, interpolated(copy.positions, np.arange(0, len(copy.positions) - 1, PACE))) for copy in copies]


def repeated(real: Sequence[Stretch], known: Sequence[Stretch]) -> list[Stretch]:
    """One real motion, as often as there are: nothing varies."""
    return [replace(real[0], clips=motion.clips) for motion in real]


def slid(motion: Stretch) -> Stretch:
    """The whole body glides to the side."""
    moved = motion.positions.copy()
    moved[..., 0] += GLIDE * np.arange(len(moved))[:, None] / motion.fps
    return _placed(motion, moved)


def sunk(motion: Stretch) -> Stretch:
    """The whole body is lower."""
    return _placed(motion, motion.positions - np.array([0, DEEP, 0]))


def floating(motion: Stretch) -> Stretch:
    """The whole body is higher."""
    return _placed(motion, motion.positions + np.array([0, HIGH, 0]))


def lifted(motion: Stretch) -> Stretch:
    """Feet that travel are higher, by what inverse kinematics may lift them: a measure of sliding must not care."""
    moved, size = motion.positions.copy(), body_length(motion.positions)
    for joint in np.ravel(FEET).tolist():
        speed = np.linalg.norm(np.gradient(moved[:, joint][:, [0, 2]], axis=0), axis=1) * motion.fps
        moved[speed > FAST * size, joint, 1] += LIFT * size
    return _placed(motion, moved)


def shaken(motion: Stretch) -> Stretch:
    """Each joint trembles by a centimetre."""
    return _placed(motion, motion.positions + 0.01 * np.random.default_rng(0).standard_normal(motion.positions.shape))


def circling(motion: Stretch) -> Stretch:
    """The same motion along a path that bends to the left."""
    root = motion.positions[:, INDEX["hips"]].copy()
    steps = np.diff(root, axis=0)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps[:, [0, 2]], axis=1))])
    turned = turn_about_y(steps[:, None], BEND * way[:-1])[:, 0]
    path = root[0] + np.concatenate([np.zeros((1, 3)), np.cumsum(turned, axis=0)])
    return _placed(motion, turn_about_y(motion.positions - root[:, None], BEND * way) + path[:, None])


def stiff(motion: Stretch) -> Stretch:
    """Hands, head and toes never turn."""
    if motion.rotations is None:
        return motion
    turned = motion.rotations.copy()
    turned[:, [INDEX[name] for name in STIFF]] = [1, 0, 0, 0]
    return replace(motion, rotations=turned)


def known_clips(real: Sequence[Stretch], known: Sequence[Stretch]) -> list[Stretch]:
    """The known clips: what a good generator would make."""
    return list(known)


def unchanged(real: Sequence[Stretch], known: Sequence[Stretch]) -> list[Stretch]:
    """The real motions themselves."""
    return list(real)


CONTROLS: Final[Mapping[str, Control]] = {
    "real": unchanged, "known": known_clips, "held": _each(held), "shuffled": _each(shuffled), "nearest": nearest,
    "warped": warped,
    "repeated": repeated, "slid": _each(slid), "sunk": _each(sunk), "floating": _each(floating),
    "lifted": _each(lifted), "shaken": _each(shaken), "circling": _each(circling), "stiff": _each(stiff),
}  # fmt: skip


# By measure and control, which way the measure must go from that of the real motions themselves ("real", or "known" of
# what compares with known clips): "less", "more", or "same", about. Less is to be under half, more over one and a half.
EXPECTED: Final[Mapping[str, Mapping[str, str]]] = {
    "energy": {"held": "less", "warped": "more", "slid": "same", "sunk": "same", "known": "same"},
    "travel_speed": {"held": "less", "sunk": "same", "known": "same"},
    "usual": {"held": "less", "shuffled": "less", "known": "same", "sunk": "same"},
    "jerk": {"held": "less", "shuffled": "more", "shaken": "more", "warped": "more", "slid": "same", "known": "same"},
    "jerk_peak": {"held": "less", "shuffled": "more", "shaken": "more", "slid": "same"},
    "skate_ratio": {"slid": "more", "shaken": "more", "held": "less", "lifted": "same", "stiff": "same"},
    "slide_speed": {"slid": "more", "shaken": "more", "held": "less", "lifted": "same", "sunk": "same"},
    "contact": {"floating": "less", "lifted": "same", "known": "same"},
    "penetration": {"sunk": "more", "floating": "less", "slid": "same", "lifted": "same"},
    "sunk": {"sunk": "more", "floating": "less"},
    "airborne": {"floating": "more", "sunk": "less"},
    "height": {"floating": "more", "sunk": "less"},
    "bone_length_drift": {"shaken": "more", "slid": "same"},
    "angular_range.left_wrist": {"stiff": "less", "held": "less", "slid": "same"},
    "angular_range.head": {"stiff": "less", "held": "less", "slid": "same"},
    "angular_range.left_toe": {"stiff": "less", "held": "less", "slid": "same"},
    "never_turned": {"stiff": "more", "slid": "same"},
    "diversity": {"repeated": "less", "held": "less", "known": "same"},
    "pose_spread": {"repeated": "less", "known": "same"},
    "likeness.fid": {"held": "more", "shuffled": "more", "repeated": "more", "slid": "more"},
    "likeness.precision": {"known": "same", "nearest": "same"},
    "likeness.recall": {"held": "less", "repeated": "less", "shuffled": "less", "known": "same"},
    "likeness.density": {"held": "less", "known": "same", "nearest": "same"},
    "likeness.coverage": {"held": "less", "known": "same", "nearest": "same"},
    "nearest_real.median": {"nearest": "less", "warped": "less", "known": "same"},
    "nearest_real.unseen": {"nearest": "less", "warped": "less", "known": "same"},
}  # fmt: skip


def figures(
    made: Sequence[Stretch], real: Sequence[Stretch], known: Sequence[Stretch], usual: Mapping[str, Usual],
    describe: Describe,
) -> dict[str, Any]:  # fmt: skip
    """Every measure of a set of motions beside real ones, as `measure_generator` has them but for errors and seams."""
    windows, others = (Windows(some, describe) for some in (made, real))
    count = min(len(windows.vectors), len(Windows(known, describe).vectors))
    frames = [[Aligned.of(each.positions, each.fps, *each.clips) for each in some] for some in (made, real, known)]
    varied = [spread(each.vectors, each.of, each.place) for each in (windows, others)]
    copies = copying(frames[0], frames[1], frames[2], frames[2], frames[1], lambda what, done, total: None)
    return {
        **Measured(made, real, usual).of(range(len(made)), range(len(real))),
        "likeness": likeness(others.vectors, windows.vectors, count),
        "diversity": beside(*varied),
        "pose_spread": beside(pose_spread(made), pose_spread(real)),
        "nearest_real": copies,
    }


def flat(found: Mapping[str, Any]) -> dict[str, float | None]:
    """The numbers of `figures` by name: of what is made, not of what is beside it."""
    kept: dict[str, float | None] = {}
    for name, value in found.items():
        if name in {"likeness", "nearest_real"} or not isinstance(value, Mapping):
            continue
        if name == "angular_range":
            kept |= {f"{name}.{joint}": one["made"] for joint, one in value.items()}
        elif name == "never_turned":
            kept[name] = float(len(value["made"]))
        elif "made" in value:
            kept[name] = value["made"]
            if "worst" in value:
                kept[f"{name}.worst"] = value["worst"]["made"]
    kept |= {f"likeness.{name}": float(value) for name, value in (found["likeness"] or {}).items() if name != "n"}
    near = found["nearest_real"]
    if near:
        kept |= {"nearest_real.median": near["made"]["median"], "nearest_real.near": near["near"]}
        kept |= {"nearest_real.z": near["z"], "nearest_real.unseen": near["unseen"] and near["unseen"]["ratio"]}
    return kept
