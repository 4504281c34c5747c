"""Models that a process has read from the files of a lake: each of them once, however many shards need it."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake

T = TypeVar("T")
KEPT = 8  # models


def loaded(load: Callable[[Path], T], lake: Lake, file: str) -> T:
    """What `load` makes of a file of the lake; whoever gets it does not change it.

    Raises:
        DamagedError: the file is not as it was written.
    """
    path = sound(lake, file)
    found = path.stat()
    model: T = _loaded(load, path, (found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns))
    return model


@lru_cache(maxsize=KEPT)
def _loaded(load: Callable[[Path], T], path: Path, _identity: tuple[int, ...]) -> T:
    return load(path)
