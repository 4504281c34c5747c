"""Is a lake as it was written? Every file against the catalog's list, the catalog against its sums, settings against
what the last run found."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

from motionlake.arrays import StepProgress
from motionlake.errors import DamagedError
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.catalog_file import check_catalog, kept_fault, known_sums, read_sums, sums_of_file
from motionlake.lake.file_list import FileSums, listed_in
from motionlake.lake.integrity import deep_fault, touched_faults
from motionlake.lake.layout import Lake
from motionlake.lake.records import read_records
from motionlake.lake.settings import changed_settings
from motionlake.weights import checkpoint_fault

_TRIES: Final = 5


@dataclass(frozen=True)
class Fault:
    """What is wrong with one file of a lake.

    Attributes:
        kind: "catalog", "copy" (of the catalog), "file" (parts, raw blocks, models), "settings" or "checkpoint".
        file: relative to the lake.
        fault: in a few words.
        mend: what to do.
    """

    kind: str
    file: str
    fault: str
    mend: str

    def as_row(self) -> dict[str, Any]:
        return asdict(self)


def verify(lake: Lake, *, deep: bool, progress: StepProgress) -> list[Fault]:
    """Everything that is not as it was written; looked at again where somebody wrote meanwhile.

    Args:
        lake: its folder; the catalog may be missing.
        deep: compare every byte; else names, sizes, and files that were touched.
        progress: told of files that were compared.
    """
    for _ in range(_TRIES):
        before = _served(lake)
        found = _verify(lake, deep=deep, progress=progress)
        if not found or _served(lake) == before:
            break
    return found


def _served(lake: Lake) -> tuple[int, int] | None:
    return lake.served() if lake.catalog.exists() else None


def _verify(lake: Lake, *, deep: bool, progress: StepProgress) -> list[Fault]:
    mend = lake.mending
    found = list(_catalog_faults(lake, mend, deep=deep))
    lost = any(fault.kind == "catalog" and fault.file == lake.catalog.name for fault in found)
    listed = _listed_by_records(lake) if lost else _listed(lake)
    wrong = deep_faults(lake, listed, progress) if deep else touched_faults(lake, listed.values())
    found += [Fault("file", file.file, fault, mend) for file, fault in wrong]
    if not lost:
        with reading(lake) as con:
            unlisted = [row["file"] for row in fetch(con, "unlisted_files")]
        found += [Fault("file", file, "is not listed with its size and hashes", mend) for file in unlisted]
        kept = f"{mend} puts the former text back; motionlake run all takes the new one"
        found += [Fault("settings", file, f"{what}, since the last run", kept) for file, what in changed_settings(lake)]
    return found + list(_checkpoint_faults(lake, mend, deep=deep))


def _listed(lake: Lake) -> Mapping[str, FileSums]:
    with reading(lake) as con:
        return listed_in(con)


def _listed_by_records(lake: Lake) -> Mapping[str, FileSums]:
    with suppress(ValueError):
        for name, rows in read_records(lake.records):
            if name == "files":
                return {row["file"]: FileSums(**row) for row in rows.to_pylist()}
    return {}


def deep_faults(lake: Lake, listed: Mapping[str, FileSums], progress: StepProgress) -> list[tuple[FileSums, str]]:
    """The files of which a byte is not as it was written."""
    files = list(listed.values())
    with ThreadPoolExecutor(min(4, os.cpu_count() or 1)) as pool:
        faults = []
        for done, (file, fault) in enumerate(zip(files, pool.map(partial(deep_fault, lake), files), strict=True), 1):
            progress("verify", done, len(files))
            if fault is not None:
                faults.append((file, fault))
    return faults


def _catalog_faults(lake: Lake, mend: str, *, deep: bool) -> Iterator[Fault]:
    try:
        sums = read_sums(lake)
    except ValueError as error:
        yield Fault("copy", lake.sums.name, str(error), mend)
        sums = known_sums(lake)
    fault = catalog_fault(lake, sums["catalog.duckdb"], deep=deep)
    if fault is not None:
        yield Fault("catalog", lake.catalog.name, fault, mend)
    if sums["records.zip"]:
        fault = _copy_fault(lake.records, sums["records.zip"], deep=deep)
        if fault is not None:
            yield Fault("copy", lake.records.name, fault, mend)
    for kept in sums["kept"]:
        fault = kept_fault(lake, kept, deep=deep)
        if fault is not None:
            yield Fault("copy", kept["file"], fault, mend)


def catalog_fault(lake: Lake, known: list[dict[str, Any]], *, deep: bool) -> str | None:
    """What is wrong with the catalog that is served.

    Raises:
        UserError: it cannot be read for another reason than damage.
    """
    if not lake.catalog.is_file():
        return "is missing"
    if deep and known and sums_of_file(lake.catalog) not in known:
        return "holds other bytes than were written"
    try:
        check_catalog(lake)
        with reading(lake) as con:
            listed_in(con)
    except DamagedError as error:
        return str(error).removeprefix(f"{lake.catalog}: ").partition("; `motionlake")[0]
    return None


def _copy_fault(path: Path, known: list[dict[str, Any]], *, deep: bool) -> str | None:
    if not path.is_file():
        return "is missing"
    if path.stat().st_size not in [one["size"] for one in known]:
        return "has another size than was written"
    if deep and sums_of_file(path) not in known:
        return "holds other bytes than were written"
    return None


def _checkpoint_faults(lake: Lake, mend: str, *, deep: bool) -> Iterator[Fault]:
    for path in sorted((lake.root / "training").glob("[!.]*.safetensors")) if deep else ():
        fault = checkpoint_fault(path)
        if fault is not None:
            yield Fault("checkpoint", lake.relative(path), fault, mend)
