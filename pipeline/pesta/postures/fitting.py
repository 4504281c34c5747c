"""Fit the dictionary of a configuration, whatever its kind."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from motionlake.motion.features import Float32Array
from motionlake.pesta.postures.config import PosturesConfig
from motionlake.pesta.postures.dictionary import PostureDictionary
from numpy.typing import NDArray


def sample_postures(features: list[Float32Array], config: PosturesConfig) -> tuple[Float32Array, NDArray[np.int64]]:
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
    from motionlake.pesta.postures.clusters import kmeans_dictionary, som_dictionary

    return kmeans_dictionary(postures, config) if config.dictionary == "kmeans" else som_dictionary(postures, config)
