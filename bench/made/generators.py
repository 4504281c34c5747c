"""Generators of the folds, by motion matching and by networks, and the motions that they make."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Final

from motionlake.glogen.config import SynthesisConfig
from motionlake.glogen.generator import TrainedGenerator, TrainingMotion, load_generator
from motionlake.glogen.generator_training import train_generator
from motionlake.lake.parts import replacing
from motionlake.matching.generator import MatchingGenerator
from motionlake.motion.generation import GeneratedMotion, MotionGenerator, MotionRequest

from bench.canonical_sets import LabelledClip
from bench.classes import GOING
from bench.made.splits import parted
from bench.matching_clips import database_of, seed_of

RECIPES: Final = ("matching", "networks")
SECONDS: Final = 10.0  # of a class that goes on


@cache
def matching(split: str, fold: int) -> MatchingGenerator:
    return MatchingGenerator(database_of(parted(split, fold)[0]))


@cache
def networks(split: str, fold: int, epochs: int = 0, kept: Path | None = None) -> TrainedGenerator:
    """The default networks, trained on the other folds; the fold is the seed. A folder keeps them."""
    config = SynthesisConfig(recipe="default", seed=fold, epochs=epochs)
    name = hashlib.sha256(repr((split, fold, config)).encode()).hexdigest()[:24]
    path = kept and kept / f"{name}.safetensors"
    if path is not None and path.exists():
        return load_generator(path)
    known = [TrainingMotion(c.positions.astype(float), c.fps, c.label) for c in parted(split, fold)[0]]
    generator = train_generator(known, config)
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as written:
            generator.save(written)
    return generator


def generator(recipe: str, split: str, fold: int, epochs: int = 0, kept: Path | None = None) -> MotionGenerator:
    return matching(split, fold) if recipe == "matching" else networks(split, fold, epochs, kept)


def go_on(
    maker: MotionGenerator, clips: Sequence[LabelledClip], seed: int
) -> tuple[list[LabelledClip], list[GeneratedMotion]]:
    """The clips that a generator can go on from, and the motions: ten seconds, or as long as an action goes on."""
    possible, made = [], []
    for i, clip in enumerate(clips):
        try:
            (one,) = maker.generate([MotionRequest((clip.label,), SECONDS, seed + i, seed_of(clip))])
        except ValueError:  # too short
            continue
        if clip.label not in GOING:
            left = (len(clip.positions) - one.seed_stop) / clip.fps
            if left * one.fps < 2:
                continue
            (one,) = maker.generate([MotionRequest((clip.label,), left, seed + i, seed_of(clip))])
        possible.append(clip)
        made.append(one)
    return possible, made
