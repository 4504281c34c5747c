"""Bringing a lake of an earlier version up to date, one version after the other.

Steps first rewrite files, each whole or not at all and so that the lake stays readable as the version it was; then the
catalog becomes that of this version at once. A migration that is killed therefore leaves the old lake or the new one,
and the same command goes on where it was.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
import pyarrow.parquet as pq
from motionlake import sql
from motionlake.arrays import StepProgress
from motionlake.errors import UserError
from motionlake.lake.catalog import (
    SCHEMA_VERSION,
    Connection,
    changing,
    check_version,
    fetch,
    load_rows,
    open_catalog,
    refresh_macros,
    refresh_views,
    run_sql,
    table_of,
    version_of,
)
from motionlake.lake.file_list import FILE_ROWS, sums_of
from motionlake.lake.frames import KEY, SCHEMA, RigsFooter, clip_tables, footer_clip, motion_footer
from motionlake.lake.garbage import remove_stale_copies
from motionlake.lake.layout import Lake
from motionlake.lake.lock import locked
from motionlake.lake.parts import PartWriter, check_part, replacing
from motionlake.lake.records import write_records
from motionlake.lake.settings import enter_settings, settings_now
from motionlake.motion.rig_joints import rig_joints
from motionlake.motion.rigs import load_rigs
from motionlake.stopping import held

_SIZES: Final = pa.schema({"stage": pa.string(), "key": pa.string(), "bytes": pa.int64()})


@dataclass(frozen=True)
class Step:
    """From one version to the next.

    Attributes:
        does: what it changes, for people.
        due: the files that it has to rewrite still, in the order in which it must.
        rewrite: brings one of them up to date, by what the catalog says.
        enter: changes the catalog, its version included.
    """

    does: str
    due: Callable[[Lake], list[Path]]
    rewrite: Callable[[Connection, Path], None]
    enter: Callable[[Lake, Connection], object]


@dataclass(frozen=True)
class Planned:
    """A step that a lake needs, with the files it rewrites and their bytes."""

    from_version: int
    to_version: int
    does: str
    files: int
    bytes: int

    def as_row(self) -> dict[str, Any]:
        return asdict(self)


def plan(lake: Lake) -> list[Planned]:
    """The steps from the version of a lake to that of this program; none where it is of that version.

    Raises:
        UserError: the lake is newer than this program, or cannot be opened.
    """
    con = open_catalog(lake)
    try:
        version = version_of(con)
        if version > SCHEMA_VERSION:
            check_version(con, lake)
    finally:
        con.close()
    return [_planned(lake, before) for before in range(version, SCHEMA_VERSION)]


def _planned(lake: Lake, before: int) -> Planned:
    files = STEPS[before].due(lake)
    return Planned(before, before + 1, STEPS[before].does, len(files), sum(file.stat().st_size for file in files))


def migrate(lake: Lake, progress: StepProgress) -> list[Planned]:
    """Bring a lake up to date; returns the steps that were taken.

    Raises:
        UserError: as `plan`; another run holds the lake; a part is damaged; the catalog is older than any version.
    """
    with locked(lake, "migrate"):
        remove_stale_copies(lake)
        steps = plan(lake)
        for planned in steps:
            _rewrite(lake, planned, progress)
        if steps:
            with changing(lake) as con:
                for planned in steps:
                    STEPS[planned.from_version].enter(lake, con)
                _check_columns(con, lake)
                refresh_macros(con)
                refresh_views(con, lake)
                enter_settings(con, settings_now(lake))
            write_records(lake)
        return steps


def _rewrite(lake: Lake, planned: Planned, progress: StepProgress) -> None:
    step, con = STEPS[planned.from_version], open_catalog(lake)
    try:
        for done, file in enumerate(step.due(lake), 1):
            with held():
                step.rewrite(con, file)
            progress(f"version {planned.to_version}", done, planned.files)
    finally:
        con.close()


def _check_columns(con: Connection, lake: Lake) -> None:
    """Raises `UserError`, and so leaves the old catalog, where a table is not as a new lake has it."""
    import duckdb

    new = duckdb.connect(":memory:")
    try:
        for name in sql.names("schema"):
            run_sql(new, name)
        wanted, found = ({tuple(row.values()) for row in fetch(each, "columns")} for each in (new, con))
    finally:
        new.close()
    if wanted != found:
        differ = sorted({table for table, *_ in wanted ^ found})
        raise UserError(
            f"{lake.root}: its tables {', '.join(differ)} are of no known version, perhaps of one before 0.1.0; take "
            "its folders in to a new lake"
        )


def _frames_due(lake: Lake) -> list[Path]:
    """Frames parts without a footer, last name first.

    DuckDB takes the columns of a view over parts from the first of them and lets others have more: until the first
    has the new column too, the old catalog's view reads old and new parts alike.
    """
    return [p for p in sorted(lake.root.glob("frames/*/[!.]*.parquet"), reverse=True) if not _has_footer(p)]


def _has_footer(path: Path) -> bool:
    try:
        return KEY.encode() in (pq.read_metadata(path).metadata or {})
    except pa.ArrowInvalid as error:
        raise UserError(f"{path}: is a damaged frames part ({str(error).splitlines()[0]}); put back a copy") from error


def _rewrite_frames(con: Connection, path: Path) -> None:
    """Give a part the column `fps` and its footer; rows of clips that left the lake go."""
    clips = {row["clip"]: row for row in fetch(con, "clips_of_part", {"part": path.stem})}
    said, rigs, known = {}, RigsFooter(), load_rigs(path.parents[2] / "rigs")
    part = pq.ParquetFile(path)
    with replacing(path) as temporary:
        writer = PartWriter(temporary, SCHEMA, {"key": part.metadata.metadata[b"key"].decode()})
        for clip, rows in clip_tables(part, clips):
            rate = pa.repeat(pa.scalar(clips[clip]["fps"]), rows.num_rows)
            writer.append(rows.add_column(SCHEMA.get_field_index("fps"), SCHEMA.field("fps"), rate))
            said[clip] = footer_clip(clips[clip]["fps"], clips[clip]["rest_offsets"])
            if clips[clip]["rig"] in known:
                rigs.add(clip, clips[clip]["rig"], rig_joints(clips[clip]["joints"], known[clips[clip]["rig"]]))
        writer.close({**motion_footer(said), **rigs.metadata()})
        check_part(temporary, sum(row["frames"] for row in clips.values()))


def _enter_frames(lake: Lake, con: Connection) -> None:
    rows = [
        {**row, "bytes": sum(lake.path(file).stat().st_size for file in row["files"])}
        for row in fetch(con, "files_of_frames")
    ]
    load_rows(con, "migrations/0_to_1.sql", table_of(rows, _SIZES))


def _enter_files(lake: Lake, con: Connection) -> None:
    names = [row["file"] for row in fetch(con, "live_files")]
    missing = next((name for name in names if not lake.path(name).is_file()), None)
    if missing is not None:
        raise UserError(f"{lake.path(missing)}: is missing; put back a copy")
    load_rows(con, "migrations/2_to_3.sql", table_of([sums_of(lake, name)._asdict() for name in names], FILE_ROWS))


STEPS: Final[Mapping[int, Step]] = {
    0: Step(
        "frames carry their rate (column fps) and say in their footer what they hold",
        _frames_due,
        _rewrite_frames,
        _enter_frames,
    ),
    1: Step(
        "what training gave is called metrics (column models.metrics)",
        lambda lake: [],
        lambda con, path: None,
        lambda lake, con: run_sql(con, "migrations/1_to_2.sql"),
    ),
    2: Step(
        "the catalog lists every file with its size and hashes",
        lambda lake: [],
        lambda con, path: None,
        _enter_files,
    ),
    3: Step(
        "vectors of windows of clips leave the catalog for parts, which the next `motionlake run all` makes",
        lambda lake: [],
        lambda con, path: None,
        lambda lake, con: run_sql(con, "migrations/3_to_4.sql"),
    ),
}
