"""AMASS and SMPL motion in a NumPy archive: axis-angle rotations of SMPL, SMPL-H or SMPL-X joints and a translation.

Bones are those of the mean body, for the shape parameters (`betas`) mean nothing without the body model (docs/smpl.md).
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.limits_config import MOST_DEGREES, limits
from motionlake.formats.parse.npz_members import NpzArchive, RoomCheck, described, directory_holds, tail_holds
from motionlake.formats.registry import COMPRESSED_SUFFIX, load_bytes
from motionlake.motion.clip import SourceClip
from motionlake.motion.rotations import IDENTITY, from_vectors
from motionlake.motion.smpl import BODY_JOINTS, JOINTS, PELVIS, smpl_channels, smpl_hierarchy
from numpy.typing import NDArray

UP: Final = "z"
MEAN_BODY: Final = "bone lengths are the mean body's: no body model"
NO_FINGERS: Final = "fingers, jaw and eyes are left out"
RATES: Final = ("mocap_framerate", "mocap_frame_rate", "fps")
# The rotations: all in one array, or the pelvis apart from the body, as AMASS and as the package smplx call them.
POSES: Final = (("poses",), ("root_orient", "pose_body"), ("global_orient", "body_pose"))
PLACES: Final = ("trans", "transl")
_SMPL_NUMBERS: Final = 3 * len(JOINTS)
_BODY_NUMBERS: Final = 3 * BODY_JOINTS
_FEW_BYTES: Final = 1024


class AmassReader:
    """AMASS `.npz`, z up, metres."""

    name = "AMASS"
    suffixes = (".npz",)

    def claims(self, path: Path) -> bool:
        """Whether the archive lists poses of SMPL."""
        if not path.name.lower().endswith(COMPRESSED_SUFFIX):
            return any(directory_holds(path, *names) for names in POSES)
        try:
            data = load_bytes(path)
        except ClipError:
            return False
        return any(tail_holds(data, *names) for names in POSES)

    def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
        """Read one body, at `fps` in place of the archive's own rate.

        Raises:
            ClipError: the archive, an array's shape or the rate is bad.
        """
        archive, room = NpzArchive(data), _check_room(len(data))
        chosen = next((names for names in POSES if archive.names.issuperset(names)), POSES[0])
        tables = [_table(archive, name, room) for name in chosen]
        rotations = np.hstack(tables) if len(tables) > 1 else tables[0]
        if rotations.shape[1] < _BODY_NUMBERS or rotations.shape[1] % 3:
            raise ClipError(
                f"has {rotations.shape[1]} numbers of rotation a frame, not three for each of 22 or more joints"
            )
        places = _table(archive, next((name for name in PLACES if name in archive.names), PLACES[0]), room)
        if places.shape != (len(rotations), 3):
            raise ClipError(f"trans is {described(places)}, not {len(rotations)} frames of three numbers")
        notes = (MEAN_BODY, NO_FINGERS) if rotations.shape[1] > _SMPL_NUMBERS else (MEAN_BODY,)
        rate = fps if fps is not None else _rate(archive, room)
        channels, root, turns = smpl_channels(len(rotations), len(JOINTS))
        np.add(places, PELVIS, out=root)
        _fill_quaternions(rotations, turns)
        hierarchy = smpl_hierarchy()
        return [SourceClip(hierarchy, channels, rate, metres_per_unit=1.0, up=UP, notes=notes)]


def _table(archive: NpzArchive, name: str, room: RoomCheck) -> Float64Array:
    """[F, C] an array of numbers with a row a frame; what has more axes is taken with one."""
    array = archive.array(name, room)
    if array.ndim not in (2, 3) or array.dtype.kind not in "fiu":
        raise ClipError(f"{name} is {described(array)}, not numbers of every frame")
    table = array.reshape(len(array), -1).astype(np.float64, copy=False)
    if not np.isfinite(table).all():
        raise ClipError(f"{name} has a number that is not finite")
    return table


def _fill_quaternions(rotations: Float64Array, turns: Float64Array) -> None:
    """Fill turns [F, 24, 4] of axis-angle numbers [F, C], radians.

    Hands that the file does not have as one joint do not turn.
    """
    joints = len(JOINTS) if rotations.shape[1] == _SMPL_NUMBERS else BODY_JOINTS
    vectors, most = rotations[:, : 3 * joints], np.deg2rad(MOST_DEGREES)
    if not (-most <= vectors.min(initial=0.0) and vectors.max(initial=0.0) <= most):
        raise ClipError("has a rotation that is absurdly large")
    from_vectors(vectors.reshape(len(rotations), joints, 3), out=turns[:, :joints])
    turns[:, joints:] = IDENTITY


def _rate(archive: NpzArchive, room: RoomCheck) -> float:
    name = next((name for name in RATES if name in archive.names), None)
    if name is None:
        raise ClipError(f"has no frame rate ({RATES[0]}): say --fps")
    rate: NDArray[Any] = archive.array(name, room)
    if rate.size != 1 or rate.dtype.kind not in "fiu":
        raise ClipError(f"{name} is {described(rate)}, not one number: say --fps")
    return float(rate.item())


def _check_room(size: int) -> RoomCheck:
    """What lets arrays of a file of `size` bytes pass."""

    def check(name: str, shape: tuple[int, ...], length: int) -> None:
        if name in RATES:
            if length > _FEW_BYTES:
                raise ClipError(f"array {name!r} is {length} bytes long")
        elif shape:
            # A number takes eight bytes here, whatever it takes in the file.
            numbers = math.prod(shape[1:])
            limits().check_body(shape[0], -(-numbers // 3), size + shape[0] * numbers * 8)

    return check


READER: Final = AmassReader()
