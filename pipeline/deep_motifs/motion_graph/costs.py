"""What a transition costs: point clouds of the poses on both sides, and the signatures of their surroundings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array, IntArray
from motionlake.deep_motifs.emd import emd
from motionlake.deep_motifs.signatures import window_signatures
from motionlake.motion.rotations import turn_on_ground
from motionlake.motion.skeleton import COMMON, INDEX, facing

JOINTS: Final = tuple(INDEX[name] for name in COMMON)


@dataclass(frozen=True)
class Clouds:
    """The windows of one clip or of several; n windows, P = joints x frames points each.

    Attributes:
        ground: [n, 2 P] x then z of the points, centred on the ground.
        height: [n, P] y of the points.
        norm: [n] sum of the squares of both.
    """

    ground: Float64Array
    height: Float64Array
    norm: Float64Array

    def __len__(self) -> int:
        return len(self.norm)

    @property
    def points(self) -> int:
        return int(self.height.shape[1])

    def at(self, rows: IntArray | slice) -> Clouds:
        return Clouds(self.ground[rows], self.height[rows], self.norm[rows])


def window_clouds(positions: Float64Array, window: int) -> Clouds:
    """Clouds of the windows that start at each frame.

    Args:
        positions: [T, 21, 3] canonical joints, metres, y up.
        window: frames.

    Returns:
        max(0, T - window + 1) clouds. Each is turned to where its first frame faces: the distance does not
        depend on it, but so the numbers hardly depend on where and which way a clip was recorded.
    """
    if len(positions) < window:
        points = window * len(JOINTS)
        return Clouds(np.zeros((0, 2 * points)), np.zeros((0, points)), np.zeros(0))
    n = len(positions) - window + 1
    views = np.lib.stride_tricks.sliding_window_view(positions[:, list(JOINTS)], window, axis=0)
    cloud = views.transpose(0, 3, 1, 2).reshape(n, -1, 3).astype(np.float64)
    x, y, z = cloud[..., 0], cloud[..., 1], cloud[..., 2]
    x, z = x - x.mean(axis=1, keepdims=True), z - z.mean(axis=1, keepdims=True)
    ground = np.concatenate(turn_on_ground(x, z, -facing(positions)[:n, None]), axis=1)
    return Clouds(ground, y, np.einsum("ij,ij->i", ground, ground) + np.einsum("ij,ij->i", y, y))


def joined(clouds: list[Clouds]) -> Clouds:
    """All windows of several clips, one after the other."""
    return Clouds(
        np.concatenate([c.ground for c in clouds]),
        np.concatenate([c.height for c in clouds]),
        np.concatenate([c.norm for c in clouds]),
    )


def quarter_turned(ground: Float64Array) -> Float64Array:
    """Centred ground points turned by 90 degrees about the vertical: (x, z) becomes (z, -x)."""
    x, z = np.split(ground, 2, axis=1)
    return np.concatenate([z, -x], axis=1)


def paired_distance(a: Clouds, b: Clouds) -> Float64Array:
    """[n] distance in metres of each window of `a` from the same row of `b`, root mean square over the points."""
    along = np.einsum("ij,ij->i", a.ground, b.ground)
    across = np.einsum("ij,ij->i", a.ground, quarter_turned(b.ground))
    heights = np.einsum("ij,ij->i", a.height, b.height)
    squares = a.norm + b.norm - 2 * (heights + np.hypot(along, across))
    return np.asarray(np.sqrt(np.maximum(squares, 0.0) / a.points), dtype=np.float64)


def squared_distances(a: Clouds, b: Clouds) -> Float32Array:
    """[n, m] squares of the distances of all windows of `a` from all of `b`, in single precision."""
    left, right = a.ground.astype(np.float32), b.ground.astype(np.float32)
    turned = quarter_turned(b.ground).astype(np.float32)
    along = left @ right.T
    across = left @ turned.T
    np.hypot(along, across, out=along)
    along += a.height.astype(np.float32) @ b.height.astype(np.float32).T
    along *= -2
    along += a.norm.astype(np.float32)[:, None]
    along += b.norm.astype(np.float32)[None]
    along /= a.points
    return along


# Stored distances are rounded far below what differs, so that a transition and its reverse are equal.
DECIMALS = 9


def context_start(word: Int64Array, words: Int64Array, context: int) -> Int64Array:
    """First word of the window of `context` words around `word` of a clip of `words`; it stays within the clip."""
    return np.clip(word - context // 2, 0, np.maximum(words - context, 0))


def context_distances(
    motifs: Sequence[IntArray],
    ends: tuple[tuple[Int64Array, Int64Array], tuple[Int64Array, Int64Array]],
    idf: Float64Array,
    ground: Float64Array,
    context: int,
) -> Float64Array:
    """Earth mover's distance between the contexts of the two ends of transitions (section 6.4).

    Args:
        motifs: [w] motif of each word, of every clip.
        ends: (clip [n], word [n]) of either end.
        idf: [K] of the motifs.
        ground: [K, K] distances of the motifs.
        context: words of a window; a clip of fewer words is its own context.

    Returns:
        [n] in the unit of `ground`; windows that several transitions share are compared once.
    """
    lengths = np.array([len(m) for m in motifs], dtype=np.int64)
    first = np.concatenate([[0], np.cumsum(np.maximum(lengths - context, 0) + 1)])
    keys = [first[clip] + context_start(word, lengths[clip], context) for clip, word in ends]
    pairs, place = np.unique(np.sort(np.stack(keys, axis=1), axis=1), axis=0, return_inverse=True)
    signatures: dict[int, Float32Array] = {}

    def signature(key: int) -> Float32Array:
        clip = int(np.searchsorted(first, key, side="right")) - 1
        if clip not in signatures:
            signatures[clip] = window_signatures(motifs[clip], idf, context)
        return np.asarray(signatures[clip][key - first[clip]])

    found = np.array([emd(signature(int(p)), signature(int(q)), ground) for p, q in pairs], dtype=np.float64)
    return np.round(found[place.ravel()], DECIMALS) if len(pairs) else np.zeros(0)
