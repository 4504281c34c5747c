"""What of a lake is only there because it was written once: empty blocks of the catalog, models that serve no more."""

from __future__ import annotations

from collections import Counter
from contextlib import closing
from dataclasses import dataclass
from typing import Final

from motionlake import sql
from motionlake.lake.catalog import (
    Connection,
    fetch,
    reading,
    refresh_macros,
    refresh_views,
    run_sql,
    writing,
)
from motionlake.lake.catalog_file import announce_catalog, catalog_written
from motionlake.lake.host import elsewhere, room
from motionlake.lake.layout import Lake
from motionlake.lake.parts import replacing
from motionlake.lake.records import table_names
from motionlake.memory import for_duckdb
from motionlake.stopping import held

EMPTY: Final = 0.25  # share of a catalog's blocks that may hold nothing
LEAST: Final = 4 << 20  # bytes of empty blocks from which on they are worth a new file


@dataclass(frozen=True)
class Blocks:
    """Bytes of the catalog's file, and those of its blocks that hold nothing."""

    bytes: int
    empty: int

    @property
    def many(self) -> bool:
        """Whether so many are empty that a new file is worth writing."""
        return self.empty >= LEAST and self.empty > EMPTY * self.bytes


def blocks_of(lake: Lake) -> Blocks:
    """How much of the catalog's file is empty."""
    with reading(lake) as con:
        (found,) = fetch(con, "free_blocks")
    return Blocks(lake.catalog.stat().st_size, found["free"] * found["bytes"])


def rewrite_catalog(lake: Lake) -> None:
    """Write the catalog anew, with the same rows in the same order and no empty blocks; the caller holds the lock."""
    import duckdb

    settings = {**elsewhere(), **for_duckdb(), "threads": 1}
    with held(), room(lake.catalog), replacing(lake.catalog) as temporary:
        with closing(duckdb.connect(str(temporary), config=settings)) as con:
            for name in sql.names("schema"):
                run_sql(con, name)
            run_sql(con, "attach_before", {"catalog": str(lake.catalog)})
            con.begin()
            for name in table_names(con):
                con.table(f"before.main.{name}").select(*con.table(name).columns).insert_into(name)
            con.commit()
            run_sql(con, "detach_before")
            refresh_macros(con)
            run_sql(con, "use_lake", {"root": str(lake.root)})
            refresh_views(con, lake)
            con.execute("CHECKPOINT")
        announce_catalog(lake, temporary)
    catalog_written(lake)


def superseded(con: Connection, keep: int) -> list[str]:
    """Versions of models that neither serve, nor made what serves, nor are named by a model that stays; the `keep`
    newest of each kind stay."""
    found, seen = [], Counter[str]()
    for row in fetch(con, "superseded_models"):
        seen[row["kind"]] += 1
        used = fetch(con, "model_in_use", {"model": row["model"], "file": row["file"]})[0]["used"]
        if seen[row["kind"]] > keep and not used:
            found.append(row["model"])
    said = "".join(row["metrics"] + row["config"] for row in fetch(con, "models_named", {"without": found}))
    return [model for model in found if f'"{model}"' not in said]


def forget_models(lake: Lake, models: list[str]) -> None:
    """Let the catalog name these models no more; their files go with what nothing names."""
    with writing(lake) as con:
        for model in models:
            run_sql(con, "forget_model", {"model": model})
