"""How time and way are written in requests of new motion: classes with their seconds, paths on the ground, a facing."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeVar

from motionlake.errors import UserError

if TYPE_CHECKING:
    from motionlake.motion.paths import GroundPath

_TIMED: Final = re.compile(r"(.+):(\d+(?:\.\d+)?)")
_COMMA: Final = re.compile(r",(?=\S)")
_POINTS: Final = "x,z;x,z…"
Clip = TypeVar("Clip", bound=str | Path)
Points = str | Path | Sequence[Sequence[float]]


def timed_classes(wanted: Sequence[str]) -> tuple[tuple[str, ...], tuple[float | None, ...] | None]:
    """The classes, and the seconds of each where some are given ("walk:3"); None of those that are not.

    A comma that no space follows parts classes too: "walk:3,turn_left:1,kick".

    Raises:
        UserError: a class has no time.
    """
    parts = [part for text in wanted for part in _COMMA.split(text)]
    found = [_TIMED.fullmatch(name) for name in parts]
    if not any(found):
        return tuple(parts), None
    names = tuple(name if match is None else match.group(1) for name, match in zip(parts, found, strict=True))
    seconds = tuple(None if match is None else float(match.group(2)) for match in found)
    none = next((name for name, time in zip(names, seconds, strict=True) if time is not None and not time > 0), None)
    if none is not None:
        raise UserError(f"{none}: must last more than 0 seconds")
    return names, seconds


def path_text(given: Points, *, files: bool = True) -> str:
    """A path as requests hold it: "circle:3", "eight:3" (metres of radius) or points "x,z;x,z".

    Args:
        given: the same, the name of a CSV file of points in metres (columns x and z, or the first two), or points.
        files: a file may be read.

    Raises:
        UserError: it is none of these, or has fewer than two points.
    """
    if not isinstance(given, str | Path):
        text = ";".join(f"{float(point[0])!r},{float(point[1])!r}" for point in given)
    elif isinstance(given, Path) or given.lower().endswith(".csv"):
        if not files:
            raise UserError(f"path {given}: files are not read here; give the points, {_POINTS}")
        text = _of_file(Path(given))
    else:
        text = given.strip()
    try:
        path_of(text)
    except ValueError as error:
        raise UserError(f"path {given if isinstance(given, str | Path) else text}: {error}") from error
    return text


def path_of(text: str) -> GroundPath:
    """The path that `path_text` gave.

    Raises:
        ValueError: it is none.
    """
    from motionlake.motion.paths import RADIUS, SHAPES, ground_path, shape_path

    name, _, radius = text.partition(":")
    if name in SHAPES:
        size = _number(radius) if radius else RADIUS
        if not 0.5 <= size <= 1000:
            raise ValueError("a radius is between 0.5 and 1000 metres")
        return shape_path(name, size)
    points = [[_number(part) for part in point.split(",")] for point in text.split(";") if point.strip()]
    if any(len(point) != 2 for point in points):
        raise ValueError(f"give circle, eight, a CSV file, or points in metres, {_POINTS}")
    return ground_path([(x, z) for x, z in points])


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"give circle, eight, a CSV file, or points in metres, {_POINTS}") from None


def _of_file(path: Path) -> str:
    """The points of a CSV file."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as handle:
            rows = [row for row in csv.reader(handle) if any(cell.strip() for cell in row)]
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"--path {path}: cannot be read ({getattr(error, 'strerror', None) or error})") from error
    x, z, first = 0, 1, 1
    if rows and not _is_number(rows[0][0]):
        names = [cell.strip().lower() for cell in rows[0]]
        if "x" not in names or "z" not in names:
            raise UserError(f"--path {path}: has no columns x and z")
        x, z, rows, first = names.index("x"), names.index("z"), rows[1:], 2
    for line, row in enumerate(rows, first):
        if len(row) <= max(x, z) or not (_is_number(row[x]) and _is_number(row[z])):
            raise UserError(f"--path {path}: row {line} holds no point of two numbers")
    return ";".join(f"{row[x].strip()},{row[z].strip()}" for row in rows)


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def facing_of(text: str | float | None) -> float | None:
    """Degrees to the left of the heading at the start that a body keeps facing; None: along its way.

    Raises:
        UserError: neither "path" nor a number.
    """
    if text is None or text == "path":
        return None
    if not _is_number(str(text)):
        raise UserError(f'facing {text}: give "path", or degrees to the left of where the motion starts to head')
    return float(text)


def begun(start: Clip | None, continues: Clip | None) -> Clip | None:
    """The clip that a motion starts from, or from the end of which it goes on; None where neither is named.

    Raises:
        UserError: both are.
    """
    if start is not None and continues is not None:
        raise UserError(
            "a motion starts from a clip (--from) or goes on from the end of one (--continue): leave one out"
        )
    return continues if start is None else start
