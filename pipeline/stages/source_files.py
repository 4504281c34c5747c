"""The clip files below a folder, as one look at each tells, and what they hold."""

from __future__ import annotations

import hashlib
import os
from array import array
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from pathlib import Path
from typing import Final, NamedTuple, overload

from motionlake.errors import ClipError
from motionlake.formats import clip_by_name, companions, is_clip, may_have_companions
from motionlake.formats.registry import COMPRESSED_SUFFIX
from motionlake.lake.layout import Lake
from motionlake.names import kept

LATEST: Final = (1 << 63) - 1  # the last date that the catalog can hold, in 2262
_name: Final = attrgetter("name")


class SourceFile(NamedTuple):
    """A clip file found in a root: its path as the lake keeps it; `content_hash` is empty until it was needed."""

    path: str
    size: int
    mtime_ns: int
    content_hash: str = ""


@dataclass(frozen=True)
class SourceFiles(Sequence[SourceFile]):
    """Clip files by columns: of a large repository, a row a file takes longer to make than to look at the file.

    Attributes:
        paths, sizes, dates: as `SourceFile` has them, of each.
    """

    paths: list[str] = field(default_factory=list)
    sizes: array[int] = field(default_factory=lambda: array("q"))
    dates: array[int] = field(default_factory=lambda: array("q"))

    def add(self, path: str, size: int, date: int) -> None:
        """One more."""
        self.paths.append(path)
        self.sizes.append(size)
        self.dates.append(date if date < LATEST else LATEST)

    def without(self, paths: Collection[str]) -> SourceFiles:
        """All but those of some paths."""
        left = SourceFiles()
        for file in self:
            if file.path not in paths:
                left.add(*file[:3])
        return left

    def __len__(self) -> int:
        return len(self.paths)

    @overload
    def __getitem__(self, at: int) -> SourceFile: ...

    @overload
    def __getitem__(self, at: slice) -> SourceFiles: ...

    def __getitem__(self, at: int | slice) -> SourceFile | SourceFiles:
        if isinstance(at, slice):
            return SourceFiles(self.paths[at], self.sizes[at], self.dates[at])
        return SourceFile(self.paths[at], self.sizes[at], self.dates[at])


def scan(root: Path, lake: Lake) -> SourceFiles:
    """Every clip file below a folder (or the one file), sorted by path; hidden files and the lake are left out."""
    found = SourceFiles()
    add = found.add
    for relative, file, more in _files(root, lake):
        try:
            own = file.stat()
            size, newest = own.st_size, own.st_mtime_ns
            if more:
                stats = [companion.stat() for companion in more]
                size += sum(one.st_size for one in stats)
                newest = max(newest, *(one.st_mtime_ns for one in stats))
        except OSError:  # a link to nothing: the reader says so, and the file is rejected
            size = newest = 0
        add(kept(relative), size, newest)
    return found


def holds_clips(root: Path, lake: Lake) -> bool:
    """Whether there is a clip file below a folder."""
    return next(_files(root, lake), None) is not None


def _files(root: Path, lake: Lake) -> Iterator[tuple[str, Path | os.DirEntry[str], Sequence[Path]]]:
    """Of each clip file its path below the root, itself, and its companions."""
    if root.is_file():
        yield root.name, root, _companions(root)
        return
    with os.scandir(root) as found:  # a root that may not be read is told of, a folder within is not
        entries = list(found)
    start, own = len(str(root / "_")) - 1, lake.root
    folders = list[str]()
    folder = str(root)
    plain = set[str]()  # names that end so tell that a file is a clip without companions
    while True:
        relative = f"{folder[start:]}/" if len(folder) > start else ""
        within = list[str]()
        for entry in sorted(entries, key=_name):
            name = entry.name
            if name[0] == ".":
                continue
            ending = name[name.rfind(".") :]
            if _is_folder(entry):
                if not entry.is_symlink() and not (name == own.name and Path(entry.path) == own):
                    within.append(entry.path)
            elif ending in plain:
                yield relative + name, entry, ()
            elif by_name := clip_by_name(name):
                if ending.lower() != COMPRESSED_SUFFIX:
                    plain.add(ending)
                yield relative + name, entry, ()
            elif by_name is None and is_clip(path := Path(entry.path)):
                yield relative + name, entry, _companions(path)
        folders += reversed(within)
        if not folders:
            return
        folder = folders.pop()
        try:
            with os.scandir(folder) as found:
                entries = list(found)
        except OSError:
            entries = []


def _is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:
        return False


def _companions(path: Path) -> list[Path]:
    try:
        return companions(path) if may_have_companions(path) and path.is_file() else []
    except (ClipError, OSError):
        return []


def content_hash(path: Path) -> str:
    """sha256 over a clip file and its companions; over nothing where there is no regular file that opens."""
    digest = hashlib.sha256()
    for part in [path, *_companions(path)]:
        if not part.is_file():  # a pipe would never end
            continue
        try:
            with part.open("rb") as handle:
                digest.update(hashlib.file_digest(handle, "sha256").digest())
        except OSError:
            continue
    return digest.hexdigest()
