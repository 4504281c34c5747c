"""Functions that label: the bands of a clip, and the clusters of signatures.

What they need is imported at the first call: a connection that asks for none of it opens as fast.
"""

from __future__ import annotations

from typing import Any

import duckdb
import pyarrow as pa
from duckdb.func import ARROW, SPECIAL
from duckdb.sqltypes import BIGINT, BOOLEAN, DOUBLE, FLOAT, INTEGER, VARCHAR
from motionlake.lake.catalog import Connection, reading
from motionlake.lake.layout import Lake

ROW = {
    "start": BIGINT, "stop": BIGINT, "label": VARCHAR, "distance": DOUBLE, "confidence": DOUBLE,
    "start_seconds": DOUBLE, "seconds": DOUBLE,
}  # fmt: skip
BANDS = pa.list_(
    pa.struct(
        [
            ("start", pa.int64()), ("stop", pa.int64()), ("label", pa.string()), ("distance", pa.float64()),
            ("confidence", pa.float64()), ("start_seconds", pa.float64()), ("seconds", pa.float64()),
        ]
    )
)  # fmt: skip


def register(con: Connection, lake: Lake) -> None:
    """Make `segment_bands` and `cluster_signatures` known to a connection.

    - `segment_bands(clip VARCHAR, datasets VARCHAR[], clips VARCHAR[], mirrored BOOLEAN) -> STRUCT(start, stop,
      label, distance, confidence, start_seconds, seconds)[]`: see `motionlake.retrieval.labelling.LakeSegmenter`
    - `cluster_signatures(signatures FLOAT[][], k BIGINT) -> INTEGER[]`: see
      `motionlake.deep_motifs.classification.cluster_clips`; NULL for k takes the best number
    """

    def segmented(
        clips: pa.ChunkedArray, datasets: pa.ChunkedArray, teachers: pa.ChunkedArray, mirrored: pa.ChunkedArray
    ) -> pa.Array:
        from motionlake.retrieval.labelling.segments import LakeSegmenter, Lessons

        found: list[list[dict[str, object]] | None] = []
        with reading(lake) as own:
            columns = (c.to_pylist() for c in (clips, datasets, teachers, mirrored))
            for clip, sets, names, both in zip(*columns, strict=True):
                if clip is None:
                    found.append(None)
                    continue
                segmenter = LakeSegmenter(own, lake, Lessons(sets, names, mirrored=bool(both)))
                found.append([band.as_row() for band in segmenter.clip(clip)])
        return pa.array(found, BANDS)

    def clustered(signatures: pa.ChunkedArray, k: pa.ChunkedArray) -> pa.Array:
        import numpy as np
        from motionlake.deep_motifs.classification import cluster_clips
        from motionlake.deep_motifs.emd import emd_matrix
        from motionlake.retrieval.labelling.signed import lake_ground

        found: list[list[int] | None] = []
        with reading(lake) as own:
            ground = lake_ground(own)
        for rows, count in zip(signatures.to_pylist(), k.to_pylist(), strict=True):
            if rows is None:
                found.append(None)
                continue
            clustering = cluster_clips(emd_matrix(np.array(rows, dtype=np.float32), ground), count)
            found.append(clustering.clusters.tolist())
        return pa.array(found, pa.list_(pa.int32()))

    kind: Any = {"type": ARROW, "null_handling": SPECIAL}
    names = duckdb.list_type(VARCHAR)
    rows = duckdb.list_type(duckdb.struct_type(ROW))
    con.create_function("segment_bands", segmented, [VARCHAR, names, names, BOOLEAN], rows, **kind)
    lists = duckdb.list_type(duckdb.list_type(FLOAT))
    con.create_function("cluster_signatures", clustered, [lists, BIGINT], duckdb.list_type(INTEGER), **kind)
