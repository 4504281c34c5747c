"""Dictionaries trained on a set without its labels, and the strings over them; each is fitted once a process."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from motionlake.pesta.autoencoder import AutoencoderRecipe
from motionlake.pesta.config import PRETRAINED_POSTURES, PosturesConfig, SymbolsConfig
from motionlake.pesta.dictionary import PostureDictionary, load_dictionary
from motionlake.pesta.dictionary_fitting import fit_dictionary
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
        recipe: of an autoencoder; that of its kind if not given.
        ready: the dictionary that comes with the package, whose configuration this must have.
    """

    config: PosturesConfig = field(default_factory=lambda: OWN)
    recipe: AutoencoderRecipe | None = None
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


@lru_cache(maxsize=16)
def fitted(name: str, spec: Spec) -> PostureDictionary:
    """The dictionary of a set."""
    if spec.ready:
        return load_dictionary(PRETRAINED_POSTURES.file)
    with threadpool_limits(limits=1):
        return fit_dictionary(postures_of(name, spec.config.frames), spec.config, recipe=spec.recipe)


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
