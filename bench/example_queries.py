"""Queries by example inside labelled takes, and the average precision of what answers them."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.deep_motifs.signatures import Corpus
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.config import load_config
from motionlake.lake.corpus import read_corpus
from motionlake.lake.layout import Lake
from motionlake.motion.features import WordConfig
from motionlake.motion.moves import Track
from motionlake.retrieval.protocol import Query as Asked
from motionlake.stages import words
from motionlake.stages.moves import read_tracks
from numpy.typing import NDArray
from sklearn.metrics import average_precision_score

EVERY: Final = 4
# The distances of a query's frames in every take: [T] each.
Scorer = Callable[["Query"], list[Float64Array]]


@dataclass(frozen=True)
class Query:
    """Words [first, first + words) of a clip, all of one label."""

    clip: int
    first: int
    words: int
    label: str


@dataclass(frozen=True)
class Takes:
    """Clips with features [T, D], labels [T] at the words' rate, "" where there is none, and tracks."""

    corpus: Corpus
    features: list[Float32Array]
    labels: list[NDArray[np.str_]]
    tracks: list[Track]
    config: WordConfig

    def asked(self, query: Query) -> Asked:
        """What a person would ask for."""
        at = self.corpus.offsets[query.clip] + query.first
        start, stop = self.corpus.starts[at], self.corpus.stops[at + query.words - 1]
        return Asked(self.corpus.clips[query.clip].clip, int(start), int(stop))

    def sampled(self, clip: int, along: Float64Array) -> Float64Array:
        """[T] values [F] of a clip's own frames at the words' rate."""
        rate = self.corpus.clips[clip].fps / self.config.fps
        at = np.round(np.arange(len(self.labels[clip])) * rate).astype(np.int64)
        return np.asarray(along[np.minimum(at, len(along) - 1)], dtype=np.float64)


def takes_of(lake: Lake, sources: Sequence[Path]) -> Takes:
    """What a lake holds of them, beside the labels of their frames: of segments.csv, or else those of clips."""
    config = load_config(lake.config_file)
    with reading(lake) as con:
        corpus = read_corpus(con)
        files = [lake.path(file) for file in words.features_files(con, config.words).values()]
        parts = {row["clip"]: row["part"] for row in fetch(con, "clips_with_parts")}
        tracks = read_tracks(lake, parts)
    features = {clip: rows for file in files for clip, rows in words.read_features(file)}
    rows = [
        (f"{source.name}/{row['file']}", row)
        for source in sources
        if (source / "segments.csv").exists()
        for row in csv.DictReader((source / "segments.csv").read_text(encoding="utf-8").splitlines())
    ]
    labels = []
    for clip in corpus.clips:
        instants = np.arange(len(features[clip.clip])) * (clip.fps / config.words.fps)
        found = np.full(len(instants), "" if rows else clip.label or "", dtype="U32")
        several = np.zeros(len(found), dtype=np.bool_)
        for _, row in (pair for pair in rows if pair[0] == clip.clip):
            within = (instants >= int(row["start"])) & (instants < int(row["stop"]))
            several |= within & (found != "") & (found != row["label"])
            found[within] = row["label"]
        found[several] = ""
        labels.append(found)
    names = [clip.clip for clip in corpus.clips]
    return Takes(corpus, [features[name] for name in names], labels, [tracks[name] for name in names], config.words)


def queries_of(takes: Takes, n_words: int, count: int | None = None) -> list[Query]:
    """Every window within one segment whose label another take has too, or so many of them, drawn by seed 0."""
    found = list(_queries(takes, n_words))
    if count is None or len(found) <= count:
        return found
    chosen = np.random.default_rng(0).choice(len(found), count, replace=False)
    return [found[i] for i in np.sort(chosen)]


def _queries(takes: Takes, n_words: int) -> Iterator[Query]:
    span, every = span_of(takes, n_words), max(1, EVERY // takes.config.stride)
    where: dict[str, set[int]] = {}
    for clip, labels in enumerate(takes.labels):
        for label in set(labels.tolist()) - {""}:
            where.setdefault(label, set()).add(clip)
    for clip, labels in enumerate(takes.labels):
        for first in range(0, (len(labels) - span) // takes.config.stride + 1, every):
            start = first * takes.config.stride
            found = set(labels[start : start + span].tolist())
            if len(found) == 1 and all(where.get(label, set()) - {clip} for label in found):
                yield Query(clip, first, n_words, found.pop())


def span_of(takes: Takes, n_words: int) -> int:
    """Frames that so many words cover."""
    return takes.config.length + takes.config.stride * (n_words - 1)


def mean_average_precision(takes: Takes, queries: Sequence[Query], scorer: Scorer) -> dict[str, float]:
    """Means over all queries, and over those of each label."""
    found: dict[str, list[float]] = {}
    for query in queries:
        others = [clip for clip in range(len(takes.labels)) if clip != query.clip]
        labels = np.concatenate([takes.labels[clip] for clip in others])
        scores = scorer(query)
        distances = np.concatenate([scores[clip] for clip in others])
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
