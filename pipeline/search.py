"""Retrieval of whole clips by their signatures, for clips of the lake and for files outside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from pipeline.config import load_config
from pipeline.errors import ClipError, UserError
from pipeline.lake.catalog import Connection, fetch
from pipeline.lake.layout import Lake
from pipeline.motifs import assign
from pipeline.skeleton.rigs import load_rigs
from pipeline.stages import embed, motifs
from pipeline.stages.frames import canonical_motions
from pipeline.stages.sources import IngestOptions
from pipeline.words.features import word_features
from pipeline.words.windows import word_windows


@dataclass(frozen=True)
class Hit:
    """One answer: its rank from 1, the clip, and its distance from the query."""

    rank: int
    clip: str
    distance: float
    label: str | None
    dataset: str
    seconds: float

    def as_row(self) -> dict[str, object]:
        return asdict(self)


def similar_to_clip(con: Connection, clip: str, k: int, dataset: str | None = None) -> list[Hit]:
    """The k clips nearest to a clip of the lake by signature; the clip itself is left out.

    Raises:
        UserError: the clip has no signature yet.
    """
    if not fetch(con, "queries/has_signature.sql", {"clip": clip}):
        raise UserError(f"{clip}: has no signature yet; make it with `motionlake run all`")
    return _hits(con, "queries/search_clip.sql", {"clip": clip, "k": k, "dataset": dataset})


def similar_to_file(con: Connection, lake: Lake, path: Path, k: int, dataset: str | None = None) -> list[Hit]:
    """The k clips nearest to a clip file that need not be in the lake (its first body).

    Raises:
        UserError: the file cannot be read, or the lake has no motifs yet.
    """
    signature = signature_of_file(con, lake, path)
    return _hits(con, "queries/search_signature.sql", {"signature": signature.tolist(), "k": k, "dataset": dataset})


def signature_of_file(con: Connection, lake: Lake, path: Path, options: IngestOptions | None = None) -> np.ndarray:
    """[K] signature of a file's first body under the lake's frozen models."""
    from pipeline.words.training import load_network

    config = load_config(lake.config_file)
    network = embed.fitting_network(con, config)
    model = motifs.fitting_motifs(con, config, network) if network else None
    if network is None or model is None:
        raise UserError(f"{lake.root}: has no motifs yet; make them with `motionlake run all`")
    try:
        clip, motion, _ = next(iter(canonical_motions(path, load_rigs(lake.rigs), options or IngestOptions())))
    except ClipError as error:
        raise UserError(f"{path}: {error}") from error
    features = word_features(motion.positions, motion.rotations, clip.fps, config.words)
    vectors = load_network(lake.path(network.file)).embed(word_windows(features, config.words))
    words = assign(vectors, motifs.read_motifs(lake.path(model.file)))
    rows = fetch(con, "queries/weigh_motifs.sql", {"motifs": words.tolist()})
    return np.array(rows[0]["signature"], dtype=np.float32)


def _hits(con: Connection, query: str, parameters: dict[str, object]) -> list[Hit]:
    rows: Sequence[dict[str, object]] = fetch(con, query, parameters)
    return [Hit(**row) for row in rows]  # type: ignore[arg-type]
