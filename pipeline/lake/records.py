"""The tables of the catalog outside of it: Parquet files in one archive, which any program reads.

A lost catalog is rebuilt from it, with the labels and segments that people gave.
"""

from __future__ import annotations

import io
import time
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import IO, Final

import pyarrow as pa
import pyarrow.parquet as pq
from motionlake import sql
from motionlake.lake.catalog import SCHEMA_VERSION, Connection, fetch, reading, refresh_macros, refresh_views, run_sql
from motionlake.lake.catalog_file import (
    WHOLE,
    announce_catalog,
    announce_records,
    catalog_written,
    read_sums,
    sums_of_file,
)
from motionlake.lake.layout import Lake
from motionlake.lake.parts import replacing

_DATE = (1980, 1, 1, 0, 0, 0)  # of every entry, so that the same tables make the same archive
_ROWS: Final = 122_880  # a group, as in DuckDB
EVERY: Final = 7 * 86_400.0
_CATALOG = b"catalog "  # and the sha256 of the catalog they are of: the archive's comment


def write_records(lake: Lake) -> None:
    """Copy the tables of the catalog, unless the copy is of this catalog already."""
    try:
        sums = read_sums(lake)["catalog.duckdb"]
    except ValueError:
        sums = []
    comment = _CATALOG + (sums[0] if sums else sums_of_file(lake.catalog))["sha256"].encode()
    if _comment(lake.records) == comment:
        return
    with replacing(lake.records) as temporary:
        with zipfile.ZipFile(temporary, "w") as archive, reading(lake) as con:
            archive.comment = comment
            for name in table_names(con):
                entry = zipfile.ZipInfo(f"{name}.parquet", _DATE)
                with archive.open(entry, "w", force_zip64=True) as handle:
                    _write_parquet(con.table(name).to_arrow_reader(_ROWS), handle)
        announce_records(lake, temporary)


def keep_records(lake: Lake) -> None:
    """The same as a command ends; of a large catalog, of which it takes long, once in `EVERY` seconds."""
    try:
        lately = time.time() - lake.records.stat().st_mtime < EVERY
    except FileNotFoundError:
        lately = False
    if not lately or lake.catalog.stat().st_size <= WHOLE:
        write_records(lake)


def table_names(con: Connection) -> list[str]:
    """The tables of a catalog, by name."""
    return [row["name"] for row in fetch(con, "table_names")]


def _write_parquet(rows: pa.RecordBatchReader, handle: IO[bytes]) -> None:
    """Write rows in groups of `_ROWS`, so that memory holds few of them."""
    with pq.ParquetWriter(handle, rows.schema, compression="zstd", write_page_checksum=True) as writer:
        waiting = rows.schema.empty_table()
        for batch in rows:
            waiting = pa.concat_tables([waiting, pa.Table.from_batches([batch])])
            while len(waiting) >= _ROWS:
                writer.write_table(waiting.slice(0, _ROWS), row_group_size=_ROWS)
                waiting = waiting.slice(_ROWS)
        if len(waiting):
            writer.write_table(waiting, row_group_size=_ROWS)


def _comment(path: Path) -> bytes:
    try:
        with zipfile.ZipFile(path) as archive:
            return archive.comment
    except (OSError, zipfile.BadZipFile):
        return b""


def records_of(path: Path) -> str:
    """sha256 of the catalog whose tables an archive holds; "" where it does not say."""
    return _comment(path).removeprefix(_CATALOG).decode("ascii", "replace")


def read_records(path: Path) -> Iterator[tuple[str, pa.Table]]:
    """(name, rows) of every table of an archive.

    Raises:
        ValueError: the archive is damaged.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            for name in archive.namelist():
                if name.endswith(".parquet") and "/" not in name:
                    rows = pq.read_table(io.BytesIO(archive.read(name)), page_checksum_verification=True)
                    yield name.removesuffix(".parquet"), rows
    except (OSError, zipfile.BadZipFile, pa.ArrowException, EOFError, NotImplementedError) as error:
        raise ValueError(f"{path}: is damaged ({error})") from error


def build_catalog(lake: Lake, tables: Mapping[str, pa.Table]) -> None:
    """Put a catalog of these tables in the place of the one that is there; the caller holds the lake's lock.

    Raises:
        ValueError: the tables are not those of a catalog of this version.
    """
    import duckdb

    version = tables["schema_version"].column("version").to_pylist() if "schema_version" in tables else []
    if version != [SCHEMA_VERSION]:
        raise ValueError(f"its tables are not of version {SCHEMA_VERSION}")
    with replacing(lake.catalog) as temporary:
        with closing(duckdb.connect(str(temporary))) as con:
            for name in sql.names("schema"):
                run_sql(con, name)
            known = set(table_names(con))
            if set(tables) != known:
                raise ValueError(f"its tables differ from those of a catalog: {', '.join(sorted(set(tables) ^ known))}")
            con.begin()
            for name, rows in tables.items():
                try:
                    con.from_arrow(rows.select(con.table(name).columns)).insert_into(name)
                except (duckdb.Error, KeyError) as error:
                    raise ValueError(f"its table {name} does not fit ({str(error).splitlines()[0]})") from error
            con.commit()
            refresh_macros(con)
            run_sql(con, "use_lake", {"root": str(lake.root)})
            refresh_views(con, lake)
            con.execute("CHECKPOINT")
        announce_catalog(lake, temporary)
    catalog_written(lake)
