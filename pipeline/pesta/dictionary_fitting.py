"""Fitting posture dictionaries of every kind to postures, without labels (PESTA, section 5.2)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from motionlake.arrays import Float32Array, Int64Array, Progress
from motionlake.deep_motifs.motifs import Motifs, assign
from motionlake.pesta.clustering import grid, kmeans, neural_gas, self_organising_map, whitened
from motionlake.pesta.config import CLUSTERED, PosturesConfig
from motionlake.pesta.dictionary import NearestCode, PostureDictionary
from motionlake.pesta.occupancy import mean_postures, scatter, use_of
from motionlake.threads import limited

if TYPE_CHECKING:
    from motionlake.pesta.autoencoder import AutoencoderRecipe


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
    recipe: AutoencoderRecipe | None = None,
    checkpoint: Path | None = None,
    device: str | None = None,
    progress: Progress | None = None,
) -> PostureDictionary:
    """Train a dictionary without labels on clips.

    Args:
        features: [T, D] postures of each clip, as `word_features` with `config.frames` gives them.
        config: kind, m, seed and size of the sample.
        recipe: of an autoencoder; that of its kind if not given.
        checkpoint: a file that an autoencoder's training is saved to and goes on from.
        device: of an autoencoder's training; CUDA where there is one, else the CPU.
        progress: called with (steps done, steps at most, loss); only autoencoders are trained in steps.

    Returns:
        The dictionary. Its metrics: `postures` it was fitted to, how they use it (`use_of`), their `scatter` within the
        symbols as a share of the variance, and what `train_autoencoder` says of its training.

    Raises:
        ValueError: fewer postures than symbols.
    """
    postures, clips = sample_postures(features, config)
    if len(postures) < config.m:
        raise ValueError(f"{len(postures)} postures are too few for {config.m} symbols")
    with limited(1):  # sums of several threads differ in their last digits
        if config.dictionary in CLUSTERED:
            made = _clustered(postures, clips, config)
        else:
            from motionlake.pesta.autoencoder import recipe_of
            from motionlake.pesta.autoencoder_training import train_autoencoder

            trained = train_autoencoder(
                postures, clips, config, recipe or recipe_of(config.dictionary),
                checkpoint=checkpoint, device=device, progress=progress,
            )  # fmt: skip
            made = PostureDictionary(config, trained.encoder, trained.codes, trained.postures, trained.metrics)
        symbols = made.encode(postures)
        use = {"postures": len(postures), **use_of(symbols, made.m), "scatter": scatter(postures, symbols, made.m)}
        return PostureDictionary(config, made.encoder, made.codes, made.postures, use | dict(made.metrics))


def _clustered(postures: Float32Array, clips: Int64Array, config: PosturesConfig) -> PostureDictionary:
    start = whitened(postures, clips, config.seed) if config.whitened else None
    points = postures if start is None else postures @ start.T
    if config.dictionary == "neural_gas":
        codes = neural_gas(points, config.m, config.softness, config.seed)
    elif config.dictionary == "kmeans":
        codes = kmeans(points, config.m, config.softness, config.seed)
    else:
        codes = self_organising_map(points, *grid(config.m), config.seed)
    codes = np.ascontiguousarray(codes, dtype=np.float32)
    encoder = NearestCode(codes, start)
    means, counts = mean_postures(postures, encoder.symbols(postures), len(codes))
    empty = counts == 0  # such a symbol looks like the posture nearest to its head
    means[empty] = postures[assign(codes[empty], Motifs(points, np.ones(len(points))))]
    return PostureDictionary(config, encoder, codes, means.astype(np.float32), {})
