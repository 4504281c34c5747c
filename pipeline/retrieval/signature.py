"""Whole clips by the earth mover's distance of their signatures (Deep Motifs, section 4.3)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.retrieval.protocol import Query
from motionlake.retrieval.search import Hit, similar_to_clip, similar_to_file


class SignatureRetriever:
    """Retrieval by signature; a `Retriever`.

    Args:
        con: with functions and macros, as `motionlake.connect` opens it.
        lake: which holds the models for files.
        mirrored: nearest to the clip or to its mirror image.
        real: synthetic clips are no answers.

    Raises:
        UserError: the lake has no motifs yet.
    """

    method = "signature"

    def __init__(self, con: Connection, lake: Lake, *, mirrored: bool = False, real: bool = False) -> None:
        if not fetch(con, "corpus_motifs"):
            raise UserError(f"{lake.root}: has no motifs yet; make them with `motionlake run all`")
        self._con, self._lake, self._mirrored, self._real = con, lake, mirrored, real

    def search(self, queries: Sequence[Query], k: int, dataset: str | None = None) -> list[list[Hit]]:
        """As `Retriever.search`."""
        return [self._answer(query, k, dataset) for query in queries]

    def _answer(self, query: Query, k: int, dataset: str | None) -> list[Hit]:
        wanted = {"mirrored": self._mirrored, "real": self._real}
        if isinstance(query, Path):
            return similar_to_file(self._con, self._lake, query, k, dataset, **wanted)
        return similar_to_clip(self._con, query, k, dataset, **wanted)
