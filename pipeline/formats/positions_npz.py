"""Joint positions in a NumPy archive: `positions` [frames, joints, 3] in metres, `joints`, `parents`, `fps`."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.limits_config import limits
from motionlake.formats.parse.npz_members import NpzArchive, RoomCheck, described
from motionlake.formats.repair import fill_missing, missing_samples, repair_note
from motionlake.motion.clip import Hierarchy, SourceClip, depth_first
from numpy.typing import NDArray

MEMBERS: Final = ("positions", "joints", "parents", "fps")
RATE: Final = "fps"
MAX_NAME: Final = 256  # characters of a joint's name


class PositionsReader:
    """Positions `.npz`, the interchange form of Kinect-like data sets."""

    name = "positions"
    suffixes = (".npz",)

    def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
        """Read one body, at `fps` in place of the archive's own.

        Raises:
            ClipError: the archive, a shape, the joint tree or the rate is bad.
        """
        archive, room = NpzArchive(data), _check_room(len(data))
        needed = MEMBERS if fps is None else tuple(name for name in MEMBERS if name != RATE)
        if lacking := [name for name in needed if name not in archive.names]:
            raise ClipError(f"has no array {lacking[0]!r} (needed: {', '.join(MEMBERS)})")
        members = {name: archive.array(name, room) for name in needed}
        positions, joints, parents = members["positions"], members["joints"], members["parents"]
        if positions.ndim != 3 or positions.shape[2] != 3 or positions.dtype.kind not in "fiu":
            raise ClipError(f"positions is {described(positions)}, not numbers [frames, joints, 3]")
        if joints.ndim != 1 or joints.dtype.kind not in "US":
            raise ClipError(f"joints is {described(joints)}, not a list of names")
        if parents.ndim != 1 or parents.dtype.kind not in "iu":
            raise ClipError(f"parents is {described(parents)}, not a list of indices")
        rate = members[RATE] if fps is None else np.array(fps)
        if rate.size != 1 or rate.dtype.kind not in "fiu":
            raise ClipError(f"fps is {described(rate)}, not one number")
        if not len(joints) == len(parents) == positions.shape[1] > 0:
            counts = f"{positions.shape[1]} joints in positions, {len(joints)} names, {len(parents)} parents"
            raise ClipError(f"counts differ: {counts}")
        names = _names(joints)
        if len(set(names)) < len(names):
            raise ClipError("has two joints of one name")
        order = parents_first(parents.tolist())
        return [_clip(positions.astype(np.float64), names, parents.tolist(), order, float(rate.item()))]


def _names(joints: NDArray[Any]) -> list[str]:
    """The names of joints; `ClipError` where they hold what is no text (an array holds any 32 bits as a character)."""
    codec, size, raw = "utf-8", joints.dtype.itemsize, joints.tobytes()
    if joints.dtype.kind == "U":
        codec = "utf-32-be" if joints.dtype.str.startswith(">") else "utf-32-le"
    try:
        return [raw[place * size : (place + 1) * size].decode(codec).rstrip("\0") for place in range(len(joints))]
    except UnicodeDecodeError as error:
        raise ClipError("has names of joints that are no text") from error


def parents_first(parents: list[int]) -> list[int]:
    """The joints' indices, parents before children; `parents` are J indices, any negative one at the root.

    Raises:
        ClipError: an index out of range, no root, several roots, or a joint not under the root.
    """
    for joint, parent in enumerate(parents):
        if parent >= len(parents):
            raise ClipError(f"joint {joint} has parent {parent}, but there are {len(parents)} joints")
    roots = sum(parent < 0 for parent in parents)
    if roots != 1:
        raise ClipError(f"has {roots} root joints; one body has one")
    if all(parent < joint for joint, parent in enumerate(parents)):
        return list(range(len(parents)))
    order = depth_first([max(parent, -1) for parent in parents])
    if len(order) < len(parents):
        raise ClipError(f"{len(parents) - len(order)} joints are their own ancestors")
    return order


def _clip(positions: Float64Array, names: list[str], parents: list[int], order: list[int], fps: float) -> SourceClip:
    reordered = order != list(range(len(order)))
    positions = positions[:, order]
    joints = tuple(names[joint] for joint in order)
    filled, repaired = fill_missing(positions, missing_samples(positions), joints)
    rank = {joint: place for place, joint in enumerate(order)} | {-1: -1}
    hierarchy = Hierarchy.of_positions(joints, tuple(rank[max(parents[joint], -1)] for joint in order))
    notes = ("joints reordered: parents before children",) if reordered else ()
    return SourceClip(
        hierarchy=hierarchy,
        channels=filled.reshape(len(filled), -1),
        fps=fps,
        metres_per_unit=1.0,
        repaired=repaired,
        notes=notes + repair_note(repaired, len(filled)),
    )


def _check_room(size: int) -> RoomCheck:
    """What lets arrays of a file of `size` bytes pass."""

    def check(name: str, shape: tuple[int, ...], length: int) -> None:
        allowed = limits()
        if name == "positions" and len(shape) == 3:
            allowed.check_body(shape[0], shape[1], size + length)
        # Names and parents, one a joint; one rate.
        elif length > allowed.joints * MAX_NAME * 4:
            raise ClipError(f"array {name!r} is {length} bytes long")

    return check


READER: Final = PositionsReader()
