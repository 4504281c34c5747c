"""Motifs (Deep Motifs, section 4.1): clusters of the embedded words of a lake, fitted once and frozen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from motionlake.arrays import Float32Array, Progress
from motionlake.columns import numbers, read_parquet
from motionlake.deep_motifs.motifs import Motifs, fit_motifs
from motionlake.errors import UserError
from motionlake.lake.config import LakeConfig, MotifsConfig, config_hash
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.lake.parts import PartWriter
from motionlake.stages.embed import EMBED, read_embeddings
from motionlake.stages.model_kind import ModelKind, Selection
from motionlake.stages.reader import LakeReader
from motionlake.stages.word_network import WORD_NETWORK

SAMPLE = 200_000
FILE_ROWS = pa.schema([("motif", pa.int32()), ("centroid", pa.list_(pa.float32())), ("strength", pa.float64())])


@dataclass(frozen=True)
class FittedMotifs:
    """Motifs as a file of the lake has them, and how many words they were fitted on."""

    motifs: Motifs
    words: int

    @property
    def metrics(self) -> Mapping[str, Any]:
        return {"k": float(self.motifs.k), "words": float(self.words)}

    def save(self, path: Path) -> None:
        """Write a row a motif."""
        centroids = [row.tolist() for row in self.motifs.centroids]
        number = np.arange(len(centroids), dtype=np.int32)
        columns = [pa.array(number), pa.array(centroids, FILE_ROWS.field("centroid").type), self.motifs.strength]
        writer = PartWriter(path, FILE_ROWS, {"words": str(self.words)})
        writer.append(pa.Table.from_arrays(columns, schema=FILE_ROWS))
        writer.close()


class MotifModel(ModelKind[Float32Array]):
    """The motifs of a lake, in the space of one word network."""

    name = "motifs"
    config = MotifsConfig
    title = "motifs"
    use = "assigns the words"
    lacks = "embeddings yet; `motionlake run all` makes every stage"
    suffix = ".parquet"

    def key(self, at: LakeReader) -> str | None:
        network = WORD_NETWORK.fitting(at)
        if network is None:
            return None
        return config_hash(self.name, self.version, at.config.motifs, network.model, network.key)

    def announce(self, at: LakeReader) -> str:
        return f"will fit {at.config.motifs.k} motifs"

    def data(self, at: LakeReader, where: Selection) -> Float32Array | None:
        """[n, d] embedded words of the lake, a random sample where there are many."""
        config = at.config.motifs
        parts = EMBED.parts(at)
        if parts is None:
            return None
        files = [sound(at.lake, EMBED.file(p.key)) for p in parts if not p.synthetic]
        vectors = _sample(files, config.seed) if files else np.zeros((0, 0), dtype=np.float32)
        if len(vectors) < config.k:
            raise UserError(
                f"{at.lake.root}: holds {len(vectors)} words, too few for {config.k} motifs; "
                f"take in more clips, or set k below [motifs] in {at.lake.config_file} to {len(vectors)} or less"
            )
        return vectors

    def fit(
        self, lake: Lake, config: LakeConfig, data: Float32Array, checkpoint: Path, progress: Progress
    ) -> FittedMotifs:
        return FittedMotifs(fit_motifs(data, config.motifs.k, config.motifs.seed), len(data))

    def load(self, path: Path) -> FittedMotifs:
        return FittedMotifs(read_motifs(path), int((pq.read_metadata(path).metadata or {})[b"words"]))


MOTIF_MODEL: Final = MotifModel()


def _sample(files: Sequence[Path], seed: int) -> Float32Array:
    share = max(1, SAMPLE // len(files))
    random = np.random.default_rng(seed)
    chosen = []
    for file in files:
        vectors = read_embeddings(file)[1]
        if len(vectors) > share:
            vectors = vectors[np.sort(random.choice(len(vectors), share, replace=False))]
        chosen.append(vectors)
    return np.concatenate(chosen)


def read_motifs(path: Path) -> Motifs:
    """The motifs of a model file."""
    table = read_parquet(path)
    centroids = np.array(table.column("centroid").to_pylist(), dtype=np.float32)
    return Motifs(centroids, numbers(table.column("strength")))
