"""Threads: on how many linear algebra runs, and some that stay to share work out to."""

from __future__ import annotations

import os
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager
from functools import cache, lru_cache
from threading import Lock, local
from typing import Final, TypeVar

from threadpoolctl import ThreadpoolController

Part = TypeVar("Part")
Found = TypeVar("Found")
_own: Final = local()


@contextmanager
def limited(count: int) -> Iterator[None]:
    """Within the block, the libraries of linear algebra that are loaded by now run on so many threads.

    Blocks of several threads may overlap: libraries get their own number back when the last one ends.
    """
    with _limits_lock:
        held = _limits.setdefault(count, _Limits())
        held.blocks += 1
        held.extend(count)
    try:
        yield
    finally:
        with _limits_lock:
            held.blocks -= 1
            if not held.blocks:
                del _limits[count]
                held.within.close()


class _Limits:
    """What blocks of one number of threads have limited."""

    def __init__(self) -> None:
        self.blocks, self.within = 0, ExitStack()
        self._seen: ThreadpoolController | None = None

    def extend(self, count: int) -> None:
        """Limit what was loaded since. To look for it takes milliseconds, more than the work of a clip, so it is done
        again only where modules were imported since."""
        found = _libraries(len(sys.modules))
        if found is not self._seen:
            self._seen = found
            self.within.enter_context(found.limit(limits=count))


_limits: Final[dict[int, _Limits]] = {}
_limits_lock: Final = Lock()


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
    left, found, raised = deque(range(len(parts))), dict[int, Found](), dict[int, Exception]()

    def share() -> None:
        _own.shares = True
        try:
            while True:
                try:
                    number = left.popleft()
                except IndexError:
                    return
                try:
                    found[number] = work(parts[number])
                except Exception as error:
                    raised[number] = error
        finally:
            _own.shares = False

    others = [_kept(os.getpid()).submit(share) for _ in range(min(len(parts), threads) - 1)]
    try:
        share()
    finally:
        left.clear()  # who interrupts this thread wants no more of it done
        wait([other for other in others if not other.cancel()])
    if raised:
        raise raised[min(raised)]
    return [found[number] for number in range(len(parts))]


@cache
def _kept(_process: int) -> ThreadPoolExecutor:
    """Of this process: one that was forked has none of its parent's threads."""
    return ThreadPoolExecutor(os.cpu_count() or 1, "shared")
