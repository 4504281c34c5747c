"""Candidate transitions between clips: where short windows of frames are locally nearest (Kovar et al. 2002).

What a transition costs: the distance of the point clouds of the poses on both sides, and that of the signatures of
their surroundings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Float64Array, Int64Array, IntArray
from motionlake.deep_motifs.config import TransitionsConfig
from motionlake.deep_motifs.emd import emd
from motionlake.deep_motifs.signatures import window_signatures
from motionlake.kernels import njit
from motionlake.motion.rotations import turn_on_ground
from motionlake.motion.skeleton import COMMON, INDEX, facing

# Windows of one side of a tile: 2 MB of distances.
TILE: Final = 720
# Stored distances are multiples of a micrometre, so that equal windows tie.
DECIMALS: Final = 6
# Those of contexts are rounded far below what differs, so that a transition and its reverse are equal.
CONTEXT_DECIMALS: Final = 9
PAIRS: Final = 4096  # whose exact distance is computed at a time


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

    def at(self, rows: IntArray | slice) -> Clouds:
        """Some of the windows."""
        return Clouds(*(values[rows] for values in vars(self).values()))


def window_clouds(positions: Float64Array, window: int) -> Clouds:
    """Clouds of the max(0, T - window + 1) windows of `window` frames of a clip.

    Each is turned to where its first frame faces: the distance does not depend on it, but so the numbers hardly
    depend on where and which way a clip was recorded.

    Args:
        positions: [T, 21, 3] canonical joints, metres, y up.
        window: frames.
    """
    n = len(positions) - window + 1
    if n < 1:
        points = window * len(JOINTS)
        return Clouds(np.zeros((0, 2 * points)), np.zeros((0, points)), np.zeros(0))
    views = np.lib.stride_tricks.sliding_window_view(positions[:, list(JOINTS)], window, axis=0)
    cloud = views.transpose(0, 3, 1, 2).reshape(n, -1, 3).astype(np.float64)
    x, y, z = cloud[..., 0], cloud[..., 1], cloud[..., 2]
    x, z = x - x.mean(axis=1, keepdims=True), z - z.mean(axis=1, keepdims=True)
    ground = np.concatenate(turn_on_ground(x, z, -facing(positions)[:n, None]), axis=1)
    return Clouds(ground, y, np.einsum("ij,ij->i", ground, ground) + np.einsum("ij,ij->i", y, y))


def _quarter_turned(ground: Float64Array) -> Float64Array:
    """Centred ground points turned by 90 degrees about the vertical: (x, z) becomes (z, -x)."""
    x, z = np.split(ground, 2, axis=1)
    return np.concatenate([z, -x], axis=1)


def paired_distance(a: Clouds, b: Clouds) -> Float64Array:
    """[n] distance in metres of each window of `a` from the same row of `b`, root mean square over the points."""
    along = np.einsum("ij,ij->i", a.ground, b.ground)
    across = np.einsum("ij,ij->i", a.ground, _quarter_turned(b.ground))
    heights = np.einsum("ij,ij->i", a.height, b.height)
    squares = a.norm + b.norm - 2 * (heights + np.hypot(along, across))
    return np.asarray(np.sqrt(np.maximum(squares, 0.0) / a.height.shape[1]), dtype=np.float64)


def squared_distances(a: Clouds, b: Clouds) -> Float32Array:
    """[n, m] squares of the distances of all windows of `a` from all of `b`, in single precision."""
    left, right = a.ground.astype(np.float32), b.ground.astype(np.float32)
    turned = _quarter_turned(b.ground).astype(np.float32)
    along = left @ right.T
    across = left @ turned.T
    np.hypot(along, across, out=along)
    along += a.height.astype(np.float32) @ b.height.astype(np.float32).T
    along *= -2
    along += a.norm.astype(np.float32)[:, None]
    along += b.norm.astype(np.float32)[None]
    along /= a.height.shape[1]
    return along


@dataclass(frozen=True)
class Windowed:
    """The windows of some clips, in the order of the clips.

    Attributes:
        clouds: n windows.
        clip: [n] which clip a window belongs to.
        frame: [n] its first frame, at the words' rate.
        word: [n] the motion word it stands for: the last that starts no later.
    """

    clouds: Clouds
    clip: Int64Array
    frame: Int64Array
    word: Int64Array


@dataclass(frozen=True)
class Candidates:
    """n pairs of windows: indices into two `Windowed`, and their distance in metres."""

    left: Int64Array
    right: Int64Array
    distance: Float64Array

    def __len__(self) -> int:
        return len(self.distance)

    def at(self, rows: IntArray) -> Candidates:
        """Some of the pairs."""
        return Candidates(*(values[rows] for values in vars(self).values()))


def windowed(positions: list[Float64Array], words: list[int], stride: int, window: int) -> Windowed:
    """Cut clips ([T, 21, 3] positions at the words' rate, metres, y up) into windows of `window` frames.

    `words`: how many motion words each clip has; `stride`: frames between the starts of words.
    """
    clouds = [window_clouds(p, window) for p in positions]
    frames = [np.arange(len(c), dtype=np.int64) for c in clouds]
    return Windowed(
        Clouds(*(np.concatenate(parts) for parts in zip(*(vars(c).values() for c in clouds), strict=True))),
        np.repeat(np.arange(len(clouds)), [len(c) for c in clouds]).astype(np.int64),
        np.concatenate(frames),
        np.concatenate([np.minimum(f // stride, w - 1) for f, w in zip(frames, words, strict=True)]),
    )


def candidates(
    a: Windowed, b: Windowed, agree: BoolArray, config: TransitionsConfig, *, same: bool = False
) -> Candidates:
    """Local minima of the distance between the windows of two groups of clips, in the order of their windows.

    A pair has the least distance among all whose frames differ by at most `radius` in both clips; of equal ones the
    first. Minima are found in single precision, their distances are exact.

    Args:
        a: windows of one group.
        b: windows of the other; `a` again where `same`.
        agree: [clips of a, clips of b] whether two clips' proportions allow transitions.
        config: radius and gap.
        same: the groups are one: a pair of clips is then met once, and within a clip only frames at least
            `min_gap` apart.
    """
    r = config.radius
    lefts, rights = [], []
    for row in range(0, len(a.frame), TILE):
        rows = slice(max(0, row - r), min(len(a.frame), row + TILE + r))
        for column in range(0, len(b.frame), TILE):
            columns = slice(max(0, column - r), min(len(b.frame), column + TILE + r))
            if same and columns.stop <= row:
                continue
            wanted = agree[
                a.clip[rows.start] : a.clip[rows.stop - 1] + 1, b.clip[columns.start] : b.clip[columns.stop - 1] + 1
            ]
            if not wanted.any():
                continue
            tile = squared_distances(a.clouds.at(rows), b.clouds.at(columns))
            own = (row - rows.start, min(row + TILE, len(a.frame)) - rows.start)
            its = (column - columns.start, min(column + TILE, len(b.frame)) - columns.start)
            windows = a.clip[rows], b.clip[columns], a.frame[rows], b.frame[columns]
            i, j = _minima(tile, *own, *its, *windows, agree, r, config.min_gap, same)
            lefts.append(i + rows.start)
            rights.append(j + columns.start)
    none = np.zeros(0, np.int64)
    left, right = np.concatenate([none, *lefts]), np.concatenate([none, *rights])
    order = np.lexsort((right, left))
    left, right = left[order], right[order]
    pairs = [slice(start, start + PAIRS) for start in range(0, len(left), PAIRS)]
    apart = [paired_distance(a.clouds.at(left[some]), b.clouds.at(right[some])) for some in pairs]
    return Candidates(left, right, np.round(np.concatenate([np.zeros(0), *apart]), DECIMALS))


@njit(cache=True)
def _minima(  # type: ignore[no-untyped-def]
    tile, row, row_stop, column, column_stop, row_clip, column_clip, row_frame, column_frame, agree, r, gap, same
):
    """Rows and columns of the local minima of tile[row:row_stop, column:column_stop]."""
    rows, columns = [], []
    for i in range(row, row_stop):
        for j in range(column, column_stop):
            if not agree[row_clip[i], column_clip[j]] or (same and row_clip[i] > column_clip[j]):
                continue
            if same and row_clip[i] == column_clip[j] and column_frame[j] - row_frame[i] < gap:
                continue
            if _is_minimum(tile, i, j, row_clip, column_clip, r):
                rows.append(i)
                columns.append(j)
    return np.array(rows, dtype=np.int64), np.array(columns, dtype=np.int64)


@njit(cache=True)
def _is_minimum(tile, i, j, row_clip, column_clip, r):  # type: ignore[no-untyped-def]
    value = tile[i, j]
    for k in range(max(0, i - r), min(tile.shape[0], i + r + 1)):
        if row_clip[k] != row_clip[i]:
            continue
        for m in range(max(0, j - r), min(tile.shape[1], j + r + 1)):
            if column_clip[m] != column_clip[j] or (k == i and m == j):
                continue
            other = tile[k, m]
            if other < value or (other == value and (k < i or (k == i and m < j))):
                return False
    return True


def nearest_per_word(found: Candidates, a: Windowed, b: Windowed, count: int) -> Candidates:
    """The candidates that are among the `count` nearest of the word at either end, and no others of that word.

    Of those that join a word to one clip, only the nearest counts for that word. Ties go to the first. Where `a`
    and `b` are one group, a word that is the left end of some candidates and the right end of others keeps as
    many of either.
    """
    keep = np.zeros(len(found), dtype=bool)
    for here, there, own, other in ((found.left, found.right, a, b), (found.right, found.left, b, a)):
        keep[_ranked(own.clip[here], own.word[here], other.clip[there], found.distance, count)] = True
    return found.at(np.flatnonzero(keep))


def _ranked(clip: Int64Array, word: Int64Array, to: Int64Array, distance: Float64Array, count: int) -> Int64Array:
    order = np.lexsort((distance, to, word, clip))
    first = _starts(clip[order], word[order], to[order])
    order = order[first]
    order = order[np.lexsort((distance[order], word[order], clip[order]))]
    starts = _starts(clip[order], word[order])
    rank = np.arange(len(order)) - np.maximum.accumulate(np.where(starts, np.arange(len(order)), 0))
    return order[rank < count]


def _starts(*keys: Int64Array) -> BoolArray:
    """[n] where a run of equal keys starts."""
    starts = np.ones(len(keys[0]), dtype=bool)
    starts[1:] = np.diff(keys).any(axis=0)
    return starts


def context_distances(
    motifs: Sequence[IntArray],
    ends: tuple[tuple[Int64Array, Int64Array], tuple[Int64Array, Int64Array]],
    idf: Float64Array,
    ground: Float64Array,
    context: int,
) -> Float64Array:
    """Earth mover's distance [n] between the contexts of the two ends of transitions (section 6.4).

    Args:
        motifs: [w] motif of each word, of every clip.
        ends: (clip [n], word [n]) of either end.
        idf: [K] of the motifs.
        ground: [K, K] distances of the motifs.
        context: words of a window; a clip of fewer words is its own context.
    """
    last = np.array([max(len(m) - context, 0) for m in motifs], dtype=np.int64)  # first word of each clip's last window
    first = np.concatenate([[0], np.cumsum(last + 1)])
    keys = [first[clip] + np.clip(word - context // 2, 0, last[clip]) for clip, word in ends]
    pairs, place = np.unique(np.sort(np.stack(keys, axis=1), axis=1), axis=0, return_inverse=True)
    windows = cache(lambda clip: window_signatures(motifs[clip], idf, context))

    def signature(key: int) -> Float32Array:
        clip = int(np.searchsorted(first, key, side="right")) - 1
        return np.asarray(windows(clip)[key - first[clip]])

    found = np.array([emd(signature(int(p)), signature(int(q)), ground) for p, q in pairs], dtype=np.float64)
    return np.round(found[place.ravel()], CONTEXT_DECIMALS)
