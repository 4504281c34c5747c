"""Functions of signatures: their distances, and the nearest of a lake.

What they need is made at the first call, not when a connection is opened: POT takes seconds to import, and a
query about frames has no use for it.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import duckdb
import numpy as np
import pyarrow as pa
from duckdb.func import ARROW, SPECIAL
from duckdb.sqltypes import BIGINT, BOOLEAN, DOUBLE, FLOAT, VARCHAR
from motionlake.arrays import Float64Array
from motionlake.deep_motifs.emd import emd, emd_deep_motifs, ground_distances
from motionlake.deep_motifs.emd_search import SignatureIndex
from motionlake.lake.catalog import Connection, fetch, fetch_table, reading
from motionlake.lake.layout import Lake
from numpy.typing import NDArray

HITS = pa.list_(pa.struct([("clip", pa.string()), ("distance", pa.float64())]))


def register(con: Connection, lake: Lake) -> None:
    """Make `emd`, `emd_deep_motifs` and `nearest_signatures` known to a connection.

    - `emd(FLOAT[], FLOAT[]) -> DOUBLE`
    - `emd_deep_motifs(FLOAT[], FLOAT[]) -> DOUBLE`, the variant of `motionlake.deep_motifs.emd`
    - `nearest_signatures(signature FLOAT[], k BIGINT, within VARCHAR, without VARCHAR, model VARCHAR, real BOOLEAN) ->
      STRUCT(clip VARCHAR, distance DOUBLE)[]`: the k clips nearest to a signature, ties by name; all where k is
      NULL, none where the signature is. `within` is a dataset, `without` a clip that is no answer, `model` the
      motifs that the signature was made with; each may be NULL. `real` leaves synthetic clips out.
    """
    served = _Served(lake)
    signature = duckdb.list_type(FLOAT)
    hits = duckdb.list_type(duckdb.struct_type({"clip": VARCHAR, "distance": DOUBLE}))

    def distance(left: pa.ChunkedArray, right: pa.ChunkedArray) -> pa.Array:
        pairs = zip(left.to_pylist(), right.to_pylist(), strict=True)
        found = [None if p is None or q is None else emd(p, q, served.ground) for p, q in pairs]
        return pa.array(found, pa.float64())

    def deep_motifs(left: pa.ChunkedArray, right: pa.ChunkedArray) -> pa.Array:
        pairs = zip(left.to_pylist(), right.to_pylist(), strict=True)
        found = [
            None if p is None or q is None else emd_deep_motifs(p, q, served.strength, served.ground) for p, q in pairs
        ]
        return pa.array(found, pa.float64())

    def nearest(
        signatures: pa.ChunkedArray,
        k: pa.ChunkedArray,
        within: pa.ChunkedArray,
        without: pa.ChunkedArray,
        model: pa.ChunkedArray,
        real: pa.ChunkedArray,
    ) -> pa.Array:
        columns = (signatures, k, within, without, model, real)
        rows = zip(*(column.to_pylist() for column in columns), strict=True)
        return pa.array([None if row[0] is None else served.nearest(*row) for row in rows], HITS)

    kind: Any = {"type": ARROW, "null_handling": SPECIAL}
    con.create_function("emd", distance, [signature, signature], DOUBLE, **kind)
    con.create_function("emd_deep_motifs", deep_motifs, [signature, signature], DOUBLE, **kind)
    arguments: Any = [signature, BIGINT, VARCHAR, VARCHAR, VARCHAR, BOOLEAN]
    con.create_function("nearest_signatures", nearest, arguments, hits, **kind)


class _Served:
    """The motifs and signatures that a connection serves, read at first use by another connection.

    (A function must not query the connection that runs it. While that one is open, both see the same catalog.)
    """

    def __init__(self, lake: Lake) -> None:
        self.lake = lake

    @cached_property
    def motifs(self) -> list[dict[str, Any]]:
        with reading(self.lake) as con:
            return fetch(con, "corpus_motifs")

    @cached_property
    def ground(self) -> Float64Array:
        """[K, K]"""
        centroids = [row["centroid"] for row in self.motifs]
        return ground_distances(np.array(centroids, dtype=np.float32)) if centroids else np.zeros((0, 0))

    @cached_property
    def strength(self) -> Float64Array:
        """[K]"""
        return np.array([row["strength"] for row in self.motifs], dtype=np.float64)

    @cached_property
    def clips(self) -> SignedClips:
        with reading(self.lake) as con:
            rows = fetch_table(con, "signature_index")
        weights = rows["signature"].combine_chunks().flatten().to_numpy(zero_copy_only=False)
        index = SignatureIndex.build(
            weights.reshape(len(rows), len(self.ground)), self.ground, self.motifs[0]["model"] if self.motifs else None
        )
        synthetic = np.array(rows["synthetic"].to_pylist(), dtype=np.bool_)
        datasets = np.array(rows["dataset"].to_pylist(), dtype=object)
        return SignedClips(rows["clip"].to_pylist(), datasets, synthetic, index)

    def nearest(
        self,
        signature: list[float],
        k: int | None,
        within: str | None,
        without: str | None,
        model: str | None,
        real: bool | None,
    ) -> list[dict[str, Any]]:
        """The k clips nearest to a signature, as rows of clip and distance."""
        clips = self.clips
        count = len(clips.index) if k is None else k
        chosen = clips.among(within, without, real=bool(real))
        if count == 0 or not len(chosen):
            return []
        found = clips.index.nearest(signature, count, chosen, model)
        rows = zip(found.indices.tolist(), found.distances.tolist(), strict=True)
        return [{"clip": clips.names[i], "distance": distance} for i, distance in rows]


@dataclass(frozen=True)
class SignedClips:
    """n clips by name: their datasets [n], whether they are synthetic [n], and the index of their signatures."""

    names: list[str]
    datasets: NDArray[np.object_]
    synthetic: NDArray[np.bool_]
    index: SignatureIndex

    def among(self, within: str | None, without: str | None, *, real: bool) -> NDArray[np.int64]:
        """Indices of the clips of a dataset, or of all, but one; with `real`, of recorded ones."""
        chosen = np.arange(len(self.names)) if within is None else np.flatnonzero(self.datasets == within)
        if real:
            chosen = chosen[~self.synthetic[chosen]]
        if without is None:
            return chosen
        at = bisect_left(self.names, without)
        return chosen if self.names[at : at + 1] != [without] else chosen[chosen != at]
