"""Whole clips by strided temporal alignment of their strings of postures, both ways (PESTA, section 6)."""

from __future__ import annotations

from collections.abc import Sequence

from motionlake.lake.catalog import Connection
from motionlake.lake.layout import Lake
from motionlake.retrieval.aligner import Aligner
from motionlake.retrieval.protocol import Query
from motionlake.retrieval.search import Hit


class AlignmentRetriever:
    """Retrieval by alignment; a `Retriever`. Distances are costs for each symbol of the query.

    Args:
        con: to the lake.
        lake: which holds the dictionary and the configuration.
        threads: which share a scan.
        real: synthetic clips are no answers.

    Raises:
        UserError: the lake has no symbol strings yet.
    """

    method = "alignment"

    def __init__(self, con: Connection, lake: Lake, *, threads: int = 1, real: bool = False) -> None:
        self._aligner = Aligner(con, lake, threads=threads, real=real)

    def search(self, queries: Sequence[Query], k: int, dataset: str | None = None) -> list[list[Hit]]:
        """As `Retriever.search`."""
        return [
            [
                Hit(hit.rank, hit.clip, hit.cost, hit.label, hit.dataset, hit.seconds)
                for hit in self._aligner.whole(query, k, dataset=dataset)
            ]
            for query in queries
        ]
