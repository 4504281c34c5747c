"""What recipe "metric" learns from: anchors, their positives and negatives (after Deep Motifs, section 3.4).

Positives of an anchor are its k nearest words in *other* clips, and time-warped copies of itself. Negatives are words
farther than a share of the median word distance: words drawn blindly are too often of the same action, and pushing
those away teaches the network who moves and when instead of what. What the paper draws is in
`motionlake.deep_motifs.words.positives`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Int64Array
from motionlake.deep_motifs.words.dtw import word_distances
from motionlake.deep_motifs.words.linear import LinearConfig, linear_embedding
from motionlake.motion.dtw import Metric, frame_distances
from motionlake.motion.features import WordConfig, windows, word_windows


@dataclass(frozen=True)
class TripletConfig:
    """How training material is drawn.

    Attributes:
        nearest: k, positives nearest by word distance in other clips.
        anchors: words whose distances from all words are computed.
        far: negatives lie beyond this share of the median word distance.
        neighbourhood: share of all words that count as an anchor's neighbourhood when pairs are drawn.
        elastic: share of DTW in the word distance; the rest is the distance in the linear embedding.
    """

    nearest: int = 5
    anchors: int = 1500
    far: float = 0.6
    neighbourhood: float = 0.02
    elastic: float = 0.5


@dataclass(frozen=True)
class TrainingWords:
    """N words, A of them anchors with known distances from all.

    Attributes:
        words: [N, length, D].
        clips: [N] index of the clip each word is of.
        starts: [N] first frame in its clip.
        anchors: [A] indices of words, ascending.
        distances: [A, N] word distances (`_distances`); their median is 1.
        linear: [d, length * D] `linear_embedding` of flattened words.
        nearest: [A, k] nearest words of other clips; the anchor itself where there are none.
        neighbours: [A, h] the nearest words of any clip, the anchor left out.
    """

    words: Float32Array
    clips: Int64Array
    starts: Int64Array
    anchors: Int64Array
    distances: Float32Array
    linear: Float32Array
    nearest: Int64Array
    neighbours: Int64Array


def training_words(
    features: list[Float32Array],
    words: WordConfig,
    config: TripletConfig,
    linear: LinearConfig,
    max_words: int,
    seed: int,
) -> TrainingWords:
    """Cut clips into words, draw anchors and find their positives.

    Args:
        features: [T, D] of each clip.
        words: how words are cut, and which frame distance compares them.
        config, linear: what is drawn, and how the linear embedding is learned.
        max_words: at most this many words are kept, drawn at random.
        seed: of every draw.

    Raises:
        ValueError: fewer than two words.
    """
    stacked, clips, starts = sample_words(features, words, max_words, seed)
    rng = np.random.default_rng([seed, 1])
    anchors = np.sort(rng.permutation(len(clips))[: config.anchors])
    metric: Metric = "geodesic" if words.representation == "rotations" else "euclidean"
    projection = linear_embedding(stacked, clips, linear, seed)
    distances = _distances(stacked, anchors, projection, metric, config.elastic)
    elsewhere = _nearest(distances, anchors, clips[anchors][:, None] != clips, config.nearest)
    count = max(config.nearest, round(config.neighbourhood * len(clips)))
    neighbours = _nearest(distances, anchors, np.arange(len(clips)) != anchors[:, None], count)
    return TrainingWords(stacked, clips, starts, anchors, distances, projection, elsewhere, neighbours)


def sample_words(
    features: list[Float32Array], words: WordConfig, max_words: int, seed: int
) -> tuple[Float32Array, Int64Array, Int64Array]:
    """At most `max_words` words drawn at random from clips: [n, length, D] words, [n] clips, [n] first frames.

    Raises `ValueError` for fewer than two words.
    """
    counts = [len(windows(len(clip), words)) for clip in features]
    if sum(counts) < 2:
        raise ValueError(f"{sum(counts)} words are too few to train a word network")
    kept = np.sort(np.random.default_rng(seed).permutation(sum(counts))[:max_words])
    clips = np.repeat(np.arange(len(features)), counts)[kept].astype(np.int64)
    starts = np.concatenate([windows(len(f), words) for f in features])[kept]
    ends = np.cumsum(counts)
    stacked = np.empty((len(kept), words.length, features[0].shape[1]), dtype=np.float32)
    for i, clip in enumerate(features):
        rows = slice(*np.searchsorted(clips, [i, i + 1]))
        stacked[rows] = word_windows(clip, words)[kept[rows] - (ends[i] - counts[i])]
    return stacked, clips, starts


def time_warped(words: Float32Array, rng: np.random.Generator, strength: float = 0.5) -> Float32Array:
    """Copies of `words` [n, length, D] played along random smooth monotone curves with fixed ends.

    A curve is t + s sin(pi t) + r sin(2 pi t) / 2 over t in [0, 1] with |s| + |r| <= strength / pi: speeds
    stay within 1 +- strength of the original.
    """
    n, length, _ = words.shape
    time = np.linspace(0, 1, length)
    s, r = rng.uniform(-1, 1, (2, n, 1)) * (strength / (2 * np.pi))
    curve = time + s * np.sin(np.pi * time) + r * np.sin(2 * np.pi * time) / 2
    place = np.clip(curve, 0, 1) * (length - 1)
    below = np.minimum(place.astype(np.int64), max(length - 2, 0))
    weight = (place - below)[..., None].astype(np.float32)
    rows = np.arange(n)[:, None]
    first, second = words[rows, below], words[rows, np.minimum(below + 1, length - 1)]
    return np.asarray(first + weight * (second - first), dtype=np.float32)


def time_reversed(words: Float32Array, config: WordConfig) -> Float32Array:
    """Words [n, length, D] played backwards: positions and rotations in reverse order, velocities negated too."""
    turned = words[:, ::-1].copy()
    if config.representation == "positions":
        turned[:, :, 3 * len(config.joint_indices) :] *= -1
    return turned


def copies(words: Float32Array, rng: np.random.Generator, config: WordConfig, *, reversible: bool) -> Float32Array:
    """Time-warped copies of words; half of them played backwards where these count as alike."""
    warped = time_warped(words, rng)
    if not reversible:
        return warped
    chosen = rng.random(len(words)) < 0.5
    return np.where(chosen[:, None, None], time_reversed(warped, config), warped)


def _distances(
    words: Float32Array, anchors: Int64Array, projection: Float32Array, metric: Metric, elastic: float
) -> Float32Array:
    """[A, N] word distances of anchors from all words, over their median.

    DTW forgives tempo, and with it what tells a gesture from its slow and partial likenesses; the linear embedding
    forgives what differs between neighbours, but a small shift in time is already a distance. Each is over its own
    median.
    """
    total = np.zeros((len(anchors), len(words)), dtype=np.float32)
    if elastic:
        found = np.sqrt(word_distances(words[anchors], words, metric))
        total += found * np.float32(elastic / (float(np.median(found)) or 1.0))
    if elastic < 1:
        embedded = words.reshape(len(words), -1) @ projection.T
        found = np.sqrt(frame_distances(embedded[anchors], embedded))
        total += found * np.float32((1 - elastic) / (float(np.median(found)) or 1.0))
    return total / np.float32(float(np.median(total)) or 1.0)


def _nearest(distances: Float32Array, anchors: Int64Array, allowed: BoolArray, count: int) -> Int64Array:
    """[A, count] nearest allowed words of each anchor, nearest first; the anchor itself where too few."""
    count = min(count, distances.shape[1] - 1)
    masked = np.where(allowed, distances, np.inf)
    candidates = np.argpartition(masked, count - 1, axis=1)[:, :count]
    reached = np.take_along_axis(masked, candidates, axis=1)
    order = np.lexsort((candidates, reached), axis=1)
    found, reached = (np.take_along_axis(each, order, axis=1) for each in (candidates, reached))
    return np.where(np.isfinite(reached), found, anchors[:, None]).astype(np.int64)
