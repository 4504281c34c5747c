"""ASF/AMC clips: an .amc file and the .asf skeleton that belongs to it."""

from __future__ import annotations

import re
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from gzip import GzipFile
from pathlib import Path
from typing import BinaryIO, Final, cast

import numpy as np
from motionlake.arrays import Float64Array, Int64Array, UInt8Array
from motionlake.errors import ClipError
from motionlake.formats.asf import ROOT, Skeleton, load_asf
from motionlake.formats.limits_config import FARTHEST, MOST_DEGREES, limits
from motionlake.formats.numbers import (
    ABSURD,
    BAD_NUMBER,
    LONG_ROW,
    OK,
    ONE,
    SHORT_ROW,
    UNDECIDED,
    absurd,
    line_of,
    not_finite,
    scan_number,
    settle,
    skip_blanks,
    token_at,
)
from motionlake.formats.registry import COMPRESSED_SUFFIX, Remembered
from motionlake.kernels import njit
from motionlake.motion.clip import SourceClip
from motionlake.motion.rotations import rotate
from numba import uint64

DEFAULT_FPS: Final = 120.0
HEAD_BYTES: Final = 4096
PREAMBLE_BYTES: Final = 128 * 1024
_ANCESTORS: Final = 3
_FOLDERS: Final = re.compile(r".*[\\/:]")
# Beside those of `numbers`.
_UNKNOWN_BONE, _TWICE, _MISSING_BONE, _FRAME_NUMBER, _NO_ROOM = range(10, 15)
_SUFFIXES: Final = (".asf", f".asf{COMPRESSED_SUFFIX}")


def _list_skeletons(folder: Path) -> dict[str, Path]:
    names = sorted(entry.name for entry in folder.iterdir() if entry.name.lower().endswith(_SUFFIXES))
    return {name.lower().removesuffix(COMPRESSED_SUFFIX).removesuffix(".asf"): folder / name for name in names}


_listed: Final = Remembered(_list_skeletons, size=256)


def _skeletons_in(folder: Path) -> dict[str, Path]:
    """The folder's ASF files by lower-case stem."""
    try:
        return _listed(folder)
    except OSError:
        return {}


def find_skeleton(path: Path, named: str = "") -> tuple[Path, str]:
    """The ASF file that an AMC file moves, and why it is that one.

    In this order: the name that the AMC gives (`#!OML:ASF`), in its folder; the AMC's own stem; the longest
    stem that the AMC's name begins with ("HDM_bd.asf" for "HDM_bd_walk_001.amc"), in the folder or the
    nearest of 3 above it that has one; the only ASF of the folder.

    Raises:
        ClipError: none of these; says where it looked.
    """
    stem = path.name.lower().removesuffix(COMPRESSED_SUFFIX).removesuffix(".amc")
    folder = path.absolute().parent
    here = _skeletons_in(folder)
    by_name = named.lower().removesuffix(".asf")
    if by_name in here:
        return here[by_name], "named by the clip"
    ancestor, skeletons = folder, here
    for _ in range(1 + _ANCESTORS):
        # Up to a character that is no letter or digit.
        prefixes = [p for p in skeletons if p and stem.startswith(p) and not stem[len(p) : len(p) + 1].isalnum()]
        if prefixes:
            return skeletons[max(prefixes, key=len)], "the clip's name begins with its name"
        if ancestor == ancestor.parent:
            break
        ancestor = ancestor.parent
        skeletons = _skeletons_in(ancestor)
    if len(here) == 1:
        return next(iter(here.values())), "the only one in the clip's folder"
    wanted = f"{named!r} or " if named else ""
    raise ClipError(
        f"no skeleton: {wanted}an .asf whose name the clip's begins with, in its folder or the "
        f"{_ANCESTORS} above, or one .asf alone in its folder (it has {len(here)})"
    )


@dataclass
class _Preamble:
    """What an AMC file says before its first frame."""

    start: int = 0
    asf: str = ""
    radians: bool | None = None
    rate: str = ""

    @classmethod
    def of(cls, data: bytes) -> _Preamble:
        found = cls()
        while found.start < len(data):
            if found.start > PREAMBLE_BYTES:
                raise ClipError("no frame in its first 128 KiB")
            newline = data.find(b"\n", found.start)
            stop = len(data) if newline < 0 else newline + 1
            words = data[found.start : min(stop, found.start + HEAD_BYTES)].decode("latin-1").split()
            if words and words[0][0] not in "#:":
                break
            found.note(words)
            found.start = stop
        return found

    def note(self, words: list[str]) -> None:
        key = words[0].upper() if words else ""
        if key == "#!OML:ASF":
            self.asf = _FOLDERS.sub("", " ".join(words[1:]))
        elif key in (":DEGREES", ":RADIANS"):
            self.radians = key == ":RADIANS"
        elif key == ":SAMPLES-PER-SECOND" and len(words) > 1:
            self.rate = words[1]

    @property
    def fps(self) -> float:
        if not self.rate:
            return DEFAULT_FPS
        try:
            return float(self.rate)
        except ValueError:
            raise ClipError(f"{self.rate[:40]!r} is not a frame rate: say --fps") from None


