"""The frames of an AMC file: for each its number, then each bone's name and values on a line of their own."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from motionlake.arrays import Float64Array, Int64Array, UInt8Array
from motionlake.errors import ClipError
from motionlake.formats.limits_config import FARTHEST, limits
from motionlake.formats.parse.lines import line_of, token_at
from motionlake.formats.parse.numbers import (
    ABSURD,
    BAD_NUMBER,
    LONG_ROW,
    OK,
    ONE,
    SHORT_ROW,
    UNDECIDED,
    absurd,
    not_finite,
    scan_number,
    settle,
    skip_blanks,
)
from motionlake.kernels import njit

# Beside those of `numbers`.
_UNKNOWN_BONE, _TWICE, _MISSING_BONE, _FRAME_NUMBER, _NO_ROOM = range(10, 15)


@njit(cache=True)
def _is_name(data, begin, end, names, first, last):  # type: ignore[no-untyped-def]
    """Whether the word that starts at data[begin] is names[first:last]."""
    start, stop, name = np.uint64(begin), np.uint64(begin + last - first), np.uint64(first)
    if stop > np.uint64(end) or (stop < np.uint64(end) and not (data[stop] == 32 or 9 <= data[stop] <= 13)):
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
