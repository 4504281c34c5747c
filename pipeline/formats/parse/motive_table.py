"""The header of an OptiTrack Motive CSV, and the numbers of some of its columns."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.limits_config import MIB, limits
from motionlake.formats.parse.delimited import read_columns
from motionlake.names import printable

OPENING: Final = b"Format Version"
_HEADER_LINES: Final = 16
_HEADER_BYTES: Final = 4 * MIB
_OF_A_BONE: Final = 7  # columns: a quaternion and a place
_FRAME: Final = "Frame"
_DECLARED: Final = "Total Exported Frames"


@dataclass(frozen=True)
class Column:
    """A column of numbers.

    Attributes:
        place: of the column in its row.
        kind: what it is of: Bone, Marker, Rigid Body and so on.
        name: of the thing, `SUBJECT:NAME` where it is a subject's.
        what: Rotation, Position or another quantity.
        axis: X, Y, Z or W.
        parent: of the thing, where the file says so.
    """

    place: int
    kind: str
    name: str
    what: str
    axis: str
    parent: str


@dataclass(frozen=True)
class MotiveHeader:
    """What stands above the rows of an export.

    Attributes:
        settings: of its first line.
        columns: in their order; the frame's number and time are none.
        width: columns of a row, with those.
        lines: of the header.
        begin: the byte at which rows begin.
    """

    settings: dict[str, str]
    columns: tuple[Column, ...]
    width: int
    lines: int
    begin: int

    def rate(self) -> float:
        """Frames a second; `ClipError` where the header does not say."""
        for name in ("Export Frame Rate", "Capture Frame Rate"):
            try:
                return float(self.settings[name][:40])
            except KeyError:
                continue
            except ValueError as error:
                raise ClipError(f"{name} is {self.settings[name]!r:.40}, not a number: say --fps", line=1) from error
        raise ClipError("has no Export Frame Rate: say --fps", line=1)

    def parent(self, name: str) -> str:
        """The parent that the file gives a thing; "" where it gives none."""
        return next((column.parent for column in self.columns if column.name == name), "")

    def frames(self, data: bytes) -> int:
        """How many lines of rows there are, which is no less than the frames that are held."""
        return data.count(b"\n", self.begin) + 1


def read_header(data: bytes) -> MotiveHeader:
    """The header of an export. Raises `ClipError` where it is none, or damaged."""
    if not data.startswith(OPENING):
        raise ClipError("is no export of Motive: it does not begin with Format Version", line=1)
    rows: list[list[str]] = []
    end = 0
    while len(rows) < _HEADER_LINES:
        following = data.find(b"\n", end) + 1
        if not following:
            raise ClipError("is cut short: it has no rows")
        if following > _HEADER_BYTES:
            raise ClipError(f"its header is {following} bytes long", line=len(rows) + 1)
        things = data.count(b",", end, following) // _OF_A_BONE
        limits().check("joints", things, f"has columns of {things} bones or more", len(rows) + 1)
        rows.append(_fields(data[end:following], len(rows) + 1))
        end = following
        if rows[-1][:1] == [_FRAME]:
            break
    else:
        raise ClipError("has no line that begins with Frame, below which rows stand")
    settings = {key.strip(): value.strip() for key, value in zip(rows[0][::2], rows[0][1::2], strict=False)}
    named = [row for row in rows[1:-1] if any(field.strip() for field in row)]
    if len(named) < 3:
        raise ClipError("lacks the lines that say what its columns are", line=len(rows))
    axes = rows[-1]
    parents = next((row for row in named[2:-1] if row[1:2] == ["Parent"]), [])
    kinds, names, whats = (_padded(row, len(axes)) for row in (named[0], named[1], named[-1]))
    above = _padded(parents, len(axes))
    columns = tuple(
        Column(place, kinds[place], printable(names[place]), whats[place], axes[place].strip(), printable(above[place]))
        for place in range(2, len(axes))
        if kinds[place] and axes[place].strip() in ("X", "Y", "Z", "W")
    )
    return MotiveHeader(settings, columns, len(axes), len(rows), end)


def _fields(line: bytes, number: int) -> list[str]:
    try:
        return next(csv.reader(io.StringIO(line.decode("utf-8", errors="replace").rstrip("\r\n"))), [])
    except csv.Error as error:
        raise ClipError(f"the line is no CSV ({error})", line=number) from error


def _padded(row: Sequence[str], width: int) -> list[str]:
    return [field.strip() for field in row] + [""] * (width - len(row))


def read_numbers(data: bytes, header: MotiveHeader, columns: Sequence[Column]) -> Float64Array:
    """[F, C] the numbers of some columns; NaN where a field is blank.

    Raises:
        ClipError: a row is damaged, or there are other than `Total Exported Frames`.
    """
    wanted = [column.place for column in columns]
    numbers = read_columns(data, header.begin, header.width, wanted, lines_before=header.lines)
    declared = header.settings.get(_DECLARED, "")
    if declared.isdigit() and int(declared[:12]) != len(numbers):
        lost = "but the file is cut short" if len(numbers) < int(declared[:12]) else f"but the file has {len(numbers)}"
        raise ClipError(f"{declared[:12]} frames declared, {lost}")
    return numbers
