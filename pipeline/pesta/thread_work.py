"""Work on weight matrices over threads: how many of them are worth their start, and parts given out to them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Final, TypeVar

# Cells of weight matrices, some milliseconds of work: a thread that has less to do takes longer to start.
THREAD_CELLS: Final = 10_000_000
Part = TypeVar("Part")
Found = TypeVar("Found")


def useful_threads(threads: int, cells: int) -> int:
    """How many of some threads have enough to do, of so many cells of weight matrices, to be worth their start."""
    return max(1, min(threads, cells // THREAD_CELLS))


def in_threads(work: Callable[[Part], Found], parts: Sequence[Part], threads: int) -> list[Found]:
    """What some work finds of each part, in their order."""
    if min(len(parts), threads) <= 1:
        return [work(part) for part in parts]
    with ThreadPoolExecutor(min(len(parts), threads)) as pool:
        return list(pool.map(work, parts))
