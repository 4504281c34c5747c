"""Whole clips by the Euclidean distance of their descriptors (DeepHuMS, section 3.2)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.deep_motifs.signatures import CorpusClip
from motionlake.deephums.config import DIMENSION
from motionlake.errors import UserError
from motionlake.lake.catalog import fetch_table, reading
from motionlake.lake.layout import Lake
from motionlake.retrieval.encode import query_motion
from motionlake.retrieval.protocol import EVERYTHING, Hit, LakeSearcher, Query, Scope, clip_hit, not_ready
from motionlake.stages.descriptors import DESCRIPTORS
from numpy.typing import NDArray

if TYPE_CHECKING:
    from motionlake.deephums.nearest import DescriptorScan, QuickIndex
    from motionlake.deephums.network import TrainedDescriptor

Kept = tuple[str | None, str | None, bool]


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
    finds = "clip"

    def __init__(self, lake: Lake, *, quick: bool = False) -> None:
        super().__init__(lake)
        with reading(lake) as con:
            network = DESCRIPTORS.served(con)
            if network is None:
                raise UserError(f"{lake.root}: has no descriptors yet; make them with `motionlake run all`")
            table = fetch_table(con, "descriptor_clips")
        self._file, self._quick = network.file, quick
        self.descriptors = _matrix(table.column("descriptor"))
        self.clips = [CorpusClip(**row) for row in table.drop_columns(["descriptor"]).to_pylist()]
        self._rows = {clip.clip: row for row, clip in enumerate(self.clips)}
        self._scans: dict[Kept, tuple[Int64Array, DescriptorScan]] = {}
        self._indices: dict[Kept, QuickIndex] = {}

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

    def like(
        self, vectors: Float32Array, k: int, scope: Scope = EVERYTHING, without: Sequence[str | None] | None = None
    ) -> list[list[Hit]]:
        """The k clips nearest to each of m descriptors [m, 512] of the lake's network, in order and not ranked yet.

        Args:
            vectors: [m, 512].
            k: how many at most.
            scope: which clips may be answers.
            without: m, a clip that is no answer to each, or None.
        """
        chosen, scan = self._among(scope)
        if self._quick and len(vectors) == 1 and len(chosen):
            found = self._index(scope).nearest(vectors[0], k + 1)
        else:
            found = scan.nearest(vectors, k + 1)
        left_out = without or [None] * len(vectors)
        return [
            self._hits(chosen[rows], distances, None if scope.own else own)[:k]
            for rows, distances, own in zip(found.indices, found.distances, left_out, strict=True)
        ]

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        from scipy.spatial.distance import cdist

        return np.asarray(cdist(self.embed(queries), self.embed(gallery)), dtype=np.float64)

    def _nearest(self, queries: Sequence[Query], k: int, scope: Scope, *, mirrored: bool) -> list[list[Hit]]:
        """All queries are compared at once."""
        return self.like(self.embed(queries, mirrored=mirrored), k, scope, [query.clip for query in queries])

    def _hits(self, rows: Int64Array, distances: NDArray[np.float64], own: str | None) -> list[Hit]:
        pairs = zip(rows.tolist(), distances.tolist(), strict=True)
        return [clip_hit(self.clips[row], distance) for row, distance in pairs if self.clips[row].clip != own]

    def _among(self, scope: Scope) -> tuple[Int64Array, DescriptorScan]:
        """The rows of the clips that may be answers, and a scan of them."""
        from motionlake.deephums.nearest import DescriptorScan

        kept = (scope.dataset, scope.split, scope.recorded_only)
        if kept not in self._scans:
            rows = scope.chosen(self.clips)
            self._scans[kept] = rows, DescriptorScan(self.descriptors[rows])
        return self._scans[kept]

    def _index(self, scope: Scope) -> QuickIndex:
        from motionlake.deephums.nearest import QuickIndex

        kept = (scope.dataset, scope.split, scope.recorded_only)
        if kept not in self._indices:
            self._indices[kept] = QuickIndex.build(self.descriptors[self._among(scope)[0]])
        return self._indices[kept]

    @cached_property
    def _network(self) -> TrainedDescriptor:
        from motionlake.deephums.network import load_descriptor

        return load_descriptor(self.lake.path(self._file))

    def _sequence(self, query: Query, mirrored: bool) -> Float32Array:
        from motionlake.deephums.sequence import clip_sequence

        motion = query_motion(self.lake, query, mirrored=mirrored)
        try:
            return clip_sequence(motion.cut()[0], motion.fps)
        except ValueError as error:
            raise UserError(f"{query.name}: {error}") from error


def _matrix(column: pa.ChunkedArray) -> Float32Array:
    """[n, 512] of a column of descriptors."""
    parts = [chunk.flatten().to_numpy() for chunk in column.chunks]
    return np.concatenate([np.zeros(0, dtype=np.float32), *parts]).reshape(-1, DIMENSION)
