"""Which clips, and which frames of them, a person means: named, by a condition, by a query, or from a list."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from motionlake import sql
from motionlake.errors import UserError, told_by_sql
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.lake.resolve import resolve_clip
from motionlake.lake.verdicts import good_clips

if TYPE_CHECKING:
    from motionlake.lake.safe import LakeConnection

_QUALITY: Final = re.compile(r"\bquality\s*\.", re.IGNORECASE)
SECONDS: Final = 600.0  # that a condition or query may take
MOST_BYTES: Final = 256 << 20  # of a list


@dataclass(frozen=True, order=True)
class ClipRange:
    """Frames [start, stop) of a clip of the lake by its full name; None: from its first, to its last."""

    clip: str
    start: int | None = None
    stop: int | None = None


def by_condition(lake: Lake, condition: str | None, dataset: str | None) -> list[ClipRange]:
    """The whole clips of which a condition over the table `clips` is true, in the order of their names.

    The condition can read the lake and nothing else (`motionlake.lake.safe`). After stage "quality" it knows the
    columns of that view, too, as `quality.slide`.

    Raises:
        UserError: the condition is no condition, or takes more than `SECONDS`.
    """

    def rows(con: LakeConnection) -> list[tuple[Any, ...]]:
        ((known,),) = con.execute(sql.read("has_view"), {"view": "quality"}).fetchall()
        if not known and condition is not None and _QUALITY.search(condition):
            raise UserError("--where: quality is not known of these clips; find it out with `motionlake run quality`")
        found = con.sql(sql.read("clips_with_quality" if known else "clips_of_dataset"), params={"dataset": dataset})
        chosen = found if condition is None else found.filter(condition)
        return chosen.project("clip").order("clip").fetchall()

    return [ClipRange(clip) for (clip,) in _asked(lake, rows, "--where")]


def by_query(con: Connection, lake: Lake, query: str) -> list[ClipRange]:
    """What a query answers in its columns `clip` and, where it has them, `start` and `stop`; in its order.

    Raises:
        UserError: the query fails, takes more than `SECONDS`, or names what is no clip or no frame.
    """

    def rows(asked: LakeConnection) -> list[dict[str, Any]]:
        asked.execute(query)
        names = [column[0] for column in asked.description or ()]
        return [dict(zip(names, row, strict=True)) for row in asked.fetchall()]

    return _ranges(con, _asked(lake, rows, "--sql"), "--sql", None)


def _asked(lake: Lake, rows: Callable[[LakeConnection], Any], option: str) -> Any:
    import duckdb
    from motionlake.lake.safe import interruptible, time_limit
    from motionlake.retrieval.sql_functions import connect

    try:
        with connect(lake.root) as con, time_limit(con, SECONDS):
            return interruptible(con, lambda: rows(con))
    except duckdb.Error as error:
        raise UserError(f"{option}: {told_by_sql(str(error))}") from error


def from_list(con: Connection, path: Path, clip: str | None = None) -> list[ClipRange]:
    """The rows of a CSV or JSON file with the columns clip and, if it has them, start and stop.

    JSON is a list of objects, as `motionlake search`, `find` and `segment` print it, or one object a line.

    Args:
        con: to the lake.
        path: the file.
        clip: which clip rows without a clip are of, as those of `motionlake segment`.

    Raises:
        UserError: the file cannot be read so, or names what is no clip of the lake or no frame.
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise UserError(f"{path}: is longer than {MOST_BYTES >> 20} MiB, too long for a list of clips")
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: is not UTF-8; save it as UTF-8") from error
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror})") from error
    return _ranges(con, _rows_of(path, text), str(path), clip)


def _rows_of(path: Path, text: str) -> list[Mapping[str, Any]]:
    try:
        if path.suffix.lower() == ".csv":
            return list(csv.DictReader(text.splitlines()))
        whole = text.lstrip().startswith("[")
        rows = json.loads(text) if whole else [json.loads(line) for line in text.splitlines() if line.strip()]
    except (csv.Error, ValueError, RecursionError) as error:
        raise UserError(f"{path}: is neither CSV (.csv) nor JSON: {error}") from error
    if not all(isinstance(row, dict) for row in rows):
        raise UserError(f"{path}: is no list of objects with a clip each")
    return list(rows)


def _ranges(con: Connection, rows: Sequence[Mapping[str, Any]], origin: str, clip: str | None) -> list[ClipRange]:
    names = {str(row["clip"]) for row in fetch(con, "clip_names")}
    found = []
    for number, row in enumerate(rows, 1):
        name = row.get("clip") or clip
        if not isinstance(name, str):
            raise UserError(f"{origin}: row {number} has no clip; it needs a column clip, and may have start and stop")
        try:
            full = name if name in names else resolve_clip(con, name)
            found.append(ClipRange(full, _frame(row.get("start")), _frame(row.get("stop"))))
        except (UserError, ValueError) as error:
            raise UserError(f"{origin}: row {number}: {error}") from error
    return once(found)


def _frame(value: Any) -> int | None:
    """A frame number; `ValueError` where it is none."""
    if value is None or value == "":
        return None
    number = float(value)
    if not 0 <= number < 2**53 or number != int(number):
        raise ValueError(f"{value} is no frame")
    return int(number)


def good_ranges(con: Connection, ranges: Sequence[ClipRange], min_quality: str | None) -> list[ClipRange]:
    """Those of clips that stage "quality" found at least so good (`lake.verdicts`); None: all.

    Raises:
        UserError: as `good_clips`, or none is as good.
    """
    if min_quality is None:
        return list(ranges)
    good = good_clips(con, min_quality)
    kept = [each for each in ranges if each.clip in good]
    if not kept:
        raise UserError(f"--min-quality {min_quality}: of {len(ranges)} chosen clips none is as good")
    return kept


def once(ranges: Iterable[ClipRange]) -> list[ClipRange]:
    """The same without those that came before."""
    return list(dict.fromkeys(ranges))
