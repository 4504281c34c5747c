"""Reading the encoded words of a lake."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array
from motionlake.columns import numbers
from motionlake.deep_motifs.signatures import Corpus, CorpusClip
from motionlake.deephums.config import DIMENSION
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch, fetch_table


def read_corpus(con: Connection, dataset: str | None = None) -> Corpus:
    """The signed words of a lake, or of one of its datasets.

    Raises:
        UserError: the lake has no motifs yet, or no signed clip of that dataset.
    """
    motifs = fetch(con, "corpus_motifs")
    if not motifs:
        raise UserError("the lake has no motifs yet; make them with `motionlake run all`")
    clips = [CorpusClip(**row) for row in fetch(con, "corpus_clips", {"dataset": dataset})]
    if not clips:
        raise UserError(f"dataset {dataset}: has no clip with a signature; `motionlake status` shows what there is")
    words = fetch_table(con, "corpus_words", {"dataset": dataset})
    counts = Counter(words.column("clip").to_pylist())
    offsets = np.concatenate([[0], np.cumsum([counts[c.clip] for c in clips])]).astype(np.int64)
    return Corpus(
        clips,
        offsets,
        numbers(words.column("motif")).astype(np.int32),
        numbers(words.column("start")).astype(np.int64),
        numbers(words.column("stop")).astype(np.int64),
        np.array([row["centroid"] for row in motifs], dtype=np.float32),
        np.array([row["idf"] for row in motifs]),
        np.array([row["strength"] for row in motifs]),
        motifs[0]["model"],
    )


def read_signatures(con: Connection) -> tuple[list[dict[str, Any]], list[CorpusClip], Float32Array]:
    """The motifs of a lake, none where it has none yet; its n signed clips by name; their signatures [n, K]."""
    motifs, rows = fetch(con, "corpus_motifs"), fetch_table(con, "signature_index")
    if not motifs:
        return [], [], np.zeros((0, 0), dtype=np.float32)
    return motifs, *_vectors(rows, "signature", len(motifs))


def read_descriptors(con: Connection) -> tuple[list[CorpusClip], Float32Array]:
    """The n described clips of a lake by name, and their descriptors [n, 512]."""
    return _vectors(fetch_table(con, "descriptor_clips"), "descriptor", DIMENSION)


def read_descriptors_near(
    con: Connection, descriptor: Float32Array, count: int, admitted: Mapping[str, object]
) -> tuple[list[CorpusClip], Float32Array]:
    """The same of about the `count` described clips nearest to a descriptor [512], which the catalog finds by itself.

    `admitted`: `ClipFilter.as_parameters`.
    """
    asked = {**admitted, "descriptor": descriptor.tolist(), "count": count}
    return _vectors(fetch_table(con, "descriptors_near", asked), "descriptor", DIMENSION)


def _vectors(rows: pa.Table, column: str, width: int) -> tuple[list[CorpusClip], Float32Array]:
    found, at = np.empty((len(rows), width), dtype=np.float32), 0
    for chunk in rows[column].chunks:  # not all at once: they would be in memory twice more
        found[at : at + len(chunk)] = numbers(chunk.flatten()).reshape(len(chunk), width)
        at += len(chunk)
    return [CorpusClip(**row) for row in rows.drop_columns([column]).to_pylist()], found
