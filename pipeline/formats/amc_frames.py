"""The frames of an AMC file: a line with the frame's number, then a line of values per bone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, Int64Array, UInt8Array
from motionlake.errors import ClipError
from motionlake.formats.numbers import (
    BAD_NUMBER,
    LONG_ROW,
    OK,
    ONE,
    SHORT_ROW,
    UNDECIDED,
    line_of,
    scan_number,
    settle,
    skip_blanks,
    token_at,
)
from numba import njit, uint64

_UNKNOWN_BONE: Final = 10
_TWICE: Final = 11
_MISSING_BONE: Final = 12
_FRAME_NUMBER: Final = 13


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
def _scan_frames(data, start, names, name_starts, columns, table, undecided):  # type: ignore[no-untyped-def]
    """Fill `table` with the frames of an AMC file from its first frame number on.

    Args:
        data: uint8 [n].
        start: first byte.
        names: uint8, the names of B bones in a row.
        name_starts: [B + 1] where in `names` each starts.
        columns: [B + 1] the first column of each bone.
        table: [capacity, columns[B]], filled in place.
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
            if not bare or (frame >= 0 and value != number + 1) or frame + 1 == len(table):
                return _FRAME_NUMBER, begin, frame, left, 0
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
            table[frame, column] = value_read
            i = stop


@dataclass(frozen=True, eq=False)
class Layout:
    """What the lines of a frame hold, as the kernel wants it; made once for all clips of a skeleton.

    Attributes:
        widths: values of each bone that has any, by its name, in the order of the columns.
        names: uint8, the bones' names in a row; name_starts: [B + 1] where in `names` each starts.
        columns: [B + 1] the first column of each bone.
        fewest: bytes that a frame takes at least: its number, names and values, and what parts them.
    """

    widths: Mapping[str, int]
    names: UInt8Array
    name_starts: Int64Array
    columns: Int64Array
    fewest: int

    @classmethod
    def of(cls, widths: Mapping[str, int]) -> Layout:
        """The layout of bones with `widths` values each."""
        encoded = [name.encode("latin-1") for name in widths]
        return cls(
            widths=widths,
            names=np.frombuffer(b"".join(encoded), np.uint8),
            name_starts=np.cumsum([0, *map(len, encoded)], dtype=np.int64),
            columns=np.cumsum([0, *widths.values()], dtype=np.int64),
            fewest=2 + sum(len(name) + 1 + 2 * width for name, width in zip(encoded, widths.values(), strict=True)),
        )


def parse_frames(data: bytes, start: int, layout: Layout) -> Float64Array:
    """Every frame's values [F, sum of widths].

    Raises:
        ClipError: with the line of what is wrong.
    """
    capacity = (len(data) - start) // layout.fewest + 2
    table = np.empty((capacity, int(layout.columns[-1])))
    undecided = np.empty((table.size, 2), np.int64)
    status, offset, frames, left, bone = _scan_frames(
        np.frombuffer(data, np.uint8), start, layout.names, layout.name_starts, layout.columns, table, undecided
    )
    if status != OK:
        raise _fault(status, data, offset, list(layout.widths.items())[bone])
    settle(data, table, undecided[:left])
    return table[:frames]


def _fault(status: int, data: bytes, offset: int, bone: tuple[str, int]) -> ClipError:
    name, width = bone
    reason = {
        BAD_NUMBER: f"{token_at(data, offset)!r} is not a finite number",
        SHORT_ROW: f"bone {name!r} has fewer than {width} values",
        LONG_ROW: f"bone {name!r} has more than {width} values",
        _UNKNOWN_BONE: f"{token_at(data, offset)!r} is not a bone that the skeleton moves",
        _TWICE: f"bone {name!r} twice in one frame",
        _MISSING_BONE: f"bone {name!r} is missing in the frame before this line",
        _FRAME_NUMBER: f"the next frame's number is expected, not {token_at(data, offset)!r}",
    }[status]
    return ClipError(reason, line_of(data, offset))
