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
from motionlake.matching.database import build_database
from motionlake.matching.generator import MatchingGenerator
from motionlake.matching.recordings import MatchingClip
from motionlake.motion.generation import GeneratedMotion, MotionGenerator, MotionRequest

from bench.canonical_sets import LabelledClip
from bench.classes import GOING
from bench.made.splits import offsets_of, parted, seed_of

RECIPES: Final = ("matching", "networks")
SECONDS: Final = 10.0  # of a class that goes on


@cache
def matching(split: str, fold: int) -> MatchingGenerator:
    return MatchingGenerator(
        build_database(
            [
                MatchingClip(f"{c.label}/{c.name}", 0, c.label, c.positions, c.rotations, offsets_of(c), c.fps)
                for c in parted(split, fold)[0]
            ]
        )
    )


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
    possible, requests = [], []
    for i, clip in enumerate(clips):
        try:
            (probe,) = maker.generate([MotionRequest((clip.label,), 1e-3, seed + i, seed_of(clip))])
        except ValueError:  # too short
            continue
        left = (len(clip.positions) - probe.seed_stop) / clip.fps
        seconds = SECONDS if clip.label in GOING else left
        if seconds > 0:
            possible.append(clip)
            requests.append(MotionRequest((clip.label,), seconds, seed + i, seed_of(clip)))
    return possible, maker.generate(requests)
