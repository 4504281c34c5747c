"""The clip files below a folder, as one look at each tells, and what they hold."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Sequence
from operator import attrgetter
from pathlib import Path
from typing import Final, NamedTuple

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


def scan(root: Path, lake: Lake) -> Iterator[SourceFile]:
    """Every clip file below a folder (or the one file), sorted by path; hidden files and the lake are left out."""
    if root.is_file():
        yield _source_file(root, root.name, _companions(root))
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
            if ending in plain and not _is_folder(entry):
                yield _source_file(entry, relative + name)
            elif _is_folder(entry):
                if not entry.is_symlink() and not (name == own.name and Path(entry.path) == own):
                    within.append(entry.path)
            elif by_name := clip_by_name(name):
                if ending.lower() != COMPRESSED_SUFFIX:
                    plain.add(ending)
                yield _source_file(entry, relative + name)
            elif by_name is None and is_clip(path := Path(entry.path)):
                yield _source_file(entry, relative + name, _companions(path))
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


def _source_file(file: Path | os.DirEntry[str], relative: str, more: Sequence[Path] = ()) -> SourceFile:
    try:
        own = file.stat()
        size, newest = own.st_size, own.st_mtime_ns
        if more:
            stats = [companion.stat() for companion in more]
            size, newest = size + sum(one.st_size for one in stats), max(newest, *(one.st_mtime_ns for one in stats))
    except OSError:  # a link to nothing: the reader says so, and the file is rejected
        return SourceFile(kept(relative), 0, 0)
    return SourceFile(kept(relative), size, newest if newest < LATEST else LATEST)


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
