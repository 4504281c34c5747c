"""What the pictures of a lake are made from, read once, and what is shown where not all can be."""

from __future__ import annotations

import hashlib
import os
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array, IntArray
from motionlake.deep_motifs.classification import cluster_clips
from motionlake.deep_motifs.emd import emd_matrix
from motionlake.deep_motifs.signatures import Corpus
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.corpus import read_corpus
from motionlake.lake.integrity import sound_folder
from motionlake.lake.layout import Lake
from motionlake.pictures.bands import MotifBand, Segment, word_edges
from motionlake.pictures.motif_figures import motif_order
from motionlake.pictures.stick_figures import PoseReader
from motionlake.pictures.style import UNLABELLED, motif_colours

MOST_ON_MAP: Final = 180
CLUSTERS: Final = 6
ALL: Final = "all clips"


@dataclass(frozen=True)
class Word:
    """A word by its clip and half-open frames."""

    clip: str
    start: int
    stop: int


@dataclass(frozen=True)
class Material:
    """A lake, or one of its datasets.

    Attributes:
        corpus: n clips, K motifs.
        signatures: [n, K] as the lake holds them.
        segments: labelled stretches by clip, in seconds; clips without any are missing.
        poses: reads stick figures.
    """

    con: Connection
    lake: Lake
    corpus: Corpus
    signatures: Float32Array
    segments: dict[str, list[Segment]]
    poses: PoseReader

    @cached_property
    def order(self) -> Int64Array:
        """[K] motifs, similar ones side by side: the same in every picture."""
        return motif_order(self.corpus.centroids)

    @cached_property
    def colours(self) -> Float64Array:
        """[K, 3]."""
        return motif_colours(self.order)

    @property
    def about_model(self) -> str:
        return f"{self.corpus.model}, {len(self.corpus.idf)} motifs"

    def seconds(self, clip: int) -> float:
        return self.corpus.clips[clip].frames / self.corpus.clips[clip].fps

    def names(self, clips: Iterable[int]) -> list[str]:
        """Full names of clips (corpus indices)."""
        return [self.corpus.clips[i].clip for i in clips]

    def short_names(self, clips: Iterable[int]) -> list[str]:
        """Names of clips without the folders that all of them share."""
        names = self.names(clips)
        if len(names) < 2:
            return [name.rpartition("/")[2] or name for name in names]
        shared = os.path.commonpath([name.rpartition("/")[0] for name in names])
        return [name[len(shared) + 1 :] if shared else name for name in names]

    def some(self, clips: Sequence[int], count: int) -> list[int]:
        """At most `count` of some clips (corpus indices), the same ones every time (`sampled`)."""
        return [clips[i] for i in sampled(self.names(clips), count)]

    def source(self, word: Word) -> tuple[str, str]:
        """The file of a word, and when in it."""
        fps = self.corpus.clips[self.corpus.positions[word.clip]].fps
        return word.clip.rpartition("/")[2], f", {word.start / fps:.1f}–{word.stop / fps:.1f} s"

    def counts(self, clips: IntArray) -> Int64Array:
        """[clips, K] how many words of each clip belong to each motif."""
        k = len(self.corpus.idf)
        return np.array([np.bincount(self.corpus.motifs[self.corpus.words_of(i)], minlength=k) for i in clips])

    def band(self, clip: int, name: str) -> MotifBand:
        words, known = self.corpus.words_of(clip), self.corpus.clips[clip]
        edges = word_edges(self.corpus.starts[words], self.corpus.stops[words], known.fps)
        return MotifBand(name, self.corpus.motifs[words], edges, self.signatures[clip])

    def nearest_words(self, motifs: list[int], clips: list[str]) -> dict[int, list[Word]]:
        """For each motif, the word of each of the clips that is closest to its centroid, closest first."""
        found: dict[int, list[Word]] = {motif: [] for motif in motifs}
        files = [str(file) for file in sound_folder(self.lake, "embeddings")]
        for row in fetch(self.con, "nearest_words", {"motifs": motifs, "clips": clips, "embeddings": files}):
            found[row["motif"]].append(Word(row["clip"], row["start"], row["stop"]))
        return found


def read_material(con: Connection, lake: Lake, dataset: str | None = None) -> Material:
    """Read what pictures of a lake, or of one of its datasets, are made from.

    Raises:
        UserError: no motifs or no signed clips yet (`read_corpus`).
    """
    corpus = read_corpus(con, dataset)
    rows = fetch(con, "signatures_of", {"dataset": dataset})
    signatures = np.array([row["signature"] for row in rows], dtype=np.float32)
    segments: dict[str, list[Segment]] = defaultdict(list)
    for row in fetch(con, "segments_of", {"dataset": dataset}):
        if row["clip"] in corpus.positions:
            fps = corpus.clips[corpus.positions[row["clip"]]].fps
            segments[row["clip"]].append(Segment(row["start"] / fps, row["stop"] / fps, row["label"]))
    return Material(con, lake, corpus, signatures, dict(segments), PoseReader(con, lake))


