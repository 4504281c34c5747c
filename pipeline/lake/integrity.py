"""What lies on disk against what was written: size and hashes of every file of a lake, checked before it is read.

The catalog lists every file that the manifest or models name. A process compares the bytes of a file with that list
when it first reads it, and again when the file was touched since. Workers open no catalog: their shard brings the list.

Of a lake in a bucket a copy may lack files (`lacking`): they are fetched before they are first read.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from pathlib import Path
from typing import Final, TypeVar

from motionlake.errors import DamagedError
from motionlake.lake.catalog import Connection, remember, remembered
from motionlake.lake.file_list import FileSums, Listed, ListedFiles, blocks, listed_in, sums_of
from motionlake.lake.layout import Lake
from motionlake.threads import in_threads

Found = TypeVar("Found")
OTHER_BYTES: Final = "holds other bytes than were written"
_TOGETHER: Final = 1 << 26  # bytes from which on several threads compare them sooner than one
WHOLE: Final = 1 << 30  # bytes of a folder up to which all of them are compared before SQL reads it: a quarter second


Fetch = Callable[[Sequence[FileSums]], None]  # puts files where they belong, or raises `UserError`


def fetched_by(lake: Lake, fetch: Fetch | None) -> None:
    """Have missing files of a lake fetched when this process first reads them; None: no longer."""
    if fetch is None:
        _fetches.pop(lake.root, None)
    else:
        _fetches[lake.root] = fetch


def lacking(lake: Lake, wanted: Iterable[FileSums]) -> list[FileSums]:
    """Those of some files that are missing and can be fetched."""
    return [file for file in wanted if not lake.path(file.file).exists()] if lake.root in _fetches else []


def bring(lake: Lake, wanted: Iterable[FileSums]) -> None:
    """Fetch what is `lacking` of some files.

    Raises:
        UserError: it cannot be fetched.
    """
    files = lacking(lake, wanted)
    if files:
        _fetches[lake.root](files)


def stat_fault(lake: Lake, wanted: FileSums) -> str | None:
    """What is wrong with a file, as far as one look at its folder's entry tells; nothing where it can be fetched."""
    return _stat_fault(lake, wanted, next(lake.stats([wanted.file])))


def _stat_fault(lake: Lake, wanted: FileSums, seen: os.stat_result | None) -> str | None:
    if seen is None:
        return None if lake.root in _fetches else "is missing"
    return None if seen.st_size == wanted.size else _other_size(seen.st_size, wanted)


def size_fault(lake: Lake, file: str) -> str | None:
    """The same of a file of the catalog that serves now, by its name; one that is lacking is fetched."""
    listed = _readable(lake)
    if file not in listed:
        return "is not listed in the catalog"
    bring(lake, [listed[file]])
    return stat_fault(lake, listed[file])


def fault(lake: Lake, wanted: FileSums) -> str | None:
    """What is wrong with a file, by all of its bytes; remembered while nobody touches it."""
    bring(lake, [wanted])
    return _fault_at(lake.path(wanted.file), wanted)


def _fault_at(path: Path, wanted: FileSums) -> str | None:
    try:
        found = path.stat()
        identity = (found.st_ino, found.st_mtime_ns, found.st_ctime_ns, wanted.crc32)
        if found.st_size != wanted.size:
            return _other_size(found.st_size, wanted)
        if _checked.get(path) == identity:
            return None
        with path.open("rb", buffering=0) as handle:
            crc = 0
            for block in blocks(handle):
                crc = zlib.crc32(block, crc)
    except FileNotFoundError:
        return "is missing"
    if crc != wanted.crc32:
        return OTHER_BYTES
    _checked[path] = identity
    return None


def _fault_among(listed: Listed, name: str, path: Path) -> str | None:
    return _fault_at(path, listed[name]) if name in listed else "is not listed in the catalog"


def _other_size(size: int, wanted: FileSums) -> str:
    return f"has {size} bytes where {wanted.size} were written"


def deep_fault(lake: Lake, wanted: FileSums) -> str | None:
    """What is wrong with a file, by the sha256 of its bytes, read anew."""
    bring(lake, [wanted])
    wrong = stat_fault(lake, wanted)
    if wrong is None and sums_of(lake, wanted.file).sha256 != wanted.sha256:
        return OTHER_BYTES
    return wrong


def touched_faults(lake: Lake, wanted: Iterable[FileSums]) -> list[tuple[FileSums, str]]:
    """Files that are missing, have another size, or were touched and hold other bytes: one look at each entry.

    Of those that can be fetched nothing is wrong.
    """
    files = list(wanted)
    away = {file.file for file in lacking(lake, files)}
    there = [file for file in files if file.file not in away]
    found = []
    for file, seen in zip(there, lake.stats([file.file for file in there]), strict=True):
        wrong = _stat_fault(lake, file, seen)
        if wrong is None and seen is not None and seen.st_mtime_ns != file.mtime_ns:
            wrong = fault(lake, file)
        if wrong is not None:
            found.append((file, wrong))
    return found


def faults_of_now(lake: Lake) -> list[tuple[FileSums, str]]:
    """`touched_faults` of every file that the catalog lists which this process reads now."""
    listed = _listed(lake)
    return touched_faults(lake, listed.touched(lake.stats(list(listed))))


