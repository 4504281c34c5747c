"""The file of the catalog against what was written: its size and sha256 lie beside it, in `catalog.sums`.

The sums of a new catalog are written before it takes its name, beside those of the one before: whichever of the two a
killed run leaves is known. DuckDB has checksums of its own for every block it reads, so a large catalog is compared as
a whole only by `motionlake verify --deep`.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from motionlake.errors import DamagedError
from motionlake.lake.layout import Lake
from motionlake.lake.parts import replacing

WHOLE: Final = 64 << 20  # bytes of a catalog up to which every process compares all of them
KEPT: Final = 3  # catalogs that are kept beside the one that is served
_TRIES: Final = 50  # a reader may meet as many writers in a row

_NAMES: Final = ("catalog.duckdb", "kept", "records.zip")

# Size and sha256 of the catalog, of those that are kept, and of the records, newest first.
Sums = dict[str, list[dict[str, Any]]]


def sums_of_file(path: Path) -> dict[str, Any]:
    """Size and sha256 of a file."""
    with path.open("rb") as handle:
        return {"size": os.fstat(handle.fileno()).st_size, "sha256": hashlib.file_digest(handle, "sha256").hexdigest()}


def read_sums(lake: Lake) -> Sums:
    """What `catalog.sums` says. Raises `ValueError` where the file is missing or damaged."""
    try:
        text = lake.sums.read_bytes()
        found: Sums = json.loads(text)
        whole = text == _text(found) and all({"size", "sha256"} <= set(one) for name in _NAMES for one in found[name])
    except FileNotFoundError as error:
        raise ValueError("is missing") from error
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError("is damaged") from error
    if not whole:
        raise ValueError("is damaged")
    return found


def write_sums(lake: Lake, sums: Mapping[str, list[dict[str, Any]]]) -> None:
    with replacing(lake.sums) as temporary:
        temporary.write_bytes(_text(sums))


def _text(sums: Mapping[str, list[dict[str, Any]]]) -> bytes:
    """The one spelling of some sums, with a sum of its own, so that every changed byte shows."""
    plain = {name: value for name, value in sums.items() if name != "self"}
    body = json.dumps(plain, sort_keys=True)
    own = [{"sha256": hashlib.sha256(body.encode()).hexdigest()}]
    return (json.dumps({**plain, "self": own}, sort_keys=True, indent=1) + "\n").encode()


def announce_catalog(lake: Lake, temporary: Path) -> None:
    """Before a new catalog takes its name: write down what it is, and keep the one before."""
    sums = known_sums(lake)
    before = sums["catalog.duckdb"][:1]
    if not before and lake.catalog.is_file():
        before = [sums_of_file(lake.catalog)]
    kept = sums["kept"]
    if before and lake.catalog.is_file() and lake.catalog.stat().st_size == before[0]["size"]:
        kept = _keep(lake, before[0], kept)[:KEPT]
    write_sums(lake, {**sums, "catalog.duckdb": [sums_of_file(temporary), *before], "kept": kept})
    names = {Path(one["file"]).name for one in kept}
    for path in lake.kept.glob("*.duckdb"):
        if path.name not in names:
            path.unlink()


def announce_anew(lake: Lake) -> None:
    """Write down what the catalog that is served is, and which others are kept: for a lake whose sums are lost."""
    catalog = [sums_of_file(lake.catalog)]
    write_sums(lake, {"catalog.duckdb": catalog, "kept": kept_sums(lake), "records.zip": []})
    catalog_written(lake)


def kept_sums(lake: Lake) -> list[dict[str, Any]]:
    """The catalogs that are kept, newest first; where the list is lost, those whose name says what they hold."""
    paths = sorted(lake.kept.glob("[0-9]*-*.duckdb"), reverse=True)
    found = ({"file": lake.relative(path), **sums_of_file(path)} for path in paths)
    return known_sums(lake)["kept"] or [k for k in found if k["sha256"].startswith(k["file"][-23:-7])]


def announce_records(lake: Lake, temporary: Path) -> None:
    """The same for the copy of the catalog's tables."""
    sums = known_sums(lake)
    write_sums(lake, {**sums, "records.zip": [sums_of_file(temporary), *sums["records.zip"][:1]]})


def known_sums(lake: Lake) -> Sums:
    """What `catalog.sums` says; nothing where it is missing or damaged."""
    try:
        return read_sums(lake)
    except ValueError:
        return {name: [] for name in _NAMES}


def _keep(lake: Lake, sums: dict[str, Any], kept: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Keep the catalog that is served, newest first; a file system without links keeps none: there are the records."""
    number = int(Path(kept[0]["file"]).name.partition("-")[0]) + 1 if kept else 1
    path = lake.kept / f"{number:08d}-{sums['sha256'][:16]}.duckdb"
    try:
        lake.kept.mkdir(exist_ok=True)
        path.unlink(missing_ok=True)
        os.link(lake.catalog, path)
    except OSError:
        return kept
    return [{"file": lake.relative(path), **sums}, *kept]


def kept_fault(lake: Lake, kept: Mapping[str, Any], *, deep: bool) -> str | None:
    """What is wrong with one of the catalogs that are kept."""
    path = lake.path(kept["file"])
    if not path.is_file():
        return "is missing"
    if path.stat().st_size != kept["size"] or (deep and sums_of_file(path)["sha256"] != kept["sha256"]):
        return "holds other bytes than were written"
    return None


def forget_kept(lake: Lake, file: str) -> None:
    """Drop one of the catalogs that are kept."""
    lake.path(file).unlink(missing_ok=True)
    sums = known_sums(lake)
    write_sums(lake, {**sums, "kept": [one for one in sums["kept"] if one["file"] != file]})


def check_catalog(lake: Lake) -> None:
    """Compare the catalog that is served with its sums, once a process and catalog.

    Raises:
        DamagedError: it is not as it was written.
    """
    for _ in range(_TRIES):
        served = _identity(lake)
        if _checked.get(lake.catalog) == served:
            return
        try:
            known = read_sums(lake)["catalog.duckdb"]
        except ValueError:
            return  # `motionlake verify` tells of it; DuckDB compares what it reads
        wrong = _wrong(lake, known)
        if wrong is None:
            _checked[lake.catalog] = served
            return
        with suppress(ValueError):
            if _identity(lake) == served and read_sums(lake)["catalog.duckdb"] == known:
                break  # nobody has written meanwhile
    raise DamagedError(f"{lake.catalog}: {wrong}; `{lake.mending}` mends it from what lies beside it")


def _wrong(lake: Lake, known: list[dict[str, Any]]) -> str | None:
    size = lake.catalog.stat().st_size
    if size not in (one["size"] for one in known):
        return f"has {size} bytes where {known[0]['size'] if known else 0} were written"
    if size <= WHOLE and sums_of_file(lake.catalog) not in known:
        return "holds other bytes than were written"
    return None


def catalog_written(lake: Lake) -> None:
    """This process has written the catalog that is served: it need not be compared."""
    _checked[lake.catalog] = _identity(lake)


def _identity(lake: Lake) -> tuple[int, ...]:
    found = lake.catalog.stat()
    return found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns


_checked: Final[dict[Path, tuple[int, ...]]] = {}
