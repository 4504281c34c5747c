"""Whole clips by the Euclidean distance of their descriptors (DeepHuMS, section 3.2)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array, Int64Array
from motionlake.deephums.config import DIMENSION
from motionlake.deephums.nearest import DescriptorScan
from motionlake.deephums.quick import QuickIndex
from motionlake.deephums.sequence import clip_sequence
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch_table
from motionlake.lake.layout import Lake
from motionlake.retrieval.encode import first_body
from motionlake.retrieval.protocol import Query
from motionlake.retrieval.search import Hit
from motionlake.stages.descriptors import served_network
from numpy.typing import NDArray

if TYPE_CHECKING:
    from motionlake.deephums.trained import TrainedDescriptor


class DescriptorRetriever:
    """Retrieval by descriptor; a `Retriever`. The descriptors of the lake are read once.

    Args:
        con: to the lake.
        lake: which holds the network for files.
        real: synthetic clips are no answers.
        quick: for a program that asks many single queries: an index is built at the first; answers are the same.

    Attributes:
        clips: n, by name.
        descriptors: [n, 512] float32, theirs.

    Raises:
        UserError: the lake has no descriptors yet.
    """

    method = "descriptor"

    def __init__(self, con: Connection, lake: Lake, *, real: bool = False, quick: bool = False) -> None:
        network = served_network(con)
        if network is None:
            raise UserError(f"{lake.root}: has no descriptors yet; make them with `motionlake run all`")
        self._lake, self._file, self._quick = lake, network.file, quick
        table = fetch_table(con, "descriptor_clips")
        self.descriptors = _matrix(table.column("descriptor"))
        self._answers = [not (real and synthetic) for synthetic in table.column("synthetic").to_pylist()]
        self._known = table.drop_columns(["descriptor", "synthetic"]).to_pylist()
        self.clips = [row["clip"] for row in self._known]
        self._rows = {clip: row for row, clip in enumerate(self.clips)}
        self._scans: dict[str | None, tuple[Int64Array, DescriptorScan]] = {}
        self._indices: dict[str | None, QuickIndex] = {}

    def search(self, queries: Sequence[Query], k: int, dataset: str | None = None) -> list[list[Hit]]:
        """As `Retriever.search`; all queries are compared at once."""
        return self.nearest(
            self.embed(queries), k, dataset, without=[q if isinstance(q, str) else None for q in queries]
        )

    def embed(self, queries: Sequence[Query]) -> Float32Array:
        """[m, 512] descriptors of clips of the lake and of clip files.

        Raises:
            UserError: a clip without a descriptor, or a file that cannot be read.
        """
        found = np.empty((len(queries), DIMENSION), dtype=np.float32)
        files = [at for at, query in enumerate(queries) if isinstance(query, Path)]
        sequences = [self._sequence(Path(queries[at])) for at in files]
        if files:
            found[files] = self._network.embed(sequences)
        for at, query in enumerate(queries):
            if isinstance(query, str):
                if query not in self._rows:
                    raise UserError(f"{query}: has no descriptor yet; make it with `motionlake run all`")
                found[at] = self.descriptors[self._rows[query]]
        return found

    def nearest(
        self,
        vectors: Float32Array,
        k: int,
        dataset: str | None = None,
        without: Sequence[str | None] | None = None,
    ) -> list[list[Hit]]:
        """The k clips nearest to each of m descriptors [m, 512] of the lake's network.

        Args:
            vectors: [m, 512].
            k, dataset: as in `search`.
            without: m, a clip that is no answer to each, or None.
        """
        chosen, scan = self._among(dataset)
        if self._quick and len(vectors) == 1 and len(chosen):
            found = self._index(dataset).nearest(vectors[0], k + 1)
        else:
            found = scan.nearest(vectors, k + 1)
        left_out = without or [None] * len(vectors)
        return [
            self._hits(chosen[rows], distances, k, own)
            for rows, distances, own in zip(found.indices, found.distances, left_out, strict=True)
        ]

    def _hits(self, rows: Int64Array, distances: NDArray[np.float64], k: int, own: str | None) -> list[Hit]:
        others = [
            (self._known[row], distance)
            for row, distance in zip(rows.tolist(), distances.tolist(), strict=True)
            if self.clips[row] != own
        ]
        return [Hit(rank, distance=distance, **known) for rank, (known, distance) in enumerate(others[:k], start=1)]

    def _among(self, dataset: str | None) -> tuple[Int64Array, DescriptorScan]:
        """The rows of a dataset, or all, that may be answers, and a scan of them."""
        if dataset not in self._scans:
            rows_of = zip(self._known, self._answers, strict=True)
            chosen = [i for i, (row, answers) in enumerate(rows_of) if answers and dataset in (None, row["dataset"])]
            rows = np.array(chosen, dtype=np.int64)
            self._scans[dataset] = rows, DescriptorScan(self.descriptors[rows])
        return self._scans[dataset]

    def _index(self, dataset: str | None) -> QuickIndex:
        if dataset not in self._indices:
            self._indices[dataset] = QuickIndex.build(self.descriptors[self._among(dataset)[0]])
        return self._indices[dataset]

    @cached_property
    def _network(self) -> TrainedDescriptor:
        from motionlake.deephums.trained import load_descriptor

        return load_descriptor(self._lake.path(self._file))

    def _sequence(self, path: Path) -> Float32Array:
        body, motion = first_body(self._lake, path)
        try:
            return clip_sequence(motion.positions, body.fps)
        except ValueError as error:
            raise UserError(f"{path}: {error}") from error


def _matrix(column: pa.ChunkedArray) -> Float32Array:
    """[n, 512] of a column of descriptors."""
    parts = [chunk.flatten().to_numpy() for chunk in column.chunks]
    return np.concatenate([np.zeros(0, dtype=np.float32), *parts]).reshape(-1, DIMENSION)
