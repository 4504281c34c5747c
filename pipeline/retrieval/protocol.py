"""What every way to retrieve whole clips offers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol, TypeAlias

from motionlake.retrieval.search import Hit

Query: TypeAlias = str | Path  # a clip of the lake, by its full name, or a clip file


class Retriever(Protocol):
    """Answers queries by the clips of a lake.

    Attributes:
        method: its name.
    """

    @property
    def method(self) -> str: ...

    def search(self, queries: Sequence[Query], k: int, dataset: str | None = None) -> list[list[Hit]]:
        """The k clips nearest to each query, nearest first, ties by name.

        Args:
            queries: clips of the lake, themselves left out of their answers, and clip files, which need not be in the
                lake (their first body).
            k: how many at most.
            dataset: from its clips only.

        Raises:
            UserError: a clip or a file that this method cannot compare.
        """
        ...