@dataclass(frozen=True)
class View:
    """The clips of a lake or dataset that one part of the report speaks of.

    Attributes:
        name: of the dataset, or "all datasets".
        total: how many clips there are in all.
        clips: [n] indices of those that classes are known of, by name.
        classes: [n] label or cluster of each.
        kind: "class", "cluster" or "dataset".
        shown: [s] positions in `clips` of those on the map.
        distances: [s, s] of their signatures.
    """

    name: str
    total: int
    clips: Int64Array
    classes: list[str]
    kind: str
    shown: Int64Array
    distances: Float64Array

    @property
    def plural(self) -> str:
        return "classes" if self.kind == "class" else f"{self.kind}s"

    @property
    def shown_classes(self) -> list[str]:
        return [self.classes[i] for i in self.shown]

    @property
    def about_clusters(self) -> str:
        """What clusters are, where there are clusters in place of classes."""
        if self.kind != "cluster":
            return ""
        if set(self.classes) == {ALL}:
            return " The clips have no labels."
        return " The clips have no labels: the clusters are k-means on their distances (MDS), numbered by size."

    def by_class(self) -> dict[str, list[int]]:
        """Clips (corpus indices) of each class, classes by name, unlabelled ones last."""
        groups: dict[str, list[int]] = {n: [] for n in sorted(self.classes, key=lambda n: (n == UNLABELLED, n))}
        for clip, name in zip(self.clips.tolist(), self.classes, strict=True):
            groups[name].append(clip)
        return groups


def sampled(names: Sequence[str], count: int) -> Int64Array:
    """At most `count` positions, ascending: those whose names hash lowest, so the same ones every time."""
    order = sorted(range(len(names)), key=lambda i: (hashlib.md5(names[i].encode()).hexdigest(), names[i]))
    return np.array(sorted(order[:count]), dtype=np.int64)


def dataset_view(material: Material, dataset: str) -> View:
    """The clips of a dataset by their labels; where none has a label, a sample of them by clusters."""
    corpus = material.corpus
    clips = np.array([i for i, c in enumerate(corpus.clips) if c.dataset == dataset], dtype=np.int64)
    shown = sampled(material.names(clips), MOST_ON_MAP)
    distances = emd_matrix(material.signatures[clips[shown]], corpus.ground)
    if any(corpus.clips[i].label for i in clips):
        classes = [corpus.clips[i].label or UNLABELLED for i in clips]
        return View(dataset, len(clips), clips, classes, "class", shown, distances)
    clusters = _clustered(distances)
    return View(dataset, len(clips), clips[shown], clusters, "cluster", np.arange(len(shown)), distances)


def lake_view(material: Material) -> View:
    """All clips by their dataset; each dataset has its part of the sample on the map."""
    datasets = [c.dataset for c in material.corpus.clips]
    members = {d: [i for i, other in enumerate(datasets) if other == d] for d in sorted(set(datasets))}
    each = _fair_share([len(clips) for clips in members.values()], MOST_ON_MAP)
    shown = np.array(sorted(i for clips in members.values() for i in material.some(clips, each)), dtype=np.int64)
    distances = emd_matrix(material.signatures[shown], material.corpus.ground)
    return View("all datasets", len(datasets), np.arange(len(datasets)), datasets, "dataset", shown, distances)


def _fair_share(sizes: Sequence[int], total: int) -> int:
    """How many each may have at most so that all have about `total`: those of fewer leave theirs to others."""
    for i, size in enumerate(sorted(sizes)):
        each = total // (len(sizes) - i)
        if size > each:
            return max(each, 1)
        total -= size
    return max(sizes)


def _clustered(distances: Float64Array) -> list[str]:
    """[n] clusters of clips without labels (section 4.3), the largest first."""
    k = min(CLUSTERS, len(distances) // 4, len(np.unique(distances, axis=0)) - 1)
    if k < 2:
        return [ALL] * len(distances)
    return [f"cluster {i + 1}" for i in cluster_clips(distances, k).clusters.tolist()]


def shares(material: Material, view: View) -> dict[str, Float64Array]:
    """[K] share of the words of each class that belong to each motif (section 5.2, figure 5)."""
    counts = {name: material.counts(np.array(clips)).sum(axis=0) for name, clips in view.by_class().items()}
    return {name: own / own.sum() for name, own in counts.items()}


def discriminative(by_class: dict[str, Float64Array]) -> list[tuple[str, int]]:
    """For each class the motif that stands for it: common in the class, and in few others.

    A motif's score is its share in the class times that share over the sum of its shares in all classes.
    """
    table = np.stack([*by_class.values()])
    score = table**2 / np.maximum(table.sum(axis=0), 1e-300)
    return list(zip(by_class, score.argmax(axis=1).tolist(), strict=True))


def count_of(number: int, total: int) -> str:
    """So many clips of so many, if not all."""
    if number == total:
        return "1 clip" if total == 1 else f"{total} clips"
    return f"{number} of {total} clips (the same ones every time)"
