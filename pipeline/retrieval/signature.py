"""Whole clips by the earth mover's distance of their signatures (Deep Motifs, section 4.3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.deep_motifs.emd import check_model, check_signature, emd_many, ground_distances
from motionlake.deep_motifs.emd_search import SignatureIndex
from motionlake.deep_motifs.signatures import motif_counts, tf_idf
from motionlake.errors import UserError
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.corpus import read_signatures
from motionlake.lake.layout import Lake
from motionlake.retrieval.hits import Hit, clip_hit, nearer_of_both, ranked
from motionlake.retrieval.protocol import EVERYTHING, LakeSearcher, Query, Scope, not_ready
from numpy.typing import NDArray


def signature_of(lake: Lake, query: Query, idf: Float64Array, *, mirrored: bool = False) -> NDArray[np.float32]:
    """[K] of a file, of a range, or of a clip mirrored, over motifs with `idf` [K].

    Raises:
        UserError: no such clip or file, no signature yet, or a range that is too short.
    """
    if query.clip is not None and query.whole:
        with reading(lake) as con:
            kept = fetch(con, "mirrored_signature", {"clip": query.clip}) if mirrored else []
        if not kept:
            raise not_ready(lake, query.clip, "mirrored signature" if mirrored else "signature")
        return np.array(kept[0]["signature"], dtype=np.float32)
    from motionlake.retrieval.encode import query_motifs

    with reading(lake) as con:
        found = query_motifs(con, lake, query, mirrored=mirrored)
    return tf_idf(motif_counts(found, len(idf)), idf)


class SignatureSearcher(LakeSearcher):
    """Search by signature; a `Searcher`. The signatures of the lake are read once.

    Attributes:
        clips: n, by name.
        signatures: [n, K], theirs.
        ground: [K, K] distances of the motifs.

    Raises:
        UserError: the lake has no motifs yet.
    """

    name = "signature"
    compares = ("signature",)
    finds = "clip"

    def __init__(self, lake: Lake) -> None:
        super().__init__(lake)
        with reading(lake) as con:
            motifs, self.clips, self.signatures = read_signatures(con)
        if not motifs:
            raise UserError(f"{lake.root}: has no motifs yet; make them with `motionlake run all`")
        self.ground = ground_distances(np.array([row["centroid"] for row in motifs], dtype=np.float32))
        self._idf = np.array([row["idf"] for row in motifs], dtype=np.float64)
        self.strength = np.array([row["strength"] for row in motifs], dtype=np.float64)
        self._rows = {clip.clip: row for row, clip in enumerate(self.clips)}
        self._index = SignatureIndex.build(self.signatures, self.ground, motifs[0]["model"])

    def signature(self, query: Query, *, mirrored: bool = False) -> NDArray[np.float32]:
        """[K] of a clip of the lake, of a clip file, or of a range of either.

        Raises:
            UserError: no such clip or file, no signature yet, or a range that is too short.
        """
        if query.clip in self._rows and query.whole and not mirrored:
            return np.asarray(self.signatures[self._rows[query.clip]])
        return signature_of(self.lake, query, self._idf, mirrored=mirrored)

    def like(
        self,
        signature: Sequence[float] | NDArray[np.floating],
        k: int,
        scope: Scope = EVERYTHING,
        *,
        mirrored: Sequence[float] | None = None,
        without: str | None = None,
        model: str | None = None,
    ) -> list[Hit]:
        """The k clips nearest to any signature [K] over the motifs of the lake.

        Args:
            signature: of the query.
            k: how many at most.
            scope: which clips may be answers.
            mirrored: [K] signature of its mirror image: the nearer of both counts.
            without: a clip that is no answer.
            model: name of the motifs that it was made with, where it is known.

        Raises:
            UserError: a signature over other motifs.
        """
        try:
            check_model(model, self._index.model)
            sides = [self._like(check_signature(side, len(self.ground)), k, scope, without)
                     for side in (signature, mirrored) if side is not None]  # fmt: skip
        except ValueError as error:
            raise UserError(f"{error} (`SignatureSearcher.signature` makes one that fits)") from error
        return ranked(sides[0]) if mirrored is None else nearer_of_both(sides[0], sides[1], k)

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        known = np.array([self.signature(query) for query in gallery])
        found = [emd_many(self.signature(query), known, self.ground) for query in queries]
        return np.array(found, dtype=np.float64).reshape(len(queries), len(gallery))

    def nearest(self, queries: Sequence[Query], k: int, scope: Scope, *, mirrored: bool) -> list[list[Hit]]:
        return [self._like(self.signature(query, mirrored=mirrored), k, scope, query.clip) for query in queries]

    def _like(self, signature: NDArray[np.floating], k: int, scope: Scope, without: str | None) -> list[Hit]:
        chosen = scope.chosen(self.lake, self.clips, without)
        if not k or not len(chosen):
            return []
        found = self._index.nearest(signature, k, chosen)
        rows = zip(found.indices.tolist(), found.distances.tolist(), strict=True)
        return [clip_hit(self.clips[i], distance) for i, distance in rows]
