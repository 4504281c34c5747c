"""What the paper's network learns from: every word is an anchor with two kinds of positives (Deep Motifs, section 3.4).

The z words of its clip that are closest in time without overlap, whole clips being at hand; and its k nearest words by
DTW, of its own clip too where they do not overlap it, by the search that the stage "neighbours" uses. Negatives are
words of other clips, and words of its own that are far away in time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Int64Array
from motionlake.deep_motifs.config import NeighboursConfig
from motionlake.deep_motifs.words.neighbours import SearchConfig, search
from motionlake.deep_motifs.words.word_index import WordSet, fit_index
from motionlake.motion.dtw import Metric
from motionlake.motion.features import WordConfig, windows


@dataclass(frozen=True)
class Anchors:
    """N words, all words of some clips.

    Attributes:
        words: [N, length, D], clip by clip in the order of time.
        clips: [N] index of the clip each word is of.
        starts: [N] first frame in its clip.
        temporal: [N, z] words closest in time without overlap; the word itself where its clip is too short.
        nearest: [N, k] nearest words by DTW, without overlap; the word itself where there are none.
    """

    words: Float32Array
    clips: Int64Array
    starts: Int64Array
    temporal: Int64Array
    nearest: Int64Array

    def negatives(self, rows: Int64Array, far: int) -> BoolArray:
        """[b, b] which of some words count as negatives of which: those of other clips, and `far` frames away."""
        clips, starts = self.clips[rows], self.starts[rows]
        return np.asarray((clips[:, None] != clips) | (np.abs(starts[:, None] - starts) >= far))


def anchors(
    features: Sequence[Float32Array], words: WordConfig, temporal: int, nearest: int, *, threads: int = 1
) -> Anchors:
    """Cut clips into words and find their positives.

    Args:
        features: [T, D] of each clip.
        words: how words are cut, and which frame distance compares them.
        temporal, nearest: z and k.
        threads: of the search; the result does not depend on them.

    Raises:
        ValueError: no clips.
    """
    cut, clips = WordSet.of_clips(features, words)
    starts = np.concatenate([windows(len(clip), words) for clip in features])
    metric: Metric = "geodesic" if words.representation == "rotations" else "euclidean"
    how = SearchConfig(NeighboursConfig(nearest).chosen(len(cut)), metric, apart=words.length)
    # Words of one clip overlap where their first frames are less than a length apart, words of different clips never.
    found = search(fit_index(cut, cut.starts), cut, cut.starts, nearest, how, threads=threads).indices
    near = np.where(found >= 0, found, np.arange(len(cut))[:, None])
    return Anchors(cut.take(slice(None)), clips, starts, closest_in_time(clips, starts, words.length, temporal), near)


def closest_in_time(clips: Int64Array, starts: Int64Array, length: int, count: int) -> Int64Array:
    """[N, count] the words of each word's clip whose first frames are nearest to its own, a length away at least.

    Nearest first, the earlier of two that are as near. Where there are fewer they are repeated, and where there are
    none the word itself stands.

    Args:
        clips, starts: [N] the clip and the first frame of each word, clip by clip in the order of time.
        length: frames of a word.
        count: z.
    """
    found = np.repeat(np.arange(len(clips))[:, None], count, axis=1)
    edges = np.flatnonzero(np.diff(clips, prepend=-1, append=-1))
    for low, high in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        own = starts[low:high]
        before = np.searchsorted(own, own - length, side="right")  # words that end where this one starts, or sooner
        after = np.searchsorted(own, own + length, side="left")
        for word in range(len(own)):
            near = np.r_[max(before[word] - count, 0) : before[word], after[word] : after[word] + count]
            near = near[near < len(own)]
            order = near[np.argsort(np.abs(own[near] - own[word]), kind="stable")][:count]
            if len(order):
                found[low + word] = low + np.resize(order, count)
    return found


def split_clips(words: Sequence[int], most: int, held_out: float, seed: int) -> tuple[list[int], list[int]]:
    """Clips to train on and clips held out, drawn at random; every word of a clip goes with it.

    Args:
        words: how many each clip has.
        most: clips are drawn until they hold so many.
        held_out: share of the drawn clips, at least one.
        seed: of the draw.

    Raises:
        ValueError: fewer than two clips are drawn.
    """
    order = np.random.default_rng([seed, 3]).permutation(len(words)).tolist()
    reached = np.cumsum([words[clip] for clip in order])
    drawn = order[: int(np.searchsorted(reached, most)) + 1]
    if len(drawn) < 2:
        raise ValueError(
            f"{len(drawn)} clips with {reached[-1] if len(reached) else 0} words are too few: by recipe "
            '"deep_motifs" a network trains on some clips until its loss on others stops falling'
        )
    held = max(1, round(held_out * len(drawn)))
    return sorted(drawn[held:]), sorted(drawn[:held])
