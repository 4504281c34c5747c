"""Whole clips by the Euclidean distance of their descriptors (DeepHuMS, section 3.2)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, cached_property
from typing import TYPE_CHECKING, Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.deep_motifs.signatures import CorpusClip
from motionlake.deephums.config import DIMENSION
from motionlake.deephums.exact import nearest_of
from motionlake.deephums.scans import PatientScan, scan_of
from motionlake.errors import UserError
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.corpus import read_descriptors, read_descriptors_near
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.retrieval.encode import query_motion
from motionlake.retrieval.hits import Hit, clip_hit
from motionlake.retrieval.protocol import ClipFilter, LakeSearcher, Query, Scope, about, not_ready
from motionlake.stages.descriptors import DESCRIPTORS
from motionlake.stages.shortlist_files import WHOLE

if TYPE_CHECKING:
    from motionlake.deephums.exact import ExactScan
    from motionlake.deephums.nearest import QuickIndex
    from motionlake.deephums.network import TrainedDescriptor

FEW: Final = 3  # queries that the catalog answers before all descriptors are read
SPARE: Final = 32  # clips that it finds beyond those that are asked for


class DescriptorSearcher(LakeSearcher):
    """Search by descriptor; a `Searcher`. The descriptors of the lake are read once.

    In a lake of more than `WHOLE` clips the catalog itself answers the first few queries, in less time than to read
    them takes; the answers are the same.

    Args:
        lake: which holds the network for files.
        quick: for a program that makes many single queries: an index is built at the first; answers are the same.

    Raises:
        UserError: the lake has no descriptors yet.
    """

    name = "descriptor"
    compares = ("descriptor",)
    finds = "clip"

    def __init__(self, lake: Lake, *, quick: bool = False) -> None:
        super().__init__(lake)
        with reading(lake) as con:
            network = DESCRIPTORS.served(con)
            if network is None:
                raise UserError(f"{lake.root}: has no descriptors yet; make them with `motionlake run all`")
            (count,) = fetch(con, "count_clips")
        self._file, self._quick = network.file, quick
        self._by_catalog = FEW if count["clips"] > WHOLE else 0  # queries that it may still answer
        if not self._by_catalog:
            self._all  # noqa: B018 - read now, as a searcher is
        self._scan, self._index = cache(self._new_scan), cache(self._new_index)

    def embed(self, queries: Sequence[Query], *, mirrored: bool = False) -> Float32Array:
        """[m, 512] descriptors of clips of the lake, of clip files and of ranges of either.

        Raises:
            UserError: a clip without a descriptor, or a file or a range that cannot be read.
        """
        found = np.empty((len(queries), DIMENSION), dtype=np.float32)
        made = [at for at, query in enumerate(queries) if mirrored or query.clip is None or not query.whole]
        if made:
            found[made] = self._network.embed([self._sequence(queries[at], mirrored) for at in made])
        for at, query in enumerate(queries):
            if query.clip is not None:
                known = self._known(query.clip)
                found[at] = found[at] if at in made else known
        return found

    def _known(self, clip: str) -> Float32Array:
        """[512] of a clip of the lake."""
        if self._by_catalog:
            with reading(self.lake) as con:
                rows = fetch(con, "descriptor_of", {"clip": clip})
            if rows:
                return np.array(rows[0]["descriptor"], dtype=np.float32)
        elif clip in self._rows:
            return np.asarray(self.descriptors[self._rows[clip]])
        raise not_ready(self.lake, clip, "descriptor")

    @property
    def clips(self) -> list[CorpusClip]:
        """n, by name."""
        return self._all[0]

    @property
    def descriptors(self) -> Float32Array:
        """[n, 512] of these."""
        return self._all[1]

    @cached_property
    def _all(self) -> tuple[list[CorpusClip], Float32Array]:
        with reading(self.lake) as con:
            return read_descriptors(con)

    @cached_property
    def _rows(self) -> dict[str, int]:
        return {clip.clip: row for row, clip in enumerate(self.clips)}

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        from scipy.spatial.distance import cdist

        return np.asarray(cdist(self.embed(queries), self.embed(gallery)), dtype=np.float64)

    def nearest(self, queries: Sequence[Query], k: int, scope: Scope, *, mirrored: bool) -> list[list[Hit]]:
        """All queries are compared at once."""
        vectors = self.embed(queries, mirrored=mirrored)
        kept = scope.clips
        if self._by_catalog >= len(queries):
            self._by_catalog -= len(queries)
            by_catalog = [self._near(vector, k + 1, kept) for vector in vectors]
            return [_others(hits, query, k, scope) for hits, query in zip(by_catalog, queries, strict=True)]
        self._by_catalog = 0  # they are read now
        chosen, scan = self._scan(kept)
        quick = self._quick and len(queries) == 1 and len(chosen)
        found = self._index(kept).nearest(vectors[0], k + 1) if quick else scan.nearest(vectors, k + 1)
        answers = []
        for query, rows, distances in zip(queries, chosen[found.indices], found.distances, strict=True):
            near = zip(rows.tolist(), distances.tolist(), strict=True)
            hits = [clip_hit(self.clips[row], distance) for row, distance in near]
            answers.append(_others(hits, query, k, scope))
        return answers

    def _near(self, vector: Float32Array, k: int, kept: ClipFilter) -> list[Hit]:
        """The k clips nearest to a descriptor, of which the catalog finds some more, for it rounds distances."""
        with reading(self.lake) as con:
            clips, vectors = read_descriptors_near(con, vector, k + SPARE, kept.as_parameters(con))
        rows, distances = nearest_of(vectors, np.arange(len(clips)), vector, min(k, len(clips)))
        return [clip_hit(clips[row], distance) for row, distance in zip(rows.tolist(), distances.tolist(), strict=True)]

    def _new_scan(self, kept: ClipFilter) -> tuple[Int64Array, ExactScan | PatientScan]:
        """The rows of the clips that may be answers, and a scan of them."""
        admits = kept.admission(self.lake)
        rows = np.array([row for row, clip in enumerate(self.clips) if admits(clip)], dtype=np.int64)
        return rows, scan_of(self.descriptors[rows])

    def _new_index(self, kept: ClipFilter) -> QuickIndex:
        from motionlake.deephums.nearest import QuickIndex

        return QuickIndex.build(self.descriptors[self._scan(kept)[0]])

    @cached_property
    def _network(self) -> TrainedDescriptor:
        from motionlake.deephums.network import load_descriptor

        return load_descriptor(sound(self.lake, self._file))

    def _sequence(self, query: Query, mirrored: bool) -> Float32Array:
        from motionlake.deephums.sequence import clip_sequence

        motion = query_motion(self.lake, query, mirrored=mirrored, rotations=False)
        with about(query.name):
            return clip_sequence(motion.cut()[0], motion.fps)


def _others(hits: Sequence[Hit], query: Query, k: int, scope: Scope) -> list[Hit]:
    """The first k, without the query's own clip where that is no answer."""
    return [hit for hit in hits if scope.own or hit.clip != query.clip][:k]
