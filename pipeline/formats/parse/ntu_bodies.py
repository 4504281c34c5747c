"""The bodies of a `.skeleton` file of NTU RGB+D, whose layout `formats.ntu_skeleton` tells."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array, Int64Array
from motionlake.errors import ClipError
from motionlake.formats.limits_config import limits
from motionlake.formats.parse.lines import line_of, token_at
from motionlake.formats.parse.numbers import BAD_NUMBER, OK, UNDECIDED, scan_number, settle
from motionlake.formats.repair import missing_samples
from motionlake.kernels import njit

JOINT_COUNT: Final = 25
BODY_VALUES: Final = 10
JOINT_VALUES: Final = 12
MIN_BODY_BYTES: Final = 2 * BODY_VALUES + 3 + JOINT_COUNT * 2 * JOINT_VALUES

NOT_TRACKED: Final = 0
NO_COUNT, END_OF_DATA = -1, -2
BAD_COUNT, BAD_BODY_LINE, BAD_JOINT_COUNT, BAD_JOINT_LINE, CUT_SHORT, TRAILING = range(10, 16)
_REASONS: Final = {
    BAD_COUNT: "is not the number of frames or bodies that belongs here",
    BAD_BODY_LINE: f"starts a line that is not a body's {BODY_VALUES} values",
    BAD_JOINT_COUNT: f"is not the joint count {JOINT_COUNT}",
    BAD_JOINT_LINE: f"starts a line that is not a joint's {JOINT_VALUES} values",
    BAD_NUMBER: "is not a number",
    TRAILING: "follows the last frame",
}


Observed = tuple[Int64Array, Float64Array, BoolArray]


def parse_bodies(data: bytes) -> tuple[int, dict[str, Observed]]:
    """Read the whole file.

    Returns:
        The declared frame count and, for each body ID in order of appearance, the frames that list it [N],
        its positions [N, 25, 3] in metres and its missing joints [N, 25].

    Raises:
        ClipError: with the line of the fault; or one body occurs twice in a frame.
    """
    capacity = len(data) // MIN_BODY_BYTES + 1
    positions = np.empty((capacity, JOINT_COUNT, 3))
    untracked = np.empty((capacity, JOINT_COUNT), np.bool_)
    frames = np.empty(capacity, np.int64)
    identities = np.empty((capacity, 2), np.int64)
    undecided = np.empty((positions.size, 2), np.int64)
    status, offset, frame_count, rows, left = _scan_bodies(
        np.frombuffer(data, np.uint8), positions, untracked, frames, identities, undecided
    )
    if status == CUT_SHORT:
        raise ClipError(f"{frame_count} frames declared, but the file is cut short", line_of(data, offset))
    if status != OK:
        raise ClipError(f"{token_at(data, offset)!r} {_REASONS[status]}", line_of(data, offset))
    limits().check_body(rows, JOINT_COUNT, len(data))
    settle(data, positions, undecided[:left])
    rows_of: dict[bytes, list[int]] = {}
    for row, (begin, end) in enumerate(identities[:rows].tolist()):
        rows_of.setdefault(data[begin:end], []).append(row)
    seen = {}
    limits().check("bodies", len(rows_of), f"holds {len(rows_of)} bodies")
    for identity, own in rows_of.items():
        name = identity.decode("latin-1")
        if (np.diff(frames[own]) == 0).any():
            raise ClipError(f"body {name} occurs twice in one frame")
        missing = untracked[own] | missing_samples(positions[own])
        seen[name] = (frames[own], positions[own], missing)
    return frame_count, seen


@njit(cache=True)
def _split_line(data, begin, tokens):  # type: ignore[no-untyped-def]
    """Find the tokens of the next line that is not blank; `tokens` [m] receives the first byte of up to m of them.

    Returns:
        (number of tokens, 0 at the end of the data; the byte after the line).
    """
    i, end, count = begin, len(data), 0
    inside = False
    while i < end:
        byte = data[i]
        if byte > 32:
            if not inside:
                if count < len(tokens):
                    tokens[count] = i
                count += 1
                inside = True
        else:
            inside = False
            if byte == 10 and count:
                return count, i + 1
        i += 1
    return count, end


@njit(cache=True)
def _read_count(data, begin, tokens):  # type: ignore[no-untyped-def]
    """(the whole number that stands alone on the next line, else NO_COUNT or END_OF_DATA; byte after it)."""
    count, after = _split_line(data, begin, tokens)
    if count == 0:
        return END_OF_DATA, after
    status, value, _ = scan_number(data, tokens[0], len(data))
    if count != 1 or status != OK or not 0 <= value < 2**31 or value != np.floor(value):
        return NO_COUNT, after
    return int(value), after


@njit(cache=True)
def _means_no_number(data, begin):  # type: ignore[no-untyped-def]
    """Whether the token is NaN or an infinity as C, C# or an old Microsoft runtime (1.#QNAN) prints it."""
    i = begin + 1 if data[begin] == 45 or data[begin] == 43 else begin
    if i < len(data) and (data[i] | 32 == 110 or data[i] | 32 == 105):
        return True
    while i < len(data) and data[i] > 32:
        if data[i] == 35:
            return True
        i += 1
    return False


