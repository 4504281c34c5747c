"""What is said of a table beside it: `columns.toml` of a person, or the `.joints.json` that motionlake writes."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from motionlake.errors import ClipError
from motionlake.formats.parse.json_document import json_document
from motionlake.formats.registry import COMPRESSED_SUFFIX, load_bytes
from motionlake.motion.rigs import UP_AXES
from motionlake.motion.units import UNITS

MAP: Final = "columns.toml"
SIDECAR: Final = ".joints.json"  # NAME.joints.json beside NAME.csv
ABOVE: Final = 3  # folders above a table's in which its map may lie
MOST_BYTES: Final = 2**20
KEYS: Final = ("position", "time", "fps", "unit", "up", "parents")


@dataclass(frozen=True)
class TableMap:
    """What is said of tables; None where nothing is.

    Attributes:
        position: finds `joint` and `axis` in the name of a column.
        time: name of the column of seconds.
        fps: frames a second.
        metres_per_unit, up: as a `SourceClip` has them.
        parents: of each joint that is to be read the name of its parent, "" of the root; in their order.
        gaps: whether a joint at zero is one that was not seen.
    """

    position: re.Pattern[str] | None = None
    time: str | None = None
    fps: float | None = None
    metres_per_unit: float | None = None
    up: str | None = None
    parents: Mapping[str, str] | None = None
    gaps: bool = True


def map_file(path: Path) -> Path | None:
    """The file that says what the columns of a table are: motionlake's own beside it, or the nearest `columns.toml`."""
    plain = (
        path.with_name(path.name[: -len(COMPRESSED_SUFFIX)]) if path.name.lower().endswith(COMPRESSED_SUFFIX) else path
    )
    folders = list(path.absolute().parents)[: 1 + ABOVE]
    candidates = [plain.with_suffix(SIDECAR), *(folder / MAP for folder in folders)]
    return next((file for file in candidates if file.is_file()), None)


def table_map(file: Path | None) -> TableMap:
    """What a file says of tables; an empty map where there is none.

    Raises:
        ClipError: what it says is no map; the reason names the file.
    """
    if file is None:
        return TableMap()
    try:
        data = load_bytes(file, MOST_BYTES)
        return _of_toml(data) if file.name == MAP else _of_joints(json_document(data))
    except ClipError as error:
        raise ClipError(f"{file.name}: {error.reason}") from error


def _of_toml(data: bytes) -> TableMap:
    try:
        table = tomllib.loads(data.decode())
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise ClipError(f"is no TOML: {error}") from error
    if unknown := sorted(table.keys() - set(KEYS)):
        raise ClipError(f"has a key {unknown[0]!r:.40}, which is none of {', '.join(KEYS)}")
    unit, up = table.get("unit"), table.get("up")
    if unit is not None and unit not in UNITS:
        raise ClipError(f"unit is {unit!r:.40}, not one of {', '.join(UNITS)}")
    if up is not None and up not in UP_AXES:
        raise ClipError(f"up is {up!r:.40}, not one of {', '.join(UP_AXES)}")
    parents = table.get("parents")
    if parents is not None and not (isinstance(parents, dict) and all(isinstance(p, str) for p in parents.values())):
        raise ClipError('[parents] is no table of names, such as Spine = "Hips"')
    return TableMap(
        position=_pattern(_text(table, "position")),
        time=_text(table, "time"),
        fps=_rate(table.get("fps")),
        metres_per_unit=None if unit is None else UNITS[unit],
        up=up,
        parents=parents,
    )


def _text(table: Mapping[str, Any], key: str) -> str | None:
    value = table.get(key)
    if value is not None and not (isinstance(value, str) and value):
        raise ClipError(f"{key} is {value!r:.40}, not a name")
    return value


def _rate(value: Any) -> float | None:
    if value is not None and not (isinstance(value, int | float) and 0 < value < 1e9):
        raise ClipError(f"fps is {value!r:.40}, not a number of frames a second")
    return None if value is None else float(value)


def _pattern(position: str | None) -> re.Pattern[str] | None:
    """Of a form such as "{joint}_pos_{axis}"."""
    if position is None:
        return None
    if any(position.count(part) != 1 for part in ("{joint}", "{axis}")):
        raise ClipError(
            f'position is {position!r:.40}, which has not one {{joint}} and one {{axis}}: "{{joint}}_{{axis}}"'
        )
    escaped = re.escape(position).replace(r"\{joint\}", "(?P<joint>.+)").replace(r"\{axis\}", "(?P<axis>[xyzXYZ])")
    return re.compile(escaped)


def _of_joints(tree: Any) -> TableMap:
    """Of what `positions_csv` writes beside a table."""
    found = tree if isinstance(tree, dict) else {}
    names, parents = found.get("joints"), found.get("parents")
    if not isinstance(names, list) or not isinstance(parents, list) or len(names) != len(parents):
        raise ClipError("does not name joints and their parents")
    if not all(isinstance(name, str) and name for name in names) or len(set(names)) < len(names):
        raise ClipError("has joints that are no names, or two of one name")
    if not all(type(parent) is int and -1 <= parent < len(names) for parent in parents):
        raise ClipError("has parents that are no joints")
    by_name = {name: names[parent] if parent >= 0 else "" for name, parent in zip(names, parents, strict=True)}
    return TableMap(_pattern("{joint}.{axis}"), "time", _rate(found.get("fps")), 1.0, "y", by_name, gaps=False)
