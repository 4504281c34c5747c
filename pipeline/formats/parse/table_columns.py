"""Which columns of a table are the time and the places of joints, by their names."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from motionlake.formats.limits_config import limits

AXES: Final = ("x", "y", "z")
DELIMITERS: Final = (",", ";", "\t")
LONGEST_HEADER: Final = 2**20  # bytes
COLUMNS_A_JOINT: Final = 16  # the most that a table has, more or less: place, rotation, quality and the like
# Names end in the axis: after a sign that parts (Hips.x, Hips_X, "Hips x"), or as a capital after a small letter
# (HipsX); pandas writes columns of two levels as ('Hips', 'x').
_PARTED: Final = re.compile(r"(?P<joint>.+?)[ ._:/|-]+(?P<axis>[xyzXYZ])")
_JOINED: Final = re.compile(r"(?P<joint>.*[a-z0-9)])(?P<axis>[XYZ])")
_LEVELS: Final = re.compile(r"\('(?P<joint>[^']+)', '(?P<axis>[xyzXYZ])'\)")
_ONE_LEVEL: Final = re.compile(r"^\('(.*)', ''\)$")
# What says of a name that it is of a place, where the same table has rotations too.
_PLACE: Final = re.compile(r"(?<=.)(?:[ ._:/|-]+(?i:pos|position|translation|location)|(?:Pos|Position))$")
_TIME: Final = re.compile(r"(?:time|timestamp|elapsed|t|seconds|secs?)(?:[ _]*[\[(]?(?P<unit>s|sec|seconds|ms)[\])]?)?")
_MILLISECONDS: Final = 1e-3


@dataclass(frozen=True)
class TableColumns:
    """Columns of a table by number.

    Attributes:
        time: of the time, if there is one.
        seconds: that one unit of time lasts.
        joints: of each joint the columns of x, y and z.
    """

    time: int | None
    seconds: float
    joints: dict[str, tuple[int, int, int]] = field(default_factory=dict)


@dataclass(frozen=True)
class Header:
    """The head of a text table.

    Attributes:
        names: of the columns; of two rows, joint and axis, "joint.axis".
        rows: how many lines it takes.
        delimiter: between columns.
    """

    names: tuple[str, ...]
    rows: int
    delimiter: str


def header_of(head: bytes) -> Header:
    """The header of a table that begins so, of one line or of two (joints, each once or over its columns; axes).

    Raises:
        ClipError: more columns than `limits` allow.
    """
    lines = head[:LONGEST_HEADER].decode("utf-8", "replace").split("\n", 2)[:2]
    delimiter = max(DELIMITERS, key=lines[0].count)
    limits().check("joints", lines[0].count(delimiter) // COLUMNS_A_JOINT, f"has {lines[0].count(delimiter)} columns")
    first, second = (_fields(line, delimiter) for line in (*lines, "")[:2])
    if sum(name.lower() in AXES for name in second) < len(AXES) or len(second) != len(first):
        return Header(tuple(first), 1, delimiter)
    names, above = [], ""
    for name, below in zip(first, second, strict=True):
        above = name or above  # a name may stand over the first of its columns only
        names.append(f"{above}.{below}" if below.lower() in AXES else f"{name} {below}".strip())
    return Header(tuple(names), 2, delimiter)


def _fields(line: str, delimiter: str) -> list[str]:
    try:
        return [name.strip() for name in next(csv.reader([line.rstrip("\r")], delimiter=delimiter), [])]
    except csv.Error:
        return []


def columns_of(names: Sequence[str], position: re.Pattern[str] | None = None, time: str | None = None) -> TableColumns:
    """The columns of joints that have all three axes, in the order of their first; and that of the time.

    Args:
        names: of the columns.
        position: what finds the groups `joint` and `axis` in a whole name; by default the usual forms.
        time: the name of the column of seconds; by default the usual ones.
    """
    patterns = (_LEVELS, _PARTED, _JOINED) if position is None else (position,)
    found: dict[str, dict[str, int]] = {}
    for number, name in enumerate(names):
        match = next((match for pattern in patterns if (match := pattern.fullmatch(name))), None)
        if match:
            found.setdefault(match["joint"], {}).setdefault(match["axis"].lower(), number)
    whole = {joint: (axes["x"], axes["y"], axes["z"]) for joint, axes in found.items() if len(axes) == len(AXES)}
    if position is None:
        whole = _of_places(whole)
    at, seconds = _time_of(names, time)
    return TableColumns(at, seconds, whole)


def _of_places(joints: dict[str, tuple[int, int, int]]) -> dict[str, tuple[int, int, int]]:
    """Where some names say that they are of places, those alone, without that word."""
    said = {bare: columns for name, columns in joints.items() if (bare := _PLACE.sub("", name)) != name}
    return said or joints


def _time_of(names: Sequence[str], time: str | None) -> tuple[int | None, float]:
    if time is not None:
        return (names.index(time) if time in names else None), 1.0
    for number, name in enumerate(names):
        if match := _TIME.fullmatch(_ONE_LEVEL.sub(r"\1", name.lower())):
            return number, _MILLISECONDS if match["unit"] == "ms" else 1.0
    return None, 1.0
