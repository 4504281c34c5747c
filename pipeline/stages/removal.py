"""Taking clips out of a lake."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch, load_rows, reading, run_sql, table_of, writing
from motionlake.lake.layout import Lake
from motionlake.lake.resolve import resolve_clip
from motionlake.names import on_disk
from motionlake.stages.clip_parts import forget_orphans, held
from motionlake.stages.frames import SOURCE_ROWS
from motionlake.stages.sources import known_roots, options_json


@dataclass(frozen=True)
class Removal:
    """How many clips left, and how many source files were forgotten; synthetic clips have none."""

    clips: int
    files: int

    def __add__(self, other: Removal) -> Removal:
        return Removal(self.clips + other.clips, self.files + other.files)

    def __sub__(self, other: Removal) -> Removal:
        return Removal(self.clips - other.clips, self.files - other.files)


Source = dict[str, Any]  # a row with a dataset and a path


def sources_of(con: Connection, names: Sequence[str]) -> list[Source]:
    """The source files of clips, by name; all bodies of a file go together. A synthetic clip is one of its own.

    Raises:
        UserError: no clip or several are meant by a name.
    """
    known = {row["dataset"] for row in fetch(con, "status_datasets")}
    for name in names:
        if name in known and not fetch(con, "find_clip", {"name": name}):
            raise UserError(f"{name}: is a dataset; `motionlake remove --dataset {name}` removes all of it")
    return [fetch(con, "clip", {"clip": resolve_clip(con, name)})[0] for name in names]


def gone_sources(con: Connection) -> list[Source]:
    """Every source file the lake knows that is not on disk any more."""
    return [row for row in fetch(con, "all_sources") if not Path(on_disk(row["root"]), on_disk(row["path"])).exists()]


def clips_of_sources(con: Connection, sources: Sequence[Source]) -> list[str]:
    """The clips that go with source files, by name."""
    paths = {(source["dataset"], source["path"]) for source in sources}
    return [row["clip"] for row in fetch(con, "clips_by_path") if (row["dataset"], row["path"]) in paths]


def remove_dataset(lake: Lake, dataset: str) -> Removal:
    """Remove a dataset, recorded or synthetic, and forget its folders.

    Raises:
        UserError: there is no such dataset.
    """
    with reading(lake) as con:
        rows = fetch(con, "sources_of", {"dataset": dataset})
        made = fetch(con, "synthetic_paths", {"dataset": dataset})
        known = {r["dataset"] for name in ("roots", "synthetic_datasets") for r in fetch(con, name)}
    if not rows and dataset not in known:
        raise UserError(f"{dataset}: no such dataset in {lake.root}; it holds {', '.join(sorted(known)) or 'none'}")
    paths = {r["path"] for r in rows} | {r["path"] for r in made}
    removed = remove_sources(lake, [{"dataset": dataset, "path": path} for path in sorted(paths)])
    with writing(lake) as con:
        run_sql(con, "forget_roots", {"dataset": dataset})
    return removed


def remove_sources(lake: Lake, sources: Sequence[Source], *, for_good: bool = False) -> Removal:
    """Forget source files, their clips, and what was derived from them, in one transaction.

    `for_good`: their folders keep in mind not to take them in again.
    """
    if not sources:
        return Removal(0, 0)
    with writing(lake) as con:
        if for_good:
            _ignore(con, sources)
        before = _held(con)
        load_rows(con, "forget_sources", table_of(sources, SOURCE_ROWS))
        forget_orphans(con)
        return before - _held(con)


def _ignore(con: Connection, sources: Sequence[Source]) -> None:
    names = {(s["dataset"], s["path"]) for s in sources}
    for root in known_roots(con):
        held = [r for r in fetch(con, "sources_of", {"dataset": root.dataset}) if r["root"] == root.kept_base]
        paths = {r["path"] for r in held if (root.dataset, r["path"]) in names}
        if paths:
            options = replace(root.options, ignored=tuple(sorted(paths.union(root.options.ignored))))
            kept = {"dataset": root.dataset, "root": root.root, "options": options_json(options)}
            run_sql(con, "save_root_options", kept)


def _held(con: Connection) -> Removal:
    """What would leave if everything did."""
    return Removal(*held(con))
