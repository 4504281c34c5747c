"""Mending what a lake is opened by: its catalog from the copies beside it, its settings, and the copies themselves."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from motionlake.errors import DamagedError, UserError
from motionlake.lake.catalog import reading
from motionlake.lake.catalog_file import (
    announce_anew,
    announce_catalog,
    catalog_written,
    forget_kept,
    kept_fault,
    kept_sums,
    known_sums,
    read_sums,
    sums_of_file,
)
from motionlake.lake.layout import Lake
from motionlake.lake.parts import replacing
from motionlake.lake.records import build_catalog, read_records, records_of, table_names, write_records
from motionlake.lake.settings import changes, settings_now, settings_then
from motionlake.lake.verify import catalog_fault
from motionlake.weights import checkpoint_fault


@dataclass(frozen=True)
class Mended:
    """What became of one damaged file.

    Attributes:
        file: relative to the lake.
        fault: what was wrong.
        done: what was done, or what only a person can do.
        mended: whether the lake is sound there now.
    """

    file: str
    fault: str
    done: str
    mended: bool


def mend_catalog(lake: Lake) -> Iterator[Mended]:
    """Put back a damaged or lost catalog, and write the copies of a sound one anew; the caller holds the lock.

    Raises:
        UserError: nothing is left that a catalog could be made from, or this one cannot be read for another reason
            than damage: a newer version, another program that writes it.
    """
    try:
        known, said = read_sums(lake)["catalog.duckdb"], None
    except ValueError as error:
        known, said = [], str(error)
    fault = catalog_fault(lake, known, deep=True) or _unreadable(lake)
    if fault is not None:
        yield Mended(lake.catalog.name, fault, _put_back(lake, known[0]["sha256"] if known else ""), mended=True)
    elif said is not None:
        announce_anew(lake)
    if said is not None:
        yield Mended(lake.sums.name, said, "written anew", mended=True)
    for kept in known_sums(lake)["kept"]:
        wrong = kept_fault(lake, kept, deep=True)
        if wrong is not None:
            forget_kept(lake, kept["file"])
            yield Mended(kept["file"], wrong, "forgotten: a copy of an earlier catalog", mended=True)
    yield from _mend_records(lake)


def _unreadable(lake: Lake) -> str | None:
    """Why a table of the catalog cannot be read, by DuckDB's own checksums."""
    import duckdb

    try:
        with reading(lake) as con:
            for name in table_names(con):
                con.table(name).to_arrow_table()
    except (
        duckdb.IOException,
        duckdb.SerializationException,
        duckdb.FatalException,
        duckdb.InternalException,
    ) as error:
        return str(error).splitlines()[0]
    except DamagedError as error:
        return str(error)
    return None


def _put_back(lake: Lake, wanted: str) -> str:
    """Make a catalog from the newest of its copies; says from which, and where the damaged one is.

    `wanted`: sha256 of the catalog that is lost, "" where nobody knows it.
    """
    aside = lake.catalog.with_name("catalog.duckdb.damaged")
    there = lake.catalog.is_file()
    if there:
        lake.catalog.replace(aside)
    try:
        source = _copied_back(lake, wanted)
    except BaseException:
        if there and not lake.catalog.exists():
            aside.replace(lake.catalog)
        raise
    return f"put back from {source}" + f"; the damaged one is {aside.name}" * there


def _copied_back(lake: Lake, wanted: str) -> str:
    attempts: list[tuple[str, str, Path | None]] = [("records.zip", records_of(lake.records), None)]
    kept = [k for k in kept_sums(lake) if not kept_fault(lake, k, deep=True)]
    attempts += [(k["file"], k["sha256"], lake.path(k["file"])) for k in kept]
    if attempts[0][1] != wanted:  # the last run was cut short: a kept catalog is newer
        attempts = [*attempts[1:], attempts[0]]
    reasons = []
    for name, sha256, path in attempts:
        try:
            if path is None:
                build_catalog(lake, dict(read_records(lake.records)))
            else:
                _copy(lake, path)
        except (ValueError, UserError, OSError) as error:
            reasons.append(str(error))
        else:
            earlier = (
                ", which is of an earlier moment: what was taken in, labelled or computed after it is to be done again"
            )
            return name + earlier * (wanted not in ("", sha256))
    raise UserError(
        f"{lake.root}: its catalog is lost, and so are its copies ({reasons[0]}); `motionlake restore` takes a backup, "
        "else make a new lake of the same folders"
    )


def _copy(lake: Lake, path: Path) -> None:
    with replacing(lake.catalog) as temporary:
        temporary.write_bytes(path.read_bytes())
        announce_catalog(lake, temporary)
    catalog_written(lake)
    fault = _unreadable(lake)
    if fault is not None:
        lake.catalog.unlink()
        raise ValueError(f"{path}: {fault}")


def _mend_records(lake: Lake) -> Iterator[Mended]:
    with suppress(ValueError):
        known = read_sums(lake)["records.zip"]
        if not lake.records.is_file() or sums_of_file(lake.records) not in known:
            fault = "holds other bytes than were written" if lake.records.is_file() else "is missing"
            lake.records.unlink(missing_ok=True)
            write_records(lake)
            if known:  # else it may have been sound: its sums were lost
                yield Mended(lake.records.name, fault, "written anew from the catalog", mended=True)


def mend_settings(lake: Lake) -> Iterator[Mended]:
    """Put settings back as the last run found them; the text that was there is set aside."""
    with reading(lake) as con:
        then = settings_then(con)
    for file, what in changes(then, settings_now(lake)) if then else []:
        if file not in then:
            continue
        path = lake.path(file)
        done = "the former text is back"
        if path.is_file():
            aside = path.with_name(f"{path.name}.set-aside")
            path.replace(aside)
            done += f"; the other is {aside.name}"
        with replacing(path) as temporary:
            temporary.write_text(then[file], encoding="utf-8", newline="")
        yield Mended(file, what, done, mended=True)


def mend_checkpoints(lake: Lake) -> Iterator[Mended]:
    """Delete damaged checkpoints: a training begins anew without one."""
    for path in sorted((lake.root / "training").glob("[!.]*.safetensors")):
        fault = checkpoint_fault(path)
        if fault is not None:
            path.unlink()
            yield Mended(lake.relative(path), fault, "deleted: the training begins anew", mended=True)
