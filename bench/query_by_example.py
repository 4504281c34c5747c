"""Query by example inside sequences beside sub-sequence DTW: `python -m bench.query_by_example [--words N]`.

cmu_exercises, in a lake of its own with the default configuration but for the seeds: windows of 5 words that lie
wholly within a labelled segment are queries against the other takes, if their label occurs in one, a window every
`EVERY` frames. `--words 11` are the 32 frames of the paper's five longer words. The
score of a frame is the distance of the nearest window that covers it; relevant are frames labelled like the
query; frames without a label (there are next to none) are left out. Average precision over all frames of the
other takes at the words' rate, tied frames together; means over the queries, then over 3 seeds of network and
k-means. The network is trained on the takes, or is the pretrained one, trained without them.

DTW aligns the query's frames (the same features) anywhere in a take; the score of a frame is the cost of the
cheapest alignment that covers it, over its matched pairs. Four forms are measured, and the best is the bar.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.deep_motifs.query_by_example import ExampleQuery, distances_along, window_ranges
from motionlake.deep_motifs.signatures import Corpus
from motionlake.lake.catalog import reading
from motionlake.lake.config import load_config
from motionlake.lake.corpus import read_corpus
from motionlake.lake.layout import Lake
from motionlake.motion.dtw import STEPS, alignment_ends
from motionlake.motion.features import WordConfig
from motionlake.stages import words
from numpy.typing import NDArray
from sklearn.metrics import average_precision_score

from bench.lakes import make_lake, run_all
from bench.pretrained_words import pretrained_for
from bench.record import hash_files, record, recordings

SEEDS: Final = (0, 1, 2)
READY: Final = "motionlake, pretrained weights"
EVERY: Final = 4
# The distances of a query's frames in one take from another take: [T].
Scorer = Callable[["Query", int], Float64Array]


@dataclass(frozen=True)
class Query:
    """Words [first, first + words) of a clip, all of one label."""

    clip: int
    first: int
    words: int
    label: str


@dataclass(frozen=True)
class Takes:
    """Clips with features [T, D] and labels [T] at the words' rate; "" where there is none."""

    corpus: Corpus
    features: list[Float32Array]
    labels: list[NDArray[np.str_]]
    config: WordConfig


def takes_of(lake: Lake, segments: Path) -> Takes:
    """What a lake holds of them, beside the labels of their frames."""
    config = load_config(lake.config_file).words
    with reading(lake) as con:
        corpus = read_corpus(con)
        files = [lake.path(file) for file in words.features_files(con, config).values()]
    features = {clip: rows for file in files for clip, rows in words.read_features(file)}
    with segments.open(newline="", encoding="utf-8") as handle:
        rows = list(csv.DictReader(handle))
    labels = []
    for clip in corpus.clips:
        instants = np.arange(len(features[clip.clip])) * (clip.fps / config.fps)
        found = np.full(len(instants), "", dtype="U32")
        for row in rows:
            if clip.clip.endswith("/" + row["file"]):
                found[(instants >= int(row["start"])) & (instants < int(row["stop"]))] = row["label"]
        labels.append(found)
    return Takes(corpus, [features[clip.clip] for clip in corpus.clips], labels, config)