@njit(cache=True)
def _is_name(data, begin, end, names, first, last):  # type: ignore[no-untyped-def]
    """Whether the word that starts at data[begin] is names[first:last]."""
    start, stop, name = uint64(begin), uint64(begin + last - first), uint64(first)
    if stop > uint64(end) or (stop < uint64(end) and not (data[stop] == 32 or 9 <= data[stop] <= 13)):
        return False
    while start < stop:
        if data[start] != names[name]:
            return False
        start += ONE
        name += ONE
    return True


@njit(cache=True)
def _scan_frames(data, start, names, name_starts, columns, table, most, undecided):  # type: ignore[no-untyped-def]
    """Fill `table` with the frames of an AMC file, uint8 [n], from its first frame number on.

    Args:
        start: first byte.
        names: uint8, the names of B bones in a row.
        name_starts, columns: [B + 1] where in `names` and in the columns of `table` each bone starts.
        table: [capacity, columns[B]], filled in place.
        most: [columns[B]], the largest numbers that are no damage.
        undecided: int64 [table.size, 2], receives (flat index, first byte) of numbers for Python.

    Returns:
        (status, byte where it stopped, frames, numbers undecided, bone).
    """
    bones, width, end = len(columns) - 1, table.shape[1], len(data)
    seen = np.full(bones, -1)
    following = np.arange(1, bones + 2)
    following[bones - 1 :] = 0
    frame, found, last, left, number = -1, bones, bones, 0, 0
    i = start
    while True:
        while i < end and (data[i] == 32 or 9 <= data[i] <= 13):
            i += 1
        new_frame = i < end and 48 <= data[i] <= 57
        if i >= end or new_frame:
            if found != bones:
                return _MISSING_BONE, i, frame, left, np.argmin(seen)
            if i >= end:
                return OK, i, frame + 1, left, 0
            begin = i
            value = 0
            while i < end and 48 <= data[i] <= 57 and i - begin < 18:
                value = value * 10 + int(data[i]) - 48
                i += 1
            bare = i >= end or data[i] == 32 or 9 <= data[i] <= 13
            if not bare or (frame >= 0 and value != number + 1):
                return _FRAME_NUMBER, begin, frame, left, 0
            if frame + 1 == len(table):
                return _NO_ROOM, begin, frame, left, 0
            number = value
            frame += 1
            found = 0
            last = bones
            continue
        if frame < 0:
            return _FRAME_NUMBER, i, frame, left, 0
        # Frames list their bones in one order: try the one that came next the frame before.
        bone = following[last]
        if not _is_name(data, i, end, names, name_starts[bone], name_starts[bone + 1]):
            bone = 0
            while bone < bones and not _is_name(data, i, end, names, name_starts[bone], name_starts[bone + 1]):
                bone += 1
            if bone == bones:
                return _UNKNOWN_BONE, i, frame, left, 0
            following[last] = bone
        if seen[bone] == frame:
            return _TWICE, i, frame, left, bone
        seen[bone] = frame
        found += 1
        last = bone
        i += name_starts[bone + 1] - name_starts[bone]
        for column in range(columns[bone], columns[bone + 1] + 1):
            i = skip_blanks(data, i, end)
            if i >= end or data[i] == 10:
                if column < columns[bone + 1]:
                    return SHORT_ROW, i, frame, left, bone
                break
            if column == columns[bone + 1]:
                return LONG_ROW, i, frame, left, bone
            status, value_read, stop = scan_number(data, i, end)
            if status == BAD_NUMBER:
                return BAD_NUMBER, i, frame, left, bone
            if status == UNDECIDED:
                undecided[left, 0] = frame * width + column
                undecided[left, 1] = i
                left += 1
            elif abs(value_read) > most[column]:
                return ABSURD, i, frame, left, bone
            table[frame, column] = value_read
            i = stop


