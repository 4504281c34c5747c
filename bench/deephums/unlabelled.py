"""Descriptors without labels: constants chosen with one set left out in turn, and the pretrained ones.

Half of the clips of a set, drawn four times by seed, is trained on, and the others query it: mean of top-1 and of mean
average precision. For every set those constants are taken that are best in the mean over the other sets. Two sets have
a split by subjects, which is measured too and never chosen by; every set but CMU's, whose clips the pretrained weights
have seen, leave-one-out by the pretrained descriptors as well.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, replace
from typing import Any, Final
from unittest import mock

import numpy as np
from motionlake.arrays import Float32Array, FloatArray
from motionlake.deephums import neighbourhood, sketch, training
from motionlake.deephums.config import PRETRAINED_DESCRIPTORS, DescriptorsConfig
from motionlake.deephums.network import load_descriptor
from motionlake.deephums.recipes import WITHOUT
from motionlake.deephums.sequence import clip_sequence
from motionlake.deephums.training import TrainingClip, train_descriptor
from motionlake.evaluation.ranking import Questions, score_split
from numpy.typing import NDArray

from bench.canonical_sets import load
from bench.deephums.retrieval import euclidean

DRAWS: Final = 4
SCORES: Final = ("top1", "top10", "map", "n")
SKETCHES: Final = ((5.0, (1.0, 2.0, 0.8)), (4.0, (0.5, 2.0, 0.8)), (4.0, (0.3, 2.0, 0.3)))
BREADTHS: Final = (0.01, 0.015, 0.025, 0.05)
RIDGES: Final = (0.03, 0.3)
JOINED: Final = (5, 6, 8)


@dataclass(frozen=True)
class Constants:
    """Of sketches (`sketch.BREADTH`, `sketch.COUNTS`) and of neighbourhoods."""

    in_time: float
    counts: tuple[float, ...]
    breadth: float
    ridge: float
    joined: int

    @contextmanager
    def in_use(self) -> Iterator[None]:
        with ExitStack() as stack:
            for module, names in (
                (sketch, {"BREADTH": self.in_time, "COUNTS": self.counts}),
                (neighbourhood, {"BREADTH": self.breadth, "RIDGE": self.ridge}),
            ):
                stack.enter_context(mock.patch.multiple(module, **names))
            yield


NOW: Final = Constants(sketch.BREADTH, sketch.COUNTS, neighbourhood.BREADTH, neighbourhood.RIDGE, WITHOUT.neighbours)


def every_choice() -> list[Constants]:
    """Those in use first."""
    others = itertools.product(SKETCHES, BREADTHS, RIDGES, JOINED)
    return list(
        dict.fromkeys([NOW, *(Constants(*of, breadth, ridge, joined) for of, breadth, ridge, joined in others)])
    )


@dataclass(frozen=True)
class Clips:
    """Of one set, in the order of its labels file."""

    sequences: list[Float32Array]
    labels: list[str]
    split: list[str]

    @staticmethod
    def of(name: str) -> Clips:
        clips = load(name)
        sequences = [clip_sequence(clip.positions, clip.fps) for clip in clips]
        return Clips(sequences, [clip.label for clip in clips], [clip.split for clip in clips])

    def halves(self) -> list[NDArray[np.bool_]]:
        """[n] which clips are trained on, for each draw."""
        rng, count = np.random.default_rng(0), len(self.labels)
        return [np.isin(np.arange(count), rng.permutation(count)[: count // 2]) for _ in range(DRAWS)]


def scored(clips: Clips, known: NDArray[np.bool_], how: Constants) -> dict[str, float]:
    """Of the clips that are not known among those that are, trained on these without their labels."""
    at, others = np.flatnonzero(known).tolist(), np.flatnonzero(~known).tolist()
    recipe = replace(WITHOUT, neighbours=how.joined)
    with how.in_use():
        made = train_descriptor(
            [TrainingClip(clips.sequences[i]) for i in at], DescriptorsConfig(supervision="none"), recipe=recipe
        )
        rows = made.embed(clips.sequences)
    questions = Questions.of([clips.labels[i] for i in others], [clips.labels[i] for i in at])
    return _scores(euclidean(rows[others], rows[at]), questions)


def pretrained(clips: Clips) -> dict[str, dict[str, float]]:
    """Leave-one-out, and by the split where there is one."""
    rows = load_descriptor(PRETRAINED_DESCRIPTORS.file).embed(clips.sequences)
    itself = np.eye(len(rows), dtype=np.bool_)
    questions = Questions.of(clips.labels, clips.labels, ~itself)
    found = {"leave-one-out": _scores(euclidean(rows, rows), questions)}
    known = np.array([split == "train" for split in clips.split])
    if known.any():
        asked, kept = np.flatnonzero(~known), np.flatnonzero(known)
        questions = Questions.of([clips.labels[i] for i in asked], [clips.labels[i] for i in kept])
        found["split"] = _scores(euclidean(rows[asked], rows[kept]), questions)
    return found


def _scores(distances: FloatArray, questions: Questions) -> dict[str, float]:
    found = asdict(score_split(distances, questions))
    return {key: float(found[key]) for key in SCORES}


def measure(names: Sequence[str]) -> dict[str, Any]:
    """Top-1, top-10 and MAP of each set: constants chosen on the others, those in use, pretrained."""
    choices = every_choice()
    halves: dict[Constants, dict[str, dict[str, float]]] = {how: {} for how in choices}
    by_split: dict[Constants, dict[str, dict[str, float]]] = {how: {} for how in choices}
    ready: dict[str, Any] = {}
    for name in names:
        clips = Clips.of(name)
        ready[name] = pretrained(clips)
        with mock.patch.object(training, "neighbourhoods", _remembered()):
            for how in choices:
                draws = [scored(clips, known, how) for known in clips.halves()]
                halves[how][name] = {key: float(np.mean([draw[key] for draw in draws])) for key in draws[0]}
                known = np.array([split == "train" for split in clips.split])
                if known.any():
                    by_split[how][name] = scored(clips, known, how)
        print(f"{name}: in use {_said(halves[NOW][name])}, pretrained {ready[name]}", flush=True)
    left_out = {}
    for name in names:
        how = _best(halves, [other for other in names if other != name] or [name])
        left_out[name] = {"constants": asdict(how), "halves": halves[how][name], "split": by_split[how].get(name)}
        print(f"{name} left out: {how}, {_said(left_out[name])}", flush=True)
    chosen = _best(halves, names)
    return {
        "left out": left_out,
        "best on all": asdict(chosen),
        "in use": {"constants": asdict(NOW), "halves": halves[NOW], "split": by_split[NOW]},
        "pretrained": ready,
        "by constants": {
            str(how): {name: [found["top1"], found["map"]] for name, found in of.items()} for how, of in halves.items()
        },
    }


def _best(scores: Mapping[Constants, Mapping[str, Mapping[str, float]]], names: Sequence[str]) -> Constants:
    """With the greatest mean of top-1 and MAP over some sets; of equal ones the first."""
    return max(scores, key=lambda how: sum(scores[how][name]["top1"] + scores[how][name]["map"] for name in names))


def _remembered() -> Any:
    """`neighbourhoods`, each worked out once: sketches have no part in it."""
    known: dict[tuple[int, ...], Float32Array] = {}

    def found(clips: Sequence[Float32Array], joined: int, progress: object = None) -> Float32Array:
        of = (joined, *(hash(clip.tobytes()) for clip in clips))
        if of not in known:
            known[of] = neighbourhood.neighbourhoods(clips, joined)
        return known[of]

    return found


def _said(found: Mapping[str, Any]) -> str:
    return str({key: round(value, 4) if isinstance(value, float) else value for key, value in found.items()})
