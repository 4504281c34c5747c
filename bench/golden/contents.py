"""The contents of a lake as entries to compare: tables, Parquet parts and models, column by column.

Exact entries are hashes. Soft ones, which hold on other machines, describe numbers by their mean, spread and first
values; whole numbers and text keep their hashes.
"""

from __future__ import annotations

import hashlib
import json
import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from bench.golden.commands import CLOCK_COLUMNS, CLOCK_KEYS, CLOCKS_BESIDE

Clean = Callable[[str], str]
# Columns that rows are put in order by only where the others leave it open: a new key moves no row.
LATE: Final = ("key", "part", "files", "spec", "config", "metrics", "content_hash", "config_hash", "data_hash")
JSON_COLUMNS: Final = ("config", "metrics", "spec", "options")
# Whole numbers that follow from sums of fractions: two machines may round a few of them differently.
SOFT_COLUMNS: Final = ("motif", "symbol", "symbols", "starts")
# Tables that tell how a record was made rather than what: the words of commands, and where they ran.
SOFT_WITHOUT: Final = ("runs", "manifest")


def lake_entries(lake: Path, clean: Clean, *, soft: bool = False) -> dict[str, Any]:
    """Everything in a lake, by name."""
    return {
        "table": _tables(lake, clean, soft),
        "part": _parts(lake, clean, soft),
        "model": _models(lake, clean, soft),
    }


def digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def without_clocks(value: Any, left_out: Sequence[str] = CLOCK_KEYS) -> Any:
    """JSON without what tells time, its numbers to seven digits."""
    if isinstance(value, dict):
        beside = [key for other, keys in CLOCKS_BESIDE.items() if other in value for key in keys]
        return {k: without_clocks(v, left_out) for k, v in value.items() if k not in left_out and k not in beside}
    if isinstance(value, list):
        return [without_clocks(v, left_out) for v in value]
    return rounded(value) if isinstance(value, float) else value


def rounded(value: float, digits: int = 7) -> float:
    return float(f"{value:.{digits}g}")


def _tables(lake: Path, clean: Clean, soft: bool) -> dict[str, Any]:
    found: dict[str, Any] = {}
    con = duckdb.connect(str(lake / "catalog.duckdb"), read_only=True)
    try:
        con.execute("SET file_search_path = $root", {"root": str(lake)})
        names = con.execute("SELECT table_name, table_type FROM information_schema.tables ORDER BY ALL").fetchall()
        for name, kind in names:
            if soft and name in SOFT_WITHOUT:
                continue
            try:
                types = {row[0]: row[1] for row in con.execute(f'DESCRIBE "{name}"').fetchall()}
                order = ", ".join(f'"{column}"' for column in _in_order(types))
                rows = con.sql(f'SELECT * FROM "{name}" ORDER BY {order}').to_arrow_table()
            except duckdb.IOException:  # a view of parts that were not made
                found[name] = {"kind": kind, "rows": None}
                continue
            found[name] = {
                "kind": kind,
                "rows": rows.num_rows,
                "type": types,
                "column": _columns(rows, clean, soft, CLOCK_COLUMNS.get(name, ())),
            }
    finally:
        con.close()
    return found


def _in_order(types: dict[str, str]) -> list[str]:
    """Columns to order rows by: names and whole numbers first, so that no rounding moves a row."""

    def rank(column: str) -> int:
        if column in LATE:
            return 2
        return 0 if types[column] in ("VARCHAR", "BIGINT", "INTEGER", "BOOLEAN") else 1

    return sorted(types, key=rank)


def _parts(lake: Path, clean: Clean, soft: bool) -> dict[str, Any]:
    """Every part, named by its folder and its place there by clip: file names are hashes of other things."""
    found: dict[str, Any] = {}
    folders: dict[str, list[tuple[str, str, Any]]] = {}
    for path in sorted(path for path in lake.rglob("*") if path.suffix in (".parquet", ".arrow")):
        folder = path.parent.relative_to(lake).as_posix()
        if folder.partition("/")[0] not in ("models", "shortlist"):
            mapped = path.suffix == ".arrow"
            rows = pa.ipc.open_file(path).read_all() if mapped else pq.read_table(path, partitioning=None)
            first = str(rows["clip"][0]) if "clip" in rows.column_names and rows.num_rows else ""
            folders.setdefault(folder, []).append((first, path.name, rows))
    for folder, parts in folders.items():
        for number, (_, file, rows) in enumerate(sorted(parts, key=lambda part: part[:2])):
            found.setdefault(folder, {})[str(number)] = _parquet(rows, clean, soft)
            if not soft:
                found[folder][str(number)]["file"] = file
    return found


