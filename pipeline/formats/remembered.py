"""Answers about files that hold until the file changes."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final, Generic, TypeVar

T = TypeVar("T")
# File systems stamp changes by a clock that may tick as slowly as this: what changed just now could change
# again under the same stamp.
SETTLED_NS: Final = 2_000_000_000


class Remembered(Generic[T]):
    """A function of a path that is called again only when the file or folder there has changed.

    A change shows in device, inode, size, and times of modification and status change. The last `size` answers are
    kept, but none for what changed less than 2 s ago, and no exceptions.
    """

    def __init__(self, function: Callable[[Path], T], size: int) -> None:
        self._function = function
        self._cached = functools.lru_cache(maxsize=size)(self._call)

    def __call__(self, path: Path) -> T:
        """The function's answer; `OSError` where there is nothing at the path."""
        stat = path.stat()
        if time.time_ns() - max(stat.st_mtime_ns, stat.st_ctime_ns) < SETTLED_NS:
            return self._function(path)
        return self._cached(path, (stat.st_dev, stat.st_ino, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns))

    def _call(self, path: Path, state: tuple[int, ...]) -> T:
        del state
        return self._function(path)
