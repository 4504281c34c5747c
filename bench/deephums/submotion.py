"""Pieces of clips, the clips they are from, and where in them: the second network alone (DeepHuMS, section 3.3.5).

Trained on the clips of utd_mhad's split "train". From every clip of "test" one piece of 25 to 60 % of its frames is cut
at a random offset, before anything is computed, and asked for among all test clips. The piece is then located in its
source by sub-sequence DTW, beside the best constant guess: the one range, as shares of the clip, that overlaps pieces
of training clips best.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float32Array, Int64Array
from motionlake.deephums.config import DescriptorsConfig, SubmotionConfig
from motionlake.deephums.sequence import clip_sequence, piece_windows
from motionlake.deephums.submotions import TrainedSubmotion, train_submotion
from motionlake.deephums.training import TrainingClip, train_descriptor
from motionlake.motion.features import WordConfig, word_features
from motionlake.retrieval.submotion_search import Piece, piece_of, place
from numpy.typing import NDArray

from bench.canonical_sets import LabelledClip
from bench.deephums.retrieval import euclidean
from bench.deephums.sets import Split, split_of
from bench.units import SEEDS, Found, table, with_seeds

SET: Final = "utd_mhad"
SHARES: Final = (0.25, 0.6)
WORDS: Final = WordConfig()
SCORES: Final = ("top1", "top5", "iou_source", "iou_hits", "iou_constant", "n")
GUESSES: Final = np.linspace(0, 1, 51)
RECIPES: Final = {"motionlake": "default", "thesis": "deephums"}
PARTS: Final = 40  # of a training, whose mean losses a record keeps


@dataclass(frozen=True)
class Pieces:
    """One piece of each of n clips, and the frames [n, 2] of its clip that it was cut from."""

    pieces: list[Piece]
    ranges: Int64Array


def cut(clips: Sequence[LabelledClip], seed: int) -> Pieces:
    """A piece of every clip, at its own rate."""
    rng = np.random.default_rng(seed)
    pieces, ranges = [], []
    for clip in clips:
        count = round(len(clip.positions) * rng.uniform(*SHARES))
        start = int(rng.integers(0, len(clip.positions) - count + 1))
        frames = slice(start, start + count)
        pieces.append(piece_of(clip.label, clip.positions[frames], clip.rotations[frames], clip.fps, WORDS))
        ranges.append((start, start + count))
    return Pieces(pieces, np.array(ranges, dtype=np.int64))


def overlaps(found: NDArray[np.floating] | Int64Array, true: Int64Array) -> NDArray[np.float64]:
    """[n] intersection over union of ranges [n, 2]."""
    both = np.minimum(found[:, 1], true[:, 1]) - np.maximum(found[:, 0], true[:, 0])
    either = np.maximum(found[:, 1], true[:, 1]) - np.minimum(found[:, 0], true[:, 0])
    shares: NDArray[np.float64] = np.maximum(both, 0) / either
    return shares


def best_guess(true: Int64Array, frames: NDArray[np.int64]) -> tuple[float, float]:
    """The range, as shares of a clip, whose mean overlap with ranges [n, 2] of clips of so many frames is greatest."""
    every = [(a, b) for a in GUESSES for b in GUESSES if a < b]
    scores = [overlaps(np.outer(frames, guess), true).mean() for guess in every]
    start, stop = every[int(np.argmax(scores))]
    return float(start), float(stop)


def locate(pieces: Sequence[Piece], clips: Sequence[LabelledClip]) -> Int64Array:
    """[n, 2] frames of each clip that its piece aligns with best."""
    found = []
    for piece, clip in zip(pieces, clips, strict=True):
        features = word_features(clip.positions, clip.rotations, clip.fps, WORDS)
        stretch = place(piece, {"clip": "", "fps": clip.fps, "frames": len(clip.positions)}, features, WORDS)
        found.append((stretch.start, stretch.stop))
    return np.array(found, dtype=np.int64)


def ranks(apart: NDArray[np.float64]) -> NDArray[np.int64]:
    """[n] how many clips are nearer to the piece of a clip, or as near and before it, than that clip; of [n, n]."""
    order = np.argsort(apart, axis=1, kind="stable")
    return np.asarray((order == np.arange(len(apart))[:, None]).argmax(axis=1), dtype=np.int64)


def from_clips(asked: Float32Array, windows: Float32Array, counts: Sequence[int]) -> NDArray[np.float64]:
    """[n, c] distances of pieces [n, 512] from the nearest window of each of c clips, which have `counts` windows."""
    apart = euclidean(asked, windows)
    return np.minimum.reduceat(apart, np.concatenate([[0], np.cumsum(counts)[:-1]]), axis=1)


def distances(
    known: Split, test: Split, pieces: Pieces, config: SubmotionConfig, epochs: int = 0
) -> tuple[NDArray[np.float64], list[float]]:
    """[n, n] of the pieces from the test clips, as the lake has them: by their windows; and the losses of training.

    Recipe "deephums" compares pieces with descriptors of whole clips, by the self-supervised network of the default
    recipe.
    """
    first = targets = None
    if config.recipe == "deephums":
        clips = [TrainingClip(sequence) for sequence in known.sequences]
        first = train_descriptor(clips, DescriptorsConfig(supervision="none", seed=config.seed, epochs=epochs))
        targets = first.embed(known.sequences)
    network, losses = train_submotion(known.sequences, config, targets=targets)
    second = TrainedSubmotion(config, network, {"loss": losses[-1]})
    asked = second.embed([piece.sequence for piece in pieces.pieces])
    if first is not None:
        return euclidean(asked, first.embed(test.sequences)), losses
    windows = [piece_windows(len(clip.positions), clip.fps) for clip in test.clips]
    cut_out = [
        clip_sequence(clip.positions[start:stop], clip.fps)
        for clip, several in zip(test.clips, windows, strict=True)
        for start, stop in several
    ]
    return from_clips(asked, second.embed(cut_out), [len(several) for several in windows]), losses


def measure(
    seeds: Sequence[int] = SEEDS, steps: int = 0, epochs: int = 0, rows: Sequence[str] = tuple(RECIPES)
) -> dict[str, Any]:
    """The default recipe with every seed, of the training and of the pieces; the thesis's with the first.

    Args:
        seeds: of each run.
        steps, epochs: of the second network and of the descriptors that "deephums" goes by; 0 are the default.
        rows: which of `RECIPES`.
    """
    known, test = split_of(SET, "train"), split_of(SET, "test")
    recipes = {row: RECIPES[row] for row in rows}
    runs: dict[str, dict[int, Found]] = {row: {} for row in recipes}
    for seed in seeds:
        pieces, training = cut(test.clips, seed), cut(known.clips, seed)
        guess = best_guess(training.ranges, _frames(known))
        located = overlaps(locate(pieces.pieces, test.clips), pieces.ranges)
        constant = overlaps(np.outer(_frames(test), guess), pieces.ranges).mean()
        for row, recipe in recipes.items():
            if recipe == "deephums" and seed != seeds[0]:
                continue
            config = SubmotionConfig(recipe=recipe, seed=seed)
            config = replace(config, steps=steps) if steps else config
            apart, losses = distances(known, test, pieces, config, epochs)
            found = ranks(apart)
            right = located[found == 0]
            runs[row][seed] = {
                "top1": float((found == 0).mean()),
                "top5": float((found < 5).mean()),
                "iou_source": float(located.mean()),
                "iou_hits": float(right.mean()) if len(right) else 0.0,
                "iou_constant": float(constant),
                "guess": list(guess),
                "steps": len(losses),
                "loss": [round(float(np.mean(some)), 6) for some in np.array_split(losses, min(PARTS, len(losses)))],
                "n": len(found),
            }
            print(f"  {row}, seed {seed}: {runs[row][seed]}", flush=True)
    found_rows = with_seeds(runs, lambda name: False)
    for row, found_row in found_rows.items():
        first = min(runs[row])
        found_row["mean"].pop("loss")
        found_row["loss"] = runs[row][first]["loss"]
    print(f"\n{table(SET, found_rows, SCORES)}")
    return found_rows


def _frames(split: Split) -> NDArray[np.int64]:
    return np.array([len(clip.positions) for clip in split.clips])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Pieces and their clips; `python -m bench.deephums` records it.")
    parser.add_argument("--steps", type=int, default=0)
    parser.add_argument("--epochs", type=int, default=0)
    parser.add_argument("--seeds", type=int, default=len(SEEDS))
    given = parser.parse_args()
    measure(range(given.seeds), given.steps, given.epochs)