@njit(cache=True)
def _scan_joints(data, begin, tokens, row, positions, untracked, undecided, left):  # type: ignore[no-untyped-def]
    """Read the joint count and the joint lines of one body into row `row`; arguments as in `_scan_bodies`.

    Returns:
        (status, byte after the body or of the fault, numbers undecided).
    """
    end = len(data)
    joint_count, i = _read_count(data, begin, tokens)
    if joint_count == END_OF_DATA:
        return CUT_SHORT, end, left
    if joint_count != JOINT_COUNT:
        return BAD_JOINT_COUNT, tokens[0], left
    for joint in range(joint_count):
        count, i = _split_line(data, i, tokens)
        if count == 0:
            return CUT_SHORT, end, left
        if count != JOINT_VALUES:
            return BAD_JOINT_LINE, tokens[0], left
        for axis in range(3):
            status, value, _ = scan_number(data, tokens[axis], end)
            if status == UNDECIDED:
                undecided[left, 0] = (row * JOINT_COUNT + joint) * 3 + axis
                undecided[left, 1] = tokens[axis]
                left += 1
            elif status == BAD_NUMBER:
                if not _means_no_number(data, tokens[axis]):
                    return BAD_NUMBER, tokens[axis], left
                value = np.nan
            positions[row, joint, axis] = value
        status, state, _ = scan_number(data, tokens[JOINT_VALUES - 1], end)
        if status != OK:
            return BAD_NUMBER, tokens[JOINT_VALUES - 1], left
        untracked[row, joint] = state <= NOT_TRACKED
    return OK, i, left


@njit(cache=True)
def _scan_bodies(data, positions, untracked, frames, identities, undecided):  # type: ignore[no-untyped-def]
    """Walk the whole file, uint8 [n], with room for N bodies.

    Args:
        positions: [N, 25, 3], filled; NaN where the file has no number.
        untracked, frames: [N, 25] bool and [N], filled.
        identities: [N, 2], filled with first byte and byte after every body's ID.
        undecided: int64 [75 N, 2], receives (flat index in positions, first byte) of numbers for Python.

    Returns:
        (status, byte of the fault, frame count, bodies filled in, numbers undecided).
    """
    tokens = np.zeros(JOINT_VALUES, np.int64)
    end = len(data)
    row = left = 0
    frame_count, i = _read_count(data, 0, tokens)
    if frame_count < 0:
        return BAD_COUNT, tokens[0], 0, row, left
    for frame in range(frame_count):
        body_count, i = _read_count(data, i, tokens)
        if body_count == END_OF_DATA:
            return CUT_SHORT, end, frame_count, row, left
        if body_count < 0:
            return BAD_COUNT, tokens[0], frame_count, row, left
        for _ in range(body_count):
            count, i = _split_line(data, i, tokens)
            if count == 0 or row == len(frames):
                return CUT_SHORT, end, frame_count, row, left
            if count != BODY_VALUES:
                return BAD_BODY_LINE, tokens[0], frame_count, row, left
            status, state, _ = scan_number(data, tokens[BODY_VALUES - 1], end)
            if status != OK:
                return BAD_NUMBER, tokens[BODY_VALUES - 1], frame_count, row, left
            stop = tokens[0]
            while data[stop] > 32:
                stop += 1
            frames[row] = frame
            identities[row, 0], identities[row, 1] = tokens[0], stop
            status, i, left = _scan_joints(data, i, tokens, row, positions, untracked, undecided, left)
            if status != OK:
                return status, i, frame_count, row, left
            if state <= NOT_TRACKED:
                untracked[row] = True
            row += 1
    count, i = _split_line(data, i, tokens)
    return TRAILING if count else OK, tokens[0], frame_count, row, left