def check_files(lake: Lake) -> None:
    """One look at every file of a lake, before work starts from them.

    Raises:
        DamagedError: some are missing, have another size, or were touched and hold other bytes.
    """
    faults = faults_of_now(lake)
    if faults:
        more = f", and {len(faults) - 1} files more are damaged or missing" if len(faults) > 1 else ""
        raise DamagedError(damage(lake, faults[0][0].file, faults[0][1] + more))


def sound(lake: Lake, file: str) -> Path:
    """The path of a file that is as it was written.

    Raises:
        DamagedError: it is not, or the catalog does not list it.
    """
    return sound_files(lake, [file])[0]


def sound_files(lake: Lake, files: Iterable[str]) -> list[Path]:
    """The paths of files that are all as they were written. Raises `DamagedError` for the first that is not."""
    names, listed = list(files), _readable(lake)
    paths = lake.paths(names)
    bring(lake, [listed[name] for name in names if name in listed])

    wrong_with = partial(_fault_among, listed)
    if sum(listed[name].size for name in names if name in listed) < _TOGETHER:
        faults = list(map(wrong_with, names, paths))
    else:
        with ThreadPoolExecutor(min(4, os.cpu_count() or 1)) as pool:  # checksums are worked out without the GIL
            faults = list(pool.map(wrong_with, names, paths))
    for name, wrong in zip(names, faults, strict=True):
        if wrong is not None:
            raise DamagedError(damage(lake, name, wrong))
    return paths


def sound_while(lake: Lake, file: str, read: Callable[[Path], Found]) -> Found:
    """What is read of a file, of one that is as it was written: another thread compares its bytes meanwhile.

    Raises:
        DamagedError: as `sound`.
        Exception: what reading raises.
    """
    listed, path = _readable(lake), lake.path(file)
    bring(lake, [listed[file]] if file in listed else [])

    def compare() -> None:
        if (wrong := _fault_among(listed, file, path)) is not None:
            raise DamagedError(damage(lake, file, wrong))

    found: list[Found] = []

    def run(work: Callable[[], None]) -> None:
        work()

    in_threads(run, [compare, lambda: found.append(read(path))], 2)  # of two that fail the first is told
    return found[0]


def sized_files(lake: Lake, files: Iterable[str]) -> list[Path]:
    """The paths of files that hold checksums of their own; of these the sizes alone are compared.

    Raises:
        DamagedError: for the first that has another size, or is missing or not listed.
    """
    names, listed = list(files), _readable(lake)
    if unlisted := next((name for name in names if name not in listed), None):
        raise DamagedError(damage(lake, unlisted, "is not listed in the catalog"))
    wanted = [listed[name] for name in names]
    bring(lake, wanted)
    for file, seen in zip(wanted, lake.stats(names), strict=True):
        if (wrong := _stat_fault(lake, file, seen)) is not None:
            raise DamagedError(damage(lake, file.file, wrong))
    return lake.paths(names)


def sound_folder(lake: Lake, folder: str) -> list[Path]:
    """The paths of all files below a folder that the catalog lists.

    A query may read little of a large folder: above `WHOLE` bytes, only files that were touched are compared.

    Raises:
        DamagedError: as `sound_files`.
    """
    found = {name: file for name, file in _listed(lake).items() if name.startswith(f"{folder}/")}
    if sum(file.size for file in found.values()) <= WHOLE:
        return sound_files(lake, found)
    bring(lake, found.values())
    for file, wrong in touched_faults(lake, found.values())[:1]:
        raise DamagedError(damage(lake, file.file, wrong))
    return [lake.path(name) for name in found]


def know(lake: Lake, con: Connection) -> None:
    """Take the list of files from a connection to the catalog that this thread reads now."""
    remember(lake, "files", listed_in(con))


def is_listed(lake: Lake, file: str) -> bool:
    """Whether a file has been made, as the catalog says."""
    return file in _listed(lake)


def damage(lake: Lake, file: str, wrong: str) -> str:
    """The line that tells a person of a damaged file, and what to do."""
    if wrong == "is missing" and (lake.root / "bucket.json").is_file():
        return f"{lake.root / file}: {wrong}; `motionlake pull --lake {lake.root}` fetches it"
    return f"{lake.root / file}: {wrong}; `{lake.mending}` mends what can be mended"


@contextmanager
def given(files: Iterable[FileSums]) -> Iterator[None]:
    """Within the block only these files are read, as they are listed here; no catalog is opened for it."""
    token = _given.set({file.file: file for file in files})
    try:
        yield
    finally:
        _given.reset(token)


def _readable(lake: Lake) -> Listed:
    """The files that may be read here: those that were `given`, else those that are listed."""
    given_here = _given.get()
    return _listed(lake) if given_here is None else given_here


def _listed(lake: Lake) -> ListedFiles:
    """What the catalog that this thread reads now lists."""
    return remembered(lake, "files", listed_in)


_fetches: Final[dict[Path, Fetch]] = {}
_given: Final[ContextVar[Listed | None]] = ContextVar("given", default=None)
_checked: Final[dict[Path, tuple[int, int, int, int]]] = {}  # files whose bytes this process has compared