def queries_of(takes: Takes, n_words: int) -> Iterator[Query]:
    """Every window within one segment whose label another take has too."""
    span, every = _span(takes, n_words), max(1, EVERY // takes.config.stride)
    for clip, labels in enumerate(takes.labels):
        elsewhere = {label for i, other in enumerate(takes.labels) if i != clip for label in other}
        for first in range(0, (len(labels) - span) // takes.config.stride + 1, every):
            start = first * takes.config.stride
            found = set(labels[start : start + span].tolist())
            if len(found) == 1 and found <= elsewhere - {""}:
                yield Query(clip, first, n_words, found.pop())


def _span(takes: Takes, n_words: int) -> int:
    """Frames that so many words cover."""
    return takes.config.length + takes.config.stride * (n_words - 1)


def frame_distances_along(corpus: Corpus, clip: int, query: ExampleQuery) -> Float64Array:
    """[F] distance of the nearest window that covers each frame of a clip; beyond its last word, that word's."""
    frames = np.full(corpus.clips[clip].frames, np.inf)
    ranges = window_ranges(corpus, clip, query.n_words)
    for (start, stop), distance in zip(ranges, distances_along(corpus, clip, query), strict=True):
        np.minimum(frames[start:stop], distance, out=frames[start:stop])
    known = np.flatnonzero(np.isfinite(frames))
    frames[known[-1] + 1 :] = frames[known[-1]]
    return frames


def motionlake(takes: Takes) -> Scorer:
    """The signature of the query's words, as `motionlake find` compares it."""

    def score(query: Query, clip: int) -> Float64Array:
        motifs = takes.corpus.motifs[takes.corpus.words_of(query.clip)][query.first : query.first + query.words]
        along = frame_distances_along(takes.corpus, clip, ExampleQuery(motifs))
        rate = takes.corpus.clips[clip].fps / takes.config.fps
        at = np.round(np.arange(len(takes.labels[clip])) * rate).astype(np.int64)
        return np.asarray(along[np.minimum(at, len(along) - 1)], dtype=np.float64)

    return score


def dtw(takes: Takes, steps: str, squared: bool) -> Scorer:
    """The frames of the query's words, aligned."""

    def score(query: Query, clip: int) -> Float64Array:
        start = query.first * takes.config.stride
        frames = takes.features[query.clip][start : start + _span(takes, query.words)]
        return frame_costs(*alignment_ends(frames, takes.features[clip], steps, squared=squared))

    return score


def frame_costs(costs: Float64Array, starts: NDArray[np.int64]) -> Float64Array:
    """[T] cost of the cheapest alignment that covers each frame; where none does, that of the dearest."""
    covered = np.full(len(costs), np.inf)
    for end in range(len(costs)):
        span = covered[starts[end] : end + 1]
        np.minimum(span, costs[end], out=span)
    covered[~np.isfinite(covered)] = np.max(covered[np.isfinite(covered)], initial=0.0)
    return covered


def mean_average_precision(takes: Takes, queries: Sequence[Query], scorer: Scorer) -> dict[str, float]:
    """Means over all queries, and over those of each label."""
    found: dict[str, list[float]] = {}
    for query in queries:
        others = [clip for clip in range(len(takes.labels)) if clip != query.clip]
        labels = np.concatenate([takes.labels[clip] for clip in others])
        distances = np.concatenate([scorer(query, clip) for clip in others])
        known = labels != ""
        precision = average_precision_score(labels[known] == query.label, -distances[known])
        found.setdefault(query.label, []).append(float(precision))
    every = [value for values in found.values() for value in values]
    return {"mean": float(np.mean(every))} | {label: float(np.mean(found[label])) for label in sorted(found)}


def chance(takes: Takes, queries: Sequence[Query]) -> float:
    """The share of relevant frames, mean over queries."""
    shares = []
    for query in queries:
        labels = np.concatenate([found for clip, found in enumerate(takes.labels) if clip != query.clip])
        shares.append(np.mean(labels[labels != ""] == query.label))
    return float(np.mean(shares))


def main() -> None:
    parser = argparse.ArgumentParser(description="Measure query by example beside sub-sequence DTW.")
    parser.add_argument("--words", type=int, default=5)
    n_words = parser.parse_args().words
    source = recordings() / "cmu_exercises"
    ours: dict[str, list[dict[str, float]]] = {"motionlake": [], READY: []}
    with tempfile.TemporaryDirectory(prefix="bench-find-") as folder:
        lake = make_lake(Path(folder), [source])
        ready = pretrained_for(source.name, Path(folder))
        for seed in SEEDS:
            for origin, weights in ((READY, ready), ("motionlake", None)):
                run_all(lake, seed, weights)
                takes = takes_of(lake, source / "segments.csv")
                queries = list(queries_of(takes, n_words))
                ours[origin].append(mean_average_precision(takes, queries, motionlake(takes)))
                print(f"seed {seed}, {origin}, {len(queries)} queries: {_line(ours[origin][-1])}", flush=True)
    figures = {
        origin: {name: float(np.mean([r[name] for r in runs])) for name in runs[0]} for origin, runs in ours.items()
    }
    for steps in STEPS:
        for squared in (False, True):
            name = f"sub-sequence DTW, {steps} steps, {'squared ' if squared else ''}distances"
            figures[name] = mean_average_precision(takes, queries, dtw(takes, steps, squared))
    print("\nmeans")
    for name, scores in figures.items():
        print(f"  {name:50} {_line(scores)}")
    bar = max(scores["mean"] for name, scores in figures.items() if name not in ours)
    print(f"  bar {bar:.3f}: {'met' if figures['motionlake']['mean'] > bar else 'MISSED'}")
    by_seed = {origin: [run["mean"] for run in runs] for origin, runs in ours.items()}
    result = {"average_precision": figures, "chance": chance(takes, queries), "by_seed": by_seed}
    data = hash_files([*source.rglob("*.amc"), source / "segments.csv"], source)
    print(record("query-by-example", result | {"queries": len(queries), "words": n_words, "seeds": list(SEEDS)}, data))


def _line(scores: dict[str, float]) -> str:
    return "  ".join(f"{name} {value:.3f}" for name, value in scores.items())


if __name__ == "__main__":
    main()
