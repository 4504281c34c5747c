"""Lakes made for measuring, and the signatures of their clips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.deep_motifs.emd import ground_distances
from motionlake.deep_motifs.motifs import assign, fit_motifs
from motionlake.deep_motifs.signatures import signatures
from motionlake.jobs.models import take
from motionlake.jobs.run import ingest, run
from motionlake.jobs.session import session
from motionlake.lake.catalog import create_catalog, reading
from motionlake.lake.config import load_config
from motionlake.lake.layout import Lake
from motionlake.stages import words
from motionlake.stages.registry import ALL
from motionlake.stages.sources import IngestOptions, Root
from motionlake.stages.word_network import WORD_NETWORK
from numpy.typing import NDArray

from bench.representation import K, shallow

# Those that hang on words; strings of postures have a bench of their own.
WORD_STAGES = tuple(stage for stage in ALL if stage not in ("postures", "symbols", "descriptors", "submotions"))
CLIPS = "SELECT clip, dataset, label, coalesce(subject, '') FROM clips ORDER BY clip"
SIGNATURES = "SELECT signature FROM signatures JOIN clips USING (clip) ORDER BY clip"
CENTROIDS = "SELECT centroid FROM motifs ORDER BY motif"


@dataclass(frozen=True)
class SignedClips:
    """Labelled clips with signatures [n, K] and the distances [K, K] of the motifs these are made of."""

    datasets: list[str]
    labels: list[str]
    subjects: list[str]
    signatures: NDArray[np.float32]
    ground: Float64Array


def make_lake(folder: Path, sources: Sequence[Path]) -> Lake:
    """A lake of some source folders, each a dataset of its own."""
    lake = Lake(folder / "lake")
    create_catalog(lake)
    roots = [Root(source.name, str(source.resolve()), IngestOptions()) for source in sources]
    with session(lake, "bench", lambda stage, done, total: None, lambda line: None) as job:
        ingest(job, roots)
    return lake


def run_all(lake: Lake, seed: int, weights: Path | None = None, k: int = K) -> None:
    """Every stage of words, with the seed for training and for clustering.

    Args:
        lake: to bring up to date.
        seed: of both.
        weights: a network to take; None trains one on the lake's own clips.
        k: motifs.
    """
    origin = "own" if weights is None else "pretrained"
    text = f'[network]\nweights = "{origin}"\nseed = {seed}\n\n[motifs]\nk = {k}\nseed = {seed}\n'
    lake.config_file.write_text(text, encoding="utf-8")
    with session(lake, "bench", lambda stage, done, total: None, lambda line: None) as job:
        if weights is not None:
            take(job, WORD_NETWORK, weights)
        run(job, WORD_STAGES)
        failed = [f"{stage}: {outcome.reason}" for stage, outcome in job.outcomes.items() if outcome.failed]
    if failed:
        raise RuntimeError("; ".join(failed))


def learned_signatures(lake: Lake) -> SignedClips:
    """What the lake serves."""
    with reading(lake) as con:
        made = np.array([row[0] for row in con.execute(SIGNATURES).fetchall()], dtype=np.float32)
        centroids = np.array([row[0] for row in con.execute(CENTROIDS).fetchall()], dtype=np.float32)
    return SignedClips(*_labels(lake), made, ground_distances(centroids))


def shallow_signatures(lake: Lake, seed: int) -> SignedClips:
    """The same words embedded by their principal components, all else as in the lake."""
    config = load_config(lake.config_file)
    with reading(lake) as con:
        files = [lake.path(file) for file in words.features_files(con, config.words).values()]
    features: dict[str, Float32Array] = {clip: rows for file in files for clip, rows in words.read_features(file)}
    embedded = shallow([features[clip] for clip in sorted(features)], config.words, seed)
    motifs = fit_motifs(np.concatenate(embedded), K, seed)
    made, _ = signatures([assign(vectors, motifs) for vectors in embedded], motifs.k)
    return SignedClips(*_labels(lake), made, ground_distances(motifs.centroids))


def _labels(lake: Lake) -> tuple[list[str], list[str], list[str]]:
    """Dataset, label and subject of every clip, by name."""
    with reading(lake) as con:
        rows = con.execute(CLIPS).fetchall()
    _, datasets, labels, subjects = (list(column) for column in zip(*rows, strict=True))
    return datasets, labels, subjects
