"""How many threads are worth their start for work on weight matrices."""

from __future__ import annotations

from typing import Final

# Cells of weight matrices, some milliseconds of work: a thread that has less to do takes longer to start.
THREAD_CELLS: Final = 10_000_000


def useful_threads(threads: int, cells: int) -> int:
    """How many of some threads have enough to do, of so many cells of weight matrices, to be worth their start."""
    return max(1, min(threads, cells // THREAD_CELLS))
