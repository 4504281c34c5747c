"""Which way is up, told by the body where a file does not say."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.clip import SolvedMotion
from motionlake.motion.rest import Binding, mean_offsets
from motionlake.motion.rigs import Rest
from motionlake.motion.skeleton import INDEX, chained

# Share of the frames in which the head must be above the feet along one axis.
_SHARE: Final = 0.8
# Shares of the body's height: how far above and below the ground feet are that stand on it, how far below it no body
# lies, and how far above it none does.
_ANKLES: Final = (-0.05, 0.2)
_LYING: Final = (-0.02, 0.2)


def up_of_file(binding: Binding, motion: SolvedMotion) -> str | None:
    """The up axis of a file, where a person stands along it in the zero pose and in most frames as well.

    One of the two is not enough: people lie, and the root may turn a zero pose that lies. A body that stands along no
    axis in most frames must lie flat where the axis that the zero pose stands along is up. One that stands along
    another than that in most frames stands, if its feet are on the ground there and it would lie below the ground or
    above it here. None too where the rig's zero pose is no standing human.
    """
    top = binding.source.get(INDEX["head"], binding.source.get(INDEX["neck"]))
    feet = [binding.source[INDEX[foot]] for foot in ("left_ankle", "right_ankle") if INDEX[foot] in binding.source]
    if motion.world is None or binding.rig.rest is not Rest.ZERO or top is None or not feet:
        return None
    parents = binding.hierarchy.parents
    rest = chained(mean_offsets(parents, motion), parents)[None]
    moving, resting = (up_of_body(at[:, top], np.asarray(at[:, feet].mean(axis=1))) for at in (motion.positions, rest))
    if moving is None and resting is not None and _is_flat(motion.positions, resting):
        return resting
    if moving is None or moving == resting or resting is None:
        return moving if moving == resting else None
    here, there = (_along(motion.positions, axis) for axis in (resting, moving))
    height = float(np.ptp(_along(rest, resting)))
    on_ground = _share_between(there[:, feet].mean(axis=1), _ANKLES, height)
    lying = _share_between(here.min(axis=1), _LYING, height)
    return moving if on_ground >= _SHARE and lying <= 1 - _SHARE else None


def _along(positions: Float64Array, axis: str) -> Float64Array:
    """[F, J] how high joints [F, J, 3] are where an axis is up."""
    return np.asarray(positions[..., "xyz".index(axis[-1])] * (-1 if axis[0] == "-" else 1), np.float64)


def _share_between(values: Float64Array, bounds: tuple[float, float], height: float) -> float:
    """The share of values [F] that lie between bounds, which are shares of a height."""
    low, high = bounds
    return float(((values >= low * height) & (values <= high * height)).mean())


def _is_flat(positions: Float64Array, up: str) -> bool:
    """Whether in most frames the joints [F, J, 3] reach less far along an axis than along both others."""
    return bool((np.ptp(positions, axis=1).argmin(axis=1) == "xyz".index(up[-1])).mean() >= _SHARE)


def goes_on_all_fours(positions: Float64Array) -> bool:
    """Whether in most frames the trunk lies on hands and feet with the knees off the ground, as an animal's does.

    Args:
        positions: [F, 21, 3] of the canonical joints, y up.
    """
    height = {part: positions[:, [INDEX[f"left_{part}"], INDEX[f"right_{part}"]], 1].mean(axis=1)
              for part in ("wrist", "hip", "knee", "ankle")}  # fmt: skip
    leg = height["hip"] - height["ankle"]
    trunk = positions[:, INDEX["neck"]] - positions[:, INDEX["hips"]]
    lies = np.abs(trunk[:, 1]) < 0.5 * np.linalg.norm(trunk, axis=1)
    on_hands = np.abs(height["wrist"] - height["ankle"]) < 0.35 * leg
    off_knees = height["knee"] - np.minimum(height["wrist"], height["ankle"]) > 0.2 * leg
    return bool((lies & on_hands & off_knees).mean() >= _SHARE)


def up_of_body(head: Float64Array, feet: Float64Array) -> str | None:
    """The axis, one of y z -y -z, along which the head [F, 3] is above the feet [F, 3] in most frames.

    None where it is none of them: a body that lies or bends, or one that is long along x, which is up in no file.
    """
    body = head - feet
    longest = np.argmax(np.abs(body), axis=1)
    for axis, name in ((1, "y"), (2, "z")):
        along = body[longest == axis, axis]
        for sign in ("", "-"):
            if ((along < 0) if sign else (along > 0)).sum() >= _SHARE * len(body):
                return sign + name
    return None