def parse_frames(data: bytes, start: int, widths: Mapping[str, int], most: Float64Array | None = None) -> Float64Array:
    """The values of every frame [F, sum of widths] from byte `start` on; `widths` are each bone's values, by its name.

    `most` [sum of widths] are the largest that are no damage.

    Raises:
        ClipError: with the line of what is wrong.
    """
    names, name_starts, columns, fewest = _layout(tuple(widths.items()))
    allowed = limits().most_frames(len(widths))
    table = np.empty((min((len(data) - start) // fewest + 2, allowed), columns[-1]))
    most = np.full(columns[-1], FARTHEST) if most is None else most
    undecided = np.empty((table.size, 2), np.int64)
    status, offset, frames, left, bone = _scan_frames(
        np.frombuffer(data, np.uint8), start, names, name_starts, columns, table, most, undecided
    )
    if status == _NO_ROOM:
        limits().check_body(frames + 2, len(widths), line=line_of(data, offset))
    if status != OK:
        raise _fault(status, data, offset, list(widths.items())[bone])
    settle(data, table, undecided[:left], most)
    return table[:frames]


@lru_cache(maxsize=64)
def _layout(bones: tuple[tuple[str, int], ...]) -> tuple[UInt8Array, Int64Array, Int64Array, int]:
    """The names of all bones as one text, where each name and each bone's values begin, and the bytes of a frame.

    These are the fewest that a frame takes: its number, names and values, and what parts them.
    """
    names = [name.encode("latin-1") for name, _ in bones]
    name_starts = np.cumsum([0, *map(len, names)], dtype=np.int64)
    columns = np.cumsum([0, *(width for _, width in bones)], dtype=np.int64)
    fewest = 2 + name_starts[-1] + len(names) + 2 * columns[-1]
    return np.frombuffer(b"".join(names), np.uint8), name_starts, columns, int(fewest)


def _fault(status: int, data: bytes, offset: int, bone: tuple[str, int]) -> ClipError:
    name, width = bone
    if status == BAD_NUMBER:
        return not_finite(data, offset)
    if status == ABSURD:
        return absurd(data, offset)
    reason = {
        SHORT_ROW: f"bone {name!r} has fewer than {width} values",
        LONG_ROW: f"bone {name!r} has more than {width} values",
        _UNKNOWN_BONE: f"{token_at(data, offset)!r} is not a bone that the skeleton moves",
        _TWICE: f"bone {name!r} twice in one frame",
        _MISSING_BONE: f"bone {name!r} is missing in the frame before this line",
        _NO_ROOM: "more frames than fit its bytes",
        _FRAME_NUMBER: f"the next frame's number is expected, not {token_at(data, offset)!r}",
    }[status]
    return ClipError(reason, line_of(data, offset))


def _to_channels(raw: Float64Array, skeleton: Skeleton) -> tuple[Float64Array, list[str]]:
    """The values of an AMC in the order and meaning of `Hierarchy`, and notes on what was changed."""
    notes: list[str] = []
    parts: list[Float64Array] = []
    column = 0
    for bone in skeleton.bones.values():
        values = {dof: raw[:, column + i] for i, dof in enumerate(bone.dof)}
        column += len(bone.dof)
        stretch = values.pop("l", None)
        if stretch is not None and stretch.any():
            notes.append(f"changes of the length of bone {bone.name!r} left out")
        if bone.moves:
            offset = skeleton.bones[skeleton.parents[bone.name]].vector
            shift = np.stack([values.pop(f"t{axis}", np.zeros(len(raw))) for axis in "xyz"], -1)
            parts.append(offset + rotate(bone.axis, shift))
            notes.append(f"bone {bone.name!r} leaves its place: its rest offset was added to its channels")
        elif bone.name == ROOT:
            for axis, start in zip("xyz", skeleton.position, strict=True):
                if f"t{axis}" in values:
                    values[f"t{axis}"] = values[f"t{axis}"] + start
        parts.extend(value[:, None] for value in values.values())
    return np.concatenate(parts, axis=1), notes


class AmcReader:
    """Reader of .amc files with their .asf."""

    name = "ASF/AMC"
    suffixes = (".amc",)

    def companions(self, path: Path) -> list[Path]:
        """The .asf file; `ClipError` where there is none."""
        try:
            with path.open("rb") as raw:
                compressed = path.name.lower().endswith(COMPRESSED_SUFFIX)
                stream = cast(BinaryIO, GzipFile(fileobj=raw)) if compressed else raw
                head = stream.read(HEAD_BYTES)
        except (EOFError, OSError, zlib.error) as error:
            raise ClipError(f"cannot be read: {error}") from error
        return [find_skeleton(path, _Preamble.of(head).asf)[0]]

    def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
        """Read an AMC file and the ASF file it belongs to; `fps` stands in place of the file's rate.

        Raises:
            ClipError: with the line, for frames that are not numbered one after another, bones unknown, missing or
                doubled in a frame, and tokens that are no number; or where its skeleton is not found or not readable.
        """
        preamble = _Preamble.of(data)
        asf, why = find_skeleton(path, preamble.asf)
        skeleton, hierarchy = load_asf(asf)
        turns = [dof.startswith("r") for bone in skeleton.bones.values() for dof in bone.dof]
        limits().check("joints", len(skeleton.bones), f"{asf.name} has too many bones")
        limits().check_memory(len(data))
        channels = parse_frames(data, preamble.start, skeleton.widths, np.where(turns, MOST_DEGREES, FARTHEST))
        if skeleton.radians if preamble.radians is None else preamble.radians:
            channels[:, turns] = np.rad2deg(channels[:, turns])
        notes = [f"skeleton {asf.name}: {why}"]
        if not skeleton.plain:
            channels, changes = _to_channels(channels, skeleton)
            notes += changes
        if fps is None:
            fps = preamble.fps
            if not preamble.rate:
                notes.append(f"frame rate {DEFAULT_FPS:g}/s assumed: the format has none")
        unit = skeleton.metres_per_unit
        return [SourceClip(hierarchy, channels, fps, metres_per_unit=unit, notes=tuple(notes))]


READER: Final = AmcReader()
