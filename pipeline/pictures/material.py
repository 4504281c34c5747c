"""What the pictures of a lake are made from, read once."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array, IntArray
from motionlake.deep_motifs.corpus import Corpus
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.corpus import read_corpus
from motionlake.lake.layout import Lake
from motionlake.pictures.bands import MotifBand, Segment, word_edges
from motionlake.pictures.signature_bars import motif_order
from motionlake.pictures.stick_figures import Poses
from motionlake.pictures.style import motif_colours


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
    corpus: Corpus
    signatures: Float32Array
    segments: dict[str, list[Segment]]
    poses: Poses

    @cached_property
    def order(self) -> Int64Array:
        """[K] motifs, similar ones side by side: the same in every picture."""
        return motif_order(self.corpus.centroids)

    @cached_property
    def colours(self) -> Float64Array:
        """[K, 3]."""
        return motif_colours(self.order)

    def seconds(self, clip: int) -> float:
        return self.corpus.clips[clip].frames / self.corpus.clips[clip].fps

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
        for row in fetch(self.con, "nearest_words", {"motifs": motifs, "clips": clips}):
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
    return Material(con, corpus, signatures, dict(segments), Poses(con, lake))