def _parquet(rows: Any, clean: Clean, soft: bool) -> dict[str, Any]:
    return {
        "rows": rows.num_rows,
        "type": {field.name: str(field.type) for field in rows.schema},
        "column": _columns(rows, clean, soft),
    }


def _models(lake: Path, clean: Clean, soft: bool) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for path in sorted(p for p in (lake / "models").rglob("*") if p.is_file()):
        name = path.relative_to(lake / "models").as_posix()
        if path.suffix == ".parquet":
            found[name] = _parquet(pq.read_table(path, partitioning=None), clean, soft)
        elif path.suffix == ".safetensors":
            found[name] = _tensors(path)
        elif path.suffix == ".json":
            found[name] = without_clocks(json.loads(clean(path.read_text(encoding="utf-8"))))
        else:
            found[name] = path.stat().st_size if soft else digest(path.read_bytes())
    return found


def _tensors(path: Path) -> dict[str, Any]:
    content = path.read_bytes()
    (length,) = struct.unpack("<Q", content[:8])
    header, body = json.loads(content[8 : 8 + length]), content[8 + length :]
    found: dict[str, Any] = {}
    for name, about in sorted(header.items()):
        if name == "__metadata__":
            found["metadata"] = {
                key: without_clocks(json.loads(text)) if text[:1] in "[{" else text for key, text in about.items()
            }
            continue
        values = body[slice(*about["data_offsets"])]
        found.setdefault("tensor", {})[name] = f"{about['dtype']} {about['shape']} {digest(values)}"
    return found


def _columns(rows: Any, clean: Clean, soft: bool, clocks: Sequence[str] = ()) -> dict[str, Any]:
    """One entry a column; the rows are in one order for all, so that no value can change its row unseen."""
    found: dict[str, Any] = {}
    for name in rows.column_names:
        if name in clocks:
            continue
        chunks = rows[name].chunks
        values = pa.concat_arrays(chunks) if chunks else pa.array([], rows[name].type)
        if soft and name in (*JSON_COLUMNS, "content_hash"):
            continue
        if name in JSON_COLUMNS and pa.types.is_string(values.type):
            values = pa.array([text and _normal(text) for text in values.to_pylist()], values.type)
        leaves = _leaves(values)
        number = pa.types.is_floating(leaves.type) or (name in SOFT_COLUMNS and pa.types.is_integer(leaves.type))
        if soft and number:
            found[name] = _numbers(leaves.drop_null().to_numpy())
        else:
            state = hashlib.sha256()
            _feed(state, values, clean)
            found[name] = state.hexdigest()[:16]
    return found


def _normal(text: str) -> str:
    return json.dumps(without_clocks(json.loads(text)), sort_keys=True)


def _is_list(kind: Any) -> bool:
    return bool(pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind))


def _leaves(values: Any) -> Any:
    while _is_list(values.type):
        values = pc.list_flatten(values)
    return values


def _feed(state: Any, values: Any, clean: Clean) -> None:
    """The logical contents of a column: where it is empty, lengths of lists, values."""
    kind = values.type
    if pa.types.is_dictionary(kind):
        _feed(state, values.dictionary_decode(), clean)
        return
    if values.null_count:
        state.update(values.is_null().to_numpy(zero_copy_only=False).tobytes())
    if _is_list(kind):
        state.update(pc.list_value_length(values).fill_null(-1).to_numpy(zero_copy_only=False).tobytes())
        _feed(state, pc.list_flatten(values), clean)
    elif pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind):
        filled = values.fill_null(False if pa.types.is_boolean(kind) else 0) if values.null_count else values
        state.update(filled.to_numpy(zero_copy_only=False).tobytes())
    else:
        state.update(clean(json.dumps(values.to_pylist(), ensure_ascii=False, default=str)).encode())


def _numbers(values: Any) -> list[float]:
    """What two machines agree on to a few digits: how many, their mean, spread and first value."""
    if not len(values):
        return [0]
    wide = np.asarray(values, dtype=np.float64)
    return [len(wide), *(rounded(float(value), 6) for value in (wide.mean(), wide.std(), wide[0]))]
