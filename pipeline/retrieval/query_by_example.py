"""Query by example on a lake: a range of one of its clips, or of a clip file, looked for inside every clip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.deep_motifs.emd import emd_many
from motionlake.deep_motifs.query_by_example import LEAST_WORDS, ExampleQuery, find_ranges
from motionlake.deep_motifs.signatures import window_signatures
from motionlake.lake.catalog import reading
from motionlake.lake.corpus import read_corpus
from motionlake.lake.layout import Lake
from motionlake.lake.models import check_served
from motionlake.retrieval.encode import query_motifs
from motionlake.retrieval.hits import Hit, range_hit
from motionlake.retrieval.protocol import EVERYTHING, Finds, Query, Scope, check_k, not_ready


class WordsSearcher:
    """Ranges by the signatures of their words (Deep Motifs, section 6.1); a `Searcher`.

    The query needs two words at least. A clip may have several answers, which do not overlap.

    Raises:
        UserError: the lake has no motifs yet, or a newer model than theirs.
    """

    name = "words"
    finds: Finds = "range"

    def __init__(self, lake: Lake) -> None:
        self.lake = lake
        with reading(lake) as con:
            check_served(con, lake, "signature")
            self.corpus = read_corpus(con)

    def search(self, queries: Sequence[Query], k: int, scope: Scope = EVERYTHING) -> list[list[Hit]]:
        """As `Searcher.search`."""
        check_k(k)
        return [scope.near(self._ranges(query, k, scope)) for query in queries]

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        corpus, found = self.corpus, np.zeros((len(queries), len(gallery)))
        places = [self._motifs(query, least=1) for query in gallery]
        for row, query in zip(found, queries, strict=True):
            example = ExampleQuery(self._motifs(query))
            signature = example.signatures(corpus.idf)[0]
            for column, motifs in enumerate(places):
                windows = window_signatures(motifs, corpus.idf, example.n_words)
                row[column] = emd_many(signature, windows, corpus.ground).min()
        return found

    def _ranges(self, query: Query, k: int, scope: Scope) -> list[Hit]:
        corpus, clip = self.corpus, query.clip
        if clip is not None and clip not in corpus.positions:
            raise not_ready(self.lake, clip, "signature")
        example = ExampleQuery(self._motifs(query), self._motifs(query, mirrored=True) if scope.mirrored else None)
        without = None
        if clip is not None and not scope.own:
            at = corpus.positions[clip]
            without = (at, query.start or 0, corpus.clips[at].frames if query.stop is None else query.stop)
        admits = scope.admission(self.lake)
        chosen = [i for i, known in enumerate(corpus.clips) if admits(known)]
        hits = []
        for hit in find_ranges(corpus, example, k, clips=chosen, without=without):
            made = range_hit(corpus.clips[corpus.positions[hit.clip]], hit.start, hit.stop, hit.distance)
            hits.append(replace(made, mirrored=hit.mirrored))
        return hits

    def _motifs(self, query: Query, *, least: int = LEAST_WORDS, mirrored: bool = False) -> np.ndarray:
        with reading(self.lake) as con:
            return query_motifs(con, self.lake, query, least=least, mirrored=mirrored)
