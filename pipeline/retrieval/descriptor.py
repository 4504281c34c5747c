"""Whole clips by the Euclidean distance of their descriptors (DeepHuMS, section 3.2)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.deephums.config import DIMENSION
from motionlake.deephums.scans import scan_of
from motionlake.errors import UserError
from motionlake.lake.catalog import reading
from motionlake.lake.corpus import read_descriptors
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.retrieval.encode import query_motion
from motionlake.retrieval.hits import Hit, clip_hit
from motionlake.retrieval.protocol import ClipFilter, LakeSearcher, Query, Scope, about, not_ready
from motionlake.stages.descriptors import DESCRIPTORS

if TYPE_CHECKING:
    from motionlake.deephums.exact import ExactScan
    from motionlake.deephums.nearest import DescriptorScan, QuickIndex
    from motionlake.deephums.network import TrainedDescriptor


class DescriptorSearcher(LakeSearcher):
    """Search by descriptor; a `Searcher`. The descriptors of the lake are read once.

    Args:
        lake: which holds the network for files.
        quick: for a program that makes many single queries: an index is built at the first; answers are the same.

    Attributes:
        clips: n, by name.
        descriptors: [n, 512] float32, theirs.

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
            self.clips, self.descriptors = read_descriptors(con)
        self._file, self._quick = network.file, quick
        self._rows = {clip.clip: row for row, clip in enumerate(self.clips)}
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
            if query.clip is not None and query.clip not in self._rows:
                raise not_ready(self.lake, query.clip, "descriptor")
            if at not in made:
                found[at] = self.descriptors[self._rows[str(query.source)]]
        return found

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        from scipy.spatial.distance import cdist

        return np.asarray(cdist(self.embed(queries), self.embed(gallery)), dtype=np.float64)

    def nearest(self, queries: Sequence[Query], k: int, scope: Scope, *, mirrored: bool) -> list[list[Hit]]:
        """All queries are compared at once."""
        vectors = self.embed(queries, mirrored=mirrored)
        kept = scope.clips
        chosen, scan = self._scan(kept)
        quick = self._quick and len(queries) == 1 and len(chosen)
        found = self._index(kept).nearest(vectors[0], k + 1) if quick else scan.nearest(vectors, k + 1)
        answers = []
        for query, rows, distances in zip(queries, chosen[found.indices], found.distances, strict=True):
            near = zip(rows.tolist(), distances.tolist(), strict=True)
            hits = [clip_hit(self.clips[row], distance) for row, distance in near]
            answers.append([hit for hit in hits if scope.own or hit.clip != query.clip][:k])
        return answers

    def _new_scan(self, kept: ClipFilter) -> tuple[Int64Array, ExactScan | DescriptorScan]:
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

        motion = query_motion(self.lake, query, mirrored=mirrored)
        with about(query.name):
            return clip_sequence(motion.cut()[0], motion.fps)
