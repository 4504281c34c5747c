"""Dictionaries without a network: k-means and self-organising maps (the baselines of PESTA, section 8.4)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from motionlake.arrays import Float32Array, Int64Array
from motionlake.deep_motifs.motifs import Motifs, assign, fit_motifs
from motionlake.pesta.postures.config import PosturesConfig
from motionlake.pesta.postures.dictionary import NearestCode, PostureDictionary

SOM_EPOCHS = 30


def kmeans_dictionary(postures: Float32Array, config: PosturesConfig) -> PostureDictionary:
    """K-means on postures [n, D]; codes are the centroids, densest first."""
    return _dictionary(postures, fit_motifs(postures, config.m, config.seed).centroids, config)


def som_dictionary(postures: Float32Array, config: PosturesConfig) -> PostureDictionary:
    """A self-organising map [Wu et al. 2009] on postures [n, D]; codes are its nodes, row by row."""
    return _dictionary(postures, self_organising_map(postures, *grid(config.m), config.seed), config)


def grid(m: int) -> tuple[int, int]:
    """Rows and columns of a map of m nodes, as nearly square as m divides."""
    rows = max(r for r in range(1, int(m**0.5) + 1) if m % r == 0)
    return rows, m // rows


def self_organising_map(postures: Float32Array, rows: int, columns: int, seed: int) -> Float32Array:
    """[rows * columns, D] nodes of a map trained in batches.

    Each epoch every node becomes the mean of all postures, weighted by a Gaussian of the distance on the grid
    between it and their nearest nodes; its width falls from half the longer side to a third of a node.
    """
    rng = np.random.default_rng(seed)
    places = np.stack(np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"), axis=-1).reshape(-1, 2)
    steps = np.square(places[:, None] - places[None]).sum(axis=2)
    nodes = _plane(postures, places, rng)
    first, last = max(rows, columns) / 2, 1 / 3
    for epoch in range(SOM_EPOCHS):
        width = first * (last / first) ** (epoch / (SOM_EPOCHS - 1))
        nearest = assign(postures, Motifs(nodes, np.ones(len(nodes))))
        counts = np.bincount(nearest, minlength=len(nodes)).astype(np.float64)
        sums = np.zeros(nodes.shape)
        np.add.at(sums, nearest, postures)
        near = np.exp(-steps / (2 * width**2))
        reached = near @ counts
        moved = (near @ sums) / np.maximum(reached, 1e-12)[:, None]
        nodes = np.where(reached[:, None] > 1e-9, moved, nodes).astype(np.float32)
    return nodes


def _plane(postures: Float32Array, places: np.ndarray, rng: np.random.Generator) -> Float32Array:
    """Nodes laid out over the plane of the first two principal components, a little disturbed."""
    mean = postures.mean(axis=0, dtype=np.float64)
    centred = postures - mean
    variances, directions = np.linalg.eigh(centred.T @ centred / len(postures))
    first = directions[:, -2:] * np.sqrt(np.maximum(variances[-2:], 0))
    spans = np.maximum(places.max(axis=0), 1)
    at = 2 * (places / spans) - 1
    flat = mean + at @ first[:, ::-1].T
    return np.asarray(flat + 1e-3 * rng.standard_normal(flat.shape) * centred.std(), dtype=np.float32)


def _dictionary(postures: Float32Array, codes: Float32Array, config: PosturesConfig) -> PostureDictionary:
    encoder = NearestCode(np.ascontiguousarray(codes, dtype=np.float32))
    figures: dict[str, Any] = {"postures": len(postures), "occupied": len(np.unique(encoder.symbols(postures)))}
    return PostureDictionary(config, encoder, encoder.codes, encoder.codes, figures)


def sample_postures(features: list[Float32Array], config: PosturesConfig) -> tuple[Float32Array, Int64Array]:
    """Postures [n, D] of clips, drawn at random up to `max_postures`, and the clip of each, in order."""
    stacked = np.concatenate(features)
    clips = np.repeat(np.arange(len(features)), [len(rows) for rows in features])
    if len(stacked) <= config.max_postures:
        return stacked, clips
    chosen = np.random.default_rng(config.seed).choice(len(stacked), config.max_postures, replace=False)
    chosen.sort()
    return stacked[chosen], clips[chosen]


def fit_dictionary(
    features: list[Float32Array],
    config: PosturesConfig,
    *,
    checkpoint: Path | None = None,
    progress: Callable[[int, int, float], None] | None = None,
) -> PostureDictionary:
    """Train a dictionary without labels on clips.

    Args:
        features: [T, D] postures of each clip, as `word_features` with `config.frames` gives them.
        config: kind, m, seed, recipe and size of the sample.
        checkpoint: a file that the autoencoder's training is saved to and goes on from.
        progress: called with (steps done, steps, loss); only the autoencoder is trained in steps.

    Raises:
        ValueError: fewer postures than symbols.
    """
    postures, clips = sample_postures(features, config)
    if len(postures) < config.m:
        raise ValueError(f"{len(postures)} postures are too few for {config.m} symbols")
    if config.dictionary == "aae":
        from motionlake.pesta.postures.training import train_autoencoder

        return train_autoencoder(postures, clips, config, checkpoint=checkpoint, progress=progress)

    return kmeans_dictionary(postures, config) if config.dictionary == "kmeans" else som_dictionary(postures, config)
