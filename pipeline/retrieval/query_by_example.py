"""Query by example on a lake: a range of one of its clips, or of a clip file, looked for inside every clip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from motionlake.arrays import Float64Array, Int64Array
from motionlake.deep_motifs.emd import emd_many
from motionlake.deep_motifs.query_by_example import LEAST_WORDS, ExampleQuery, find_ranges
from motionlake.deep_motifs.signatures import Corpus, window_signatures
from motionlake.lake.catalog import open_once, reading
from motionlake.lake.corpus import read_corpus
from motionlake.lake.layout import Lake
from motionlake.lake.models import check_served
from motionlake.retrieval.encode import query_motifs
from motionlake.retrieval.hits import Hit, range_hit
from motionlake.retrieval.lake_shortlist import shortlist_of
from motionlake.retrieval.large_words import LakeWords
from motionlake.retrieval.protocol import EVERYTHING, Finds, Query, Scope, check_k, not_ready
from motionlake.threads import limited


class WordsSearcher:
    """Ranges by the signatures of their words (Deep Motifs, section 6.1); a `Searcher`.

    The query needs two words at least. A clip may have several answers, which do not overlap. A lake is searched in the
    words of its shortlist, where it has one, where bounds rule most windows out (`deep_motifs.many_ranges`).

    Raises:
        UserError: the lake has no motifs yet, or a newer model than theirs.
    """

    name = "words"
    finds: Finds = "range"

    def __init__(self, lake: Lake) -> None:
        self.lake = lake
        check_served(lake, "signature")
        files = shortlist_of(lake)
        self._large = LakeWords(lake, files) if files else None
        if self._large is None:
            self.corpus  # noqa: B018 - read now, as a searcher is

    @property
    def large(self) -> LakeWords | None:
        """The words of the shortlist by which the lake is searched."""
        return self._large

    @cached_property
    def corpus(self) -> Corpus:
        """All words of the lake."""
        with reading(self.lake) as con:
            return read_corpus(con)

    def search(self, queries: Sequence[Query], k: int, scope: Scope = EVERYTHING) -> list[list[Hit]]:
        """As `Searcher.search`."""
        check_k(k)
        with open_once(self.lake), limited(1):
            return [scope.near(self._ranges(query, k, scope)) for query in queries]

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        known, found = self._large or self.corpus, np.zeros((len(queries), len(gallery)))
        places = [self._motifs(query, least=1) for query in gallery]
        for row, query in zip(found, queries, strict=True):
            example = ExampleQuery(self._motifs(query))
            signature = example.signatures(known.idf)[0]
            for column, motifs in enumerate(places):
                windows = window_signatures(motifs, known.idf, example.n_words)
                row[column] = emd_many(signature, windows, known.ground).min()
        return found

    def _ranges(self, query: Query, k: int, scope: Scope) -> list[Hit]:
        if self._large is not None:
            return self._in_many(self._large, query, k, scope)
        corpus, clip = self.corpus, query.clip
        if clip is not None and clip not in corpus.positions:
            raise not_ready(self.lake, clip, "signature")
        without = None
        if clip is not None and not scope.own:
            at = corpus.positions[clip]
            without = (at, query.start or 0, corpus.clips[at].frames if query.stop is None else query.stop)
        admits = scope.admission(self.lake)
        chosen = [i for i, known in enumerate(corpus.clips) if admits(known)]
        hits = []
        for hit in find_ranges(corpus, self._example(query, scope), k, clips=chosen, without=without):
            made = range_hit(corpus.clips[corpus.positions[hit.clip]], hit.start, hit.stop, hit.distance)
            hits.append(replace(made, mirrored=hit.mirrored))
        return hits

    def _in_many(self, large: LakeWords, query: Query, k: int, scope: Scope) -> list[Hit]:
        found = large.nearest(self._example(query, scope), query, k, scope)
        return [
            replace(range_hit(large.facts(hit.clip), hit.start, hit.stop, hit.distance), mirrored=hit.mirrored)
            for hit in found
        ]

    def rows_near(self, query: Query, count: int, scope: Scope, *, mirrored: bool) -> Int64Array:
        """The rows of so many clips of a large lake that hold what is likely to be most like a query.

        Raises:
            UserError: as `search`.
        """
        assert self._large is not None
        return self._large.rows_near(ExampleQuery(self._motifs(query, mirrored=mirrored)), count, scope)

    def _example(self, query: Query, scope: Scope) -> ExampleQuery:
        return ExampleQuery(self._motifs(query), self._motifs(query, mirrored=True) if scope.mirrored else None)

    def _motifs(self, query: Query, *, least: int = LEAST_WORDS, mirrored: bool = False) -> np.ndarray:
        if self._large is not None and query.clip is not None and not mirrored:
            found = self._large.motifs_of(query)
            if len(found) >= least:
                return found
        with reading(self.lake) as con:
            return query_motifs(con, self.lake, query, least=least, mirrored=mirrored)
