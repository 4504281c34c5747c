"""Joint positions in a NumPy archive: `positions` [frames, joints, 3] in metres, `joints`, `parents`, `fps`.

The archive is read member by member rather than with `numpy.load`, so that a damaged or hostile header
cannot ask for more memory than the member holds.
"""

from __future__ import annotations

import io
import math
import struct
import tokenize
import zipfile
import zlib
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.limits_config import MIB, limits
from motionlake.formats.repair import fill_missing, missing_samples, repair_note
from motionlake.motion.clip import Hierarchy, SourceClip, depth_first
from numpy.typing import NDArray

MEMBERS: Final = ("positions", "joints", "parents", "fps")
RATE: Final = "fps"
MAX_HEADER_BYTES: Final = 12_000  # NumPy reads headers of up to 10,000
MAX_ENTRIES: Final = 1_000
MAX_NAME: Final = 256  # characters of a joint's name
_ENTRY: Final = b"PK\x01\x02"
_HEADERS: Final[dict[tuple[int, int], Any]] = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
COMPRESSIONS: Final = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


class PositionsReader:
    """Positions `.npz`, the interchange form of Kinect-like data sets."""

    name = "positions"
    suffixes = (".npz",)

    def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
        """Read one body, at `fps` in place of the archive's own.

        Raises:
            ClipError: the archive, a shape, the joint tree or the rate is bad.
        """
        members = _members(data, MEMBERS if fps is None else tuple(name for name in MEMBERS if name != RATE))
        positions, joints, parents = members["positions"], members["joints"], members["parents"]
        if positions.ndim != 3 or positions.shape[2] != 3 or positions.dtype.kind not in "fiu":
            raise ClipError(f"positions is {_describe(positions)}, not numbers [frames, joints, 3]")
        if joints.ndim != 1 or joints.dtype.kind not in "US":
            raise ClipError(f"joints is {_describe(joints)}, not a list of names")
        if parents.ndim != 1 or parents.dtype.kind not in "iu":
            raise ClipError(f"parents is {_describe(parents)}, not a list of indices")
        rate = members[RATE] if fps is None else np.array(fps)
        if rate.size != 1 or rate.dtype.kind not in "fiu":
            raise ClipError(f"fps is {_describe(rate)}, not one number")
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


def _members(data: bytes, names: tuple[str, ...]) -> dict[str, NDArray[Any]]:
    if data.count(_ENTRY) > MAX_ENTRIES:
        raise ClipError(f"is an archive of more than {MAX_ENTRIES} files")
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return {name: _array(archive, name, len(data)) for name in names}
    except (zipfile.BadZipFile, zlib.error, struct.error, OSError, EOFError, ValueError, OverflowError) as error:
        raise ClipError(f"damaged .npz archive: {error}") from error
    except (NotImplementedError, RuntimeError) as error:
        raise ClipError(f"unsupported .npz archive: {error}") from error


def _array(archive: zipfile.ZipFile, name: str, size: int) -> NDArray[Any]:
    """An array of an archive of `size` bytes, of which no more is read than its header before it is known to fit."""
    try:
        member = archive.getinfo(f"{name}.npy")
    except KeyError as error:
        raise ClipError(f"has no array {name!r} (needed: {', '.join(MEMBERS)})") from error
    if member.compress_type not in COMPRESSIONS:
        raise ClipError(f"array {name!r} is compressed in an unknown way")
    limits().check("memory_megabytes", member.file_size / MIB, f"array {name!r} is {member.file_size} bytes long")
    with archive.open(member) as stream:
        head = io.BytesIO(stream.read(MAX_HEADER_BYTES))
    try:
        shape, fortran, dtype = _HEADERS[np.lib.format.read_magic(head)](head)
    except (KeyError, ValueError, SyntaxError, TypeError, tokenize.TokenError) as error:
        raise ClipError(f"array {name!r} has a damaged header") from error
    if dtype.hasobject:
        raise ClipError(f"array {name!r} holds Python objects, which are never loaded")
    start = head.tell()
    length = member.file_size - start
    if min(shape, default=0) < 0 or math.prod(shape) * dtype.itemsize != length:
        raise ClipError(f"array {name!r} is {length} bytes long, but its header says {shape} {dtype}")
    _check_room(name, shape, length, size)
    with archive.open(member) as stream:
        payload = memoryview(stream.read())[start:]
    return np.frombuffer(payload, dtype=dtype).reshape(shape, order="F" if fortran else "C")


def _check_room(name: str, shape: tuple[int, ...], length: int, size: int) -> None:
    """Raise `ClipError` where an array of a shape and of `length` bytes, in a file of `size` bytes, is too large."""
    allowed = limits()
    if name == "positions" and len(shape) == 3:
        allowed.check_body(shape[0], shape[1], size + length)
        return
    # Names and parents, one a joint; one rate.
    if length > allowed.joints * MAX_NAME * 4:
        raise ClipError(f"array {name!r} is {length} bytes long")


def _describe(array: NDArray[Any]) -> str:
    return f"{array.dtype} {list(array.shape)}"


READER: Final = PositionsReader()
