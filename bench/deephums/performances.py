"""Real slow and fast performances, and pieces of clips: how far descriptors hold where no frames were resampled.

Clips of a set query all others of it. By tempo: of the clips of a query's class only those count whose duration is so
many times the query's, or the query's so many times theirs; all clips of other classes stay. By piece: a query is a
part of its clip, cut at random before anything is computed, and asked for among all other clips as they are.

- `descriptor, pretrained`: trained on CMU's recordings alone.
- `descriptor, no labels`: of the default recipe, trained on the half of the clips that does not ask, and answers (so
  its figures have fewer clips to find); the mean over both halves.
- `DTW of moves`, `DTW of joints`: alignment of whole clips, without training.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Float64Array
from motionlake.deephums.config import PRETRAINED_DESCRIPTORS, DescriptorsConfig
from motionlake.deephums.network import load_descriptor
from motionlake.deephums.sequence import alignment_distances, clip_sequence
from motionlake.deephums.training import TrainingClip, train_descriptor
from motionlake.evaluation.dtw import baseline_features
from motionlake.evaluation.ranking import Questions, score_split
from motionlake.motion.dtw import dtw_cross
from numpy.typing import NDArray

from bench.canonical_sets import LabelledClip, load
from bench.deephums.retrieval import euclidean

SETS: Final = ("hdm05", "bandai1", "utd_mhad")
TEMPOS: Final = (1.0, 1.25, 1.5, 2.0, float("inf"))
SHARES: Final = (0.75, 0.5, 0.25)
LEAST: Final = 8  # frames of a piece

Halves = NDArray[np.bool_]
Distances = Callable[["Asked"], Float64Array]


@dataclass(frozen=True)
class Asked:
    """Queries, one of each of n clips in their order, and the clips."""

    queries: Sequence[LabelledClip]
    clips: Sequence[LabelledClip]

    def sequences(self) -> tuple[list[Float32Array], list[Float32Array]]:
        """Of queries and of clips, as descriptors read them."""
        asked, known = ([clip_sequence(c.positions, c.fps) for c in clips] for clips in (self.queries, self.clips))
        return asked, known


def by_pretrained(asked: Asked) -> Float64Array:
    model = load_descriptor(PRETRAINED_DESCRIPTORS.file)
    queries, clips = asked.sequences()
    return euclidean(model.embed(queries), model.embed(clips))


def by_own(asked: Asked) -> Float64Array:
    """Infinite from queries to the clips of their own half, which took no part in training."""
    queries, clips = asked.sequences()
    found = np.full((len(queries), len(clips)), np.inf)
    first = np.isin(np.arange(len(clips)), np.random.default_rng(0).permutation(len(clips))[: len(clips) // 2])
    for half in (first, ~first):
        known, others = np.flatnonzero(half), np.flatnonzero(~half)
        model = train_descriptor([TrainingClip(clips[i]) for i in known], DescriptorsConfig(supervision="none"))
        apart = euclidean(model.embed([queries[i] for i in others]), model.embed([clips[i] for i in known]))
        found[np.ix_(others, known)] = apart
    return found


def by_moves(asked: Asked) -> Float64Array:
    queries, clips = asked.sequences()
    both = alignment_distances([*queries, *clips])
    return np.asarray(both[: len(queries), len(queries) :], np.float64)


def by_joints(asked: Asked) -> Float64Array:
    queries, clips = ([baseline_features(c.positions, c.fps) for c in clips] for clips in (asked.queries, asked.clips))
    return np.asarray(dtw_cross(queries, clips), np.float64)


METHODS: Final[Mapping[str, Distances]] = {
    "descriptor, pretrained": by_pretrained,
    "descriptor, no labels": by_own,
    "DTW of moves": by_moves,
    "DTW of joints": by_joints,
}


def cut(clip: LabelledClip, share: float, rng: np.random.Generator) -> LabelledClip:
    """So much of a clip, from a frame drawn at random."""
    frames = len(clip.positions)
    count = min(frames, max(LEAST, round(share * frames)))
    start = int(rng.integers(0, frames - count + 1))
    part = slice(start, start + count)
    return LabelledClip(
        clip.positions[part], clip.rotations[part], clip.fps, clip.label, clip.subject, clip.split, clip.name,
        clip.rest_offsets,
    )  # fmt: skip


def tempo_apart(clips: Sequence[LabelledClip]) -> Float64Array:
    """[n, n] how many times as long as the other the longer of two clips is."""
    seconds = np.array([len(clip.positions) / clip.fps for clip in clips])
    times = seconds[:, None] / seconds
    return np.asarray(np.maximum(times, 1 / times))


def scored(distances: Float64Array, labels: Sequence[str], counted: BoolArray | None = None) -> dict[str, float] | None:
    """Top-1 and MAP of distances [n, n] between queries and clips, none of its own clip nor of an infinite distance.

    Args:
        counted: [n, n] which clips of a query's class count; the others of it are no answers.

    Returns:
        None where no query has an answer.
    """
    same = np.equal.outer(np.array(labels), np.array(labels))
    may = ~np.eye(len(labels), dtype=np.bool_) & np.isfinite(distances)
    if counted is not None:
        may &= counted | ~same
    questions = Questions.of(labels, labels, may)
    if not len(questions.scored):
        return None
    found = score_split(distances, questions)
    return {"top1": found.top1, "map": found.map, "n": found.n}


def by_tempo(distances: Float64Array, labels: Sequence[str], times: Float64Array) -> dict[str, dict[str, float]]:
    """{range: scores}, of those that hold answers, and of all."""
    ranges = {f"{a:g} to {b:g}": (times >= a) & (times < b) for a, b in itertools.pairwise(TEMPOS)}
    found = {which: scored(distances, labels, counted) for which, counted in ranges.items()}
    return {which: scores for which, scores in {**found, "all": scored(distances, labels)}.items() if scores}


def by_piece(distances: Distances, clips: Sequence[LabelledClip], seeds: Sequence[int]) -> dict[str, dict[str, float]]:
    """{share: scores}, means over the seeds of where pieces are cut."""
    labels, runs = [clip.label for clip in clips], {share: list[dict[str, float]]() for share in SHARES}
    for seed, (share, of) in itertools.product(seeds, runs.items()):
        rng = np.random.default_rng(seed)
        if scores := scored(distances(Asked([cut(clip, share, rng) for clip in clips], clips)), labels):
            of.append(scores)
    return {
        f"{share:g}": {key: float(np.mean([run[key] for run in of])) for key in of[0]}
        for share, of in runs.items()
        if of
    }


def measure(names: Sequence[str], seeds: Sequence[int]) -> dict[str, Any]:
    """{set: {"tempo": {method: {range: scores}}, "piece": {method: {share: scores}}}}."""
    found: dict[str, Any] = {}
    for name in names:
        clips = load(name)
        labels, times = [clip.label for clip in clips], tempo_apart(clips)
        found[name] = {"tempo": {}, "piece": {}}
        for method, distances in METHODS.items():
            tempos = by_tempo(distances(Asked(clips, clips)), labels, times)
            pieces = by_piece(distances, clips, seeds)
            found[name]["tempo"][method], found[name]["piece"][method] = tempos, pieces
            print(f"{name}, {method}, MAP by tempo {_said(tempos)}, by piece {_said(pieces)}", flush=True)
    return found


def _said(found: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    return {which: round(scores["map"], 3) for which, scores in found.items()}
