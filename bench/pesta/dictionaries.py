"""Dictionaries trained on a set without its labels, and the strings over them; each is fitted once a process."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
from motionlake.arrays import Float32Array
from motionlake.deep_motifs.words.linear import linear_embedding
from motionlake.pesta.config import PRETRAINED_POSTURES, PosturesConfig, SymbolsConfig
from motionlake.pesta.dictionary import AutoencoderRecipe, PostureDictionary, load_dictionary, recipe_of
from motionlake.pesta.posture_training import fit_dictionary, sample_postures
from motionlake.pesta.symbols import SymbolString, symbolise
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from bench.canonical_sets import LabelledClip
from bench.pesta.sets import clips_of, postures_of

OWN = PosturesConfig(weights="own")


@dataclass(frozen=True)
class Spec:
    """One way to make a dictionary.

    Attributes:
        config: kind, m, seed and features.
        recipe: of the autoencoder; that of the configuration if not given.
        started: "kmeans" and "som" alone: in the space that the autoencoder's codes start in, not in that of the
            features.
        ready: the dictionary that comes with the package, whose configuration this must have.
    """

    config: PosturesConfig = field(default_factory=lambda: OWN)
    recipe: AutoencoderRecipe | None = None
    started: bool = False
    ready: bool = False

    def seeded(self, seed: int) -> Spec:
        return replace(self, config=replace(self.config, seed=seed))


@dataclass(frozen=True)
class Unit:
    """One dictionary of the set that a part of the bench is about."""

    dictionary: str
    spec: Spec
    seed: int

    def __str__(self) -> str:
        return f"{self.dictionary}, m = {self.spec.config.m}, seed {self.seed}"


def pretrained() -> Spec | None:
    """The dictionary that comes with the package, if there is one."""
    return Spec(load_dictionary(PRETRAINED_POSTURES.file).config, ready=True) if PRETRAINED_POSTURES.about() else None


@dataclass(frozen=True)
class Fitted:
    """A dictionary, and the map that postures go through before it."""

    dictionary: PostureDictionary
    start: Float32Array | None = None

    def encode(self, postures: Float32Array) -> NDArray[np.int32]:
        """[T] symbols of postures [T, D]."""
        return self.dictionary.encode(postures if self.start is None else postures @ self.start.T)

    @property
    def distances(self) -> Float32Array:
        return self.dictionary.distances

    @property
    def metrics(self) -> dict[str, Any]:
        return dict(self.dictionary.metrics)


@lru_cache(maxsize=16)
def fitted(name: str, spec: Spec) -> Fitted:
    """The dictionary of a set."""
    if spec.ready:
        return Fitted(load_dictionary(PRETRAINED_POSTURES.file))
    postures = postures_of(name, spec.config.frames)
    with threadpool_limits(limits=1):
        if spec.started:
            sample, clips = sample_postures(postures, spec.config)
            linear = (spec.recipe or recipe_of(spec.config)).linear
            start = linear_embedding(sample[:, None], clips, linear, spec.config.seed)
            return Fitted(fit_dictionary([rows @ start.T for rows in postures], spec.config), start)
        if spec.config.dictionary == "aae" and spec.recipe is not None:
            from motionlake.pesta.posture_training import train_autoencoder

            return Fitted(train_autoencoder(*sample_postures(postures, spec.config), spec.config, recipe=spec.recipe))
        return Fitted(fit_dictionary(postures, spec.config))


@lru_cache(maxsize=16)
def codes_of(name: str, spec: Spec) -> list[NDArray[np.int32]]:
    """[T] symbols of each clip of a set, before any reduction."""
    made = fitted(name, spec)
    return [made.encode(rows) for rows in postures_of(name, spec.config.frames)]


def strings_of(name: str, spec: Spec, reduced: SymbolsConfig | None = None) -> list[SymbolString]:
    """The string of each clip of a set."""
    return [
        string(codes, clip, spec.config.fps, reduced)
        for codes, clip in zip(codes_of(name, spec), clips_of(name), strict=True)
    ]


def string(
    codes: NDArray[np.int32], clip: LabelledClip, codes_fps: float, reduced: SymbolsConfig | None = None
) -> SymbolString:
    """The string of one clip."""
    config = reduced or SymbolsConfig()
    return symbolise(codes, codes_fps=codes_fps, fps=clip.fps, n_frames=len(clip.positions), config=config)
