"""Threads: on how many linear algebra runs, and some that stay to share work out to."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import AbstractContextManager
from functools import cache, lru_cache
from itertools import count
from threading import local
from typing import Final, TypeVar

from threadpoolctl import ThreadpoolController

Part = TypeVar("Part")
Found = TypeVar("Found")
_own: Final = local()


def limited(count: int) -> AbstractContextManager[object]:
    """Within the block, the libraries of linear algebra that are loaded by now run on so many threads.

    To look for them takes milliseconds, more than the work of a clip, so it is done again only where modules were
    imported since.
    """
    within: AbstractContextManager[object] = _libraries(len(sys.modules)).limit(limits=count)
    return within


@lru_cache(maxsize=1)
def _libraries(_modules: int) -> ThreadpoolController:
    return ThreadpoolController()


def in_threads(work: Callable[[Part], Found], parts: Sequence[Part], threads: int) -> list[Found]:
    """What some work finds of each part, in their order: by so many threads at most, this one among them.

    The others stay for the next work, since to start some takes as long as small work does. Where these are busy, this
    one does what is left; within work that is shared it does all.

    Raises:
        Exception: what the work raises, of the first such part.
    """
    if min(len(parts), threads) <= 1 or getattr(_own, "shares", False):
        return [work(part) for part in parts]
    numbers, found, raised = count(), dict[int, Found](), dict[int, Exception]()

    def share() -> None:
        _own.shares = True
        try:
            while (number := next(numbers)) < len(parts):  # to count takes one step: no two threads get a number
                try:
                    found[number] = work(parts[number])
                except Exception as error:
                    raised[number] = error
        finally:
            _own.shares = False

    others = [_kept(os.getpid()).submit(share) for _ in range(min(len(parts), threads) - 1)]
    share()
    wait([other for other in others if not other.cancel()])
    if raised:
        raise raised[min(raised)]
    return [found[number] for number in range(len(parts))]


@cache
def _kept(_process: int) -> ThreadPoolExecutor:
    """Of this process: one that was forked has none of its parent's threads."""
    return ThreadPoolExecutor(os.cpu_count() or 1, "shared")
