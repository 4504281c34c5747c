"""HumanML3D's motions in NumPy arrays: joints [F, 22, 3] (`new_joints`) or features [F, 263] (`new_joint_vecs`)."""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np
from motionlake.arrays import Float64Array, FloatArray
from motionlake.errors import ClipError
from motionlake.formats.limits_config import FARTHEST, limits
from motionlake.formats.parse.npz_members import MAGIC, described, npy_array, npy_header
from motionlake.motion.clip import Hierarchy, SourceClip
from motionlake.motion.humanml3d import FEATURES, FPS, are_turns, recovered
from motionlake.motion.smpl import BODY_JOINTS, JOINTS, PARENTS, smpl_clip
from motionlake.motion.smpl_from_joints import bones_at_rest, joints_turn, tell_of_a_body
from numpy.typing import NDArray

Number = TypeVar("Number", bound=FloatArray)

KIT_JOINTS: Final = 21
KIT_FEATURES: Final = 251
SMALLEST_TURNS: Final = "rotations come from positions: HumanML3D's own do not know turns about bones"
STANDARDISED: Final = (
    "its numbers of rotations are none; if the features are standardised, multiply by Std.npy and add Mean.npy"
)
# Millimetres by which joints may miss their places, for bones of one length, before a note says so.
MISSED: Final = 1.0
_NAME: Final = "motion"


class HumanML3DReader:
    """HumanML3D `.npy`, y up, metres, 20 frames a second."""

    name = "HumanML3D"
    suffixes = (".npy",)
    opening = MAGIC

    def sniff(self, head: bytes) -> bool:
        """Whether a file that begins so is one, or a damaged one: other arrays are told by their shape."""
        header = npy_header(head)
        if header is None:
            return True
        last = header[0][1:]
        return last in ((BODY_JOINTS, 3), (FEATURES,), (KIT_JOINTS, 3), (KIT_FEATURES,))

    def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
        """Read one body, at `fps` in place of HumanML3D's rate.

        Raises:
            ClipError: the array or its shape is bad, it is one of KIT-ML, or its features are standardised.
        """
        numbers = _numbers(data)
        rate = FPS if fps is None else fps
        exact = _in_double(numbers)
        return [_of_joints(exact, rate) if exact.ndim == 3 else _of_features(_checked(exact), rate)]


def read_numbers(data: bytes) -> FloatArray:
    """[F, 22, 3] joints or [F, 263] features of a file, as precise as it has them, checked.

    Raises `ClipError` as `read` does.
    """
    array = _numbers(data)
    if array.dtype.kind == "f" and array.dtype.itemsize == 4:
        return _checked(array.astype(np.float32, copy=False))
    return _checked(_in_double(array))


def _in_double(array: NDArray[Any]) -> Float64Array:
    """The numbers in double precision; one that is too large for it is infinite."""
    if array.dtype.itemsize <= 8:
        return array.astype(np.float64)
    with np.errstate(invalid="ignore", over="ignore"):
        return array.astype(np.float64)


def _numbers(data: bytes) -> NDArray[Any]:
    """The array of a file that holds joints or features, as it lies there."""
    array = npy_array(data, _NAME, _check_room)
    if array.dtype.kind not in "fiu":
        raise ClipError(f"is {described(array)}, not numbers")
    if array.shape[1:] in ((KIT_JOINTS, 3), (KIT_FEATURES,)):
        raise ClipError(f"is {described(array)}, of KIT-ML, whose skeleton is another; HumanML3D has 22 joints")
    if array.shape[1:] not in ((BODY_JOINTS, 3), (FEATURES,)):
        raise ClipError(f"is {described(array)}, not [frames, 22, 3] or [frames, 263]")
    if not len(array):
        raise ClipError("has no frame")
    return array


def _checked(numbers: Number) -> Number:
    """The same numbers; `ClipError` where one cannot be a place or a feature."""
    if not (numbers.min() >= -FARTHEST and numbers.max() <= FARTHEST):  # false for NaN too
        raise ClipError("has a number that is not finite or absurdly large")
    return numbers


def _of_joints(positions: Float64Array, fps: float) -> SourceClip:
    channels = positions.reshape(len(positions), -1)
    return SourceClip(_hierarchy(), channels, fps, metres_per_unit=1.0, up="y", twist=False)


@functools.cache
def _hierarchy() -> Hierarchy:
    """The tree of all clips of joints; nothing writes to its arrays."""
    tree = Hierarchy.of_positions(JOINTS[:BODY_JOINTS], PARENTS[:BODY_JOINTS])
    for array in (tree.offsets, tree.axes):
        array.setflags(write=False)
    return tree


def _of_features(rows: Float64Array, fps: float) -> SourceClip:
    """A clip with a frame more than there are features: the ways of the last one lead to it."""
    from motionlake.motion.kinematics import continuous_signs, local_rotations, solve

    if not are_turns(rows):
        raise ClipError(STANDARDISED)
    found = recovered(rows)
    twist = tell_of_a_body(found.positions[:-1], found.bones)
    world = joints_turn(found.positions, found.bones if twist else None)
    offsets = bones_at_rest(found.positions, world)
    local = continuous_signs(local_rotations(world, PARENTS[:BODY_JOINTS]))
    clip = smpl_clip(found.positions[:, 0], local, fps, offsets=offsets, twist=twist)
    notes = [] if twist else [SMALLEST_TURNS]
    missed = 1000 * float(np.linalg.norm(solve(clip).positions - found.positions, axis=-1).max())
    if missed > MISSED:
        notes.append(f"bones keep their mean lengths: joints are up to {missed:.0f} mm from where the features say")
    return replace(clip, notes=tuple(notes))


def _check_room(name: str, shape: tuple[int, ...], length: int) -> None:
    """What lets an array of so many bytes pass."""
    if shape:
        # A number takes eight bytes here, whatever it takes in the file.
        numbers = math.prod(shape)
        limits().check_body(shape[0], BODY_JOINTS, length + numbers * 8)


READER: Final = HumanML3DReader()
