"""Candidate transitions between clips: where short windows of frames are locally nearest (Kovar et al. 2002)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array, Int64Array, IntArray
from motionlake.deep_motifs.config import TransitionsConfig
from motionlake.deep_motifs.motion_graph.costs import Clouds, joined, paired_distance, squared_distances, window_clouds
from numba import njit

# Windows of one side of a tile: 2 MB of distances.
TILE: Final = 720
# Stored distances are multiples of a micrometre, so that equal windows tie.
DECIMALS: Final = 6


@dataclass(frozen=True)
class Windowed:
    """The windows of some clips, in the order of the clips.

    Attributes:
        clouds: n windows.
        clip: [n] which clip a window belongs to.
        frame: [n] its first frame, at the words' rate.
        word: [n] the motion word it stands for: the last that starts no later.
        words: [clips] number of words of each clip.
    """

    clouds: Clouds
    clip: Int64Array
    frame: Int64Array
    word: Int64Array
    words: Int64Array


@dataclass(frozen=True)
class Candidates:
    """n pairs of windows: indices into two `Windowed`, and their distance in metres."""

    left: Int64Array
    right: Int64Array
    distance: Float64Array

    def __len__(self) -> int:
        return len(self.distance)

    def at(self, rows: IntArray) -> Candidates:
        return Candidates(self.left[rows], self.right[rows], self.distance[rows])


def windowed(positions: list[Float64Array], words: list[int], stride: int, window: int) -> Windowed:
    """Cut clips into windows.

    Args:
        positions: [T, 21, 3] of each clip at the words' rate, metres, y up.
        words: how many motion words each clip has.
        stride: frames between the starts of words.
        window: frames of a window.
    """
    clouds = [window_clouds(p, window) for p in positions]
    frames = [np.arange(len(c), dtype=np.int64) for c in clouds]
    return Windowed(
        joined(clouds),
        np.repeat(np.arange(len(clouds)), [len(c) for c in clouds]).astype(np.int64),
        np.concatenate(frames),
        np.concatenate([np.minimum(f // stride, w - 1) for f, w in zip(frames, words, strict=True)]),
        np.array(words, dtype=np.int64),
    )


def candidates(
    a: Windowed, b: Windowed, agree: BoolArray, config: TransitionsConfig, *, same: bool = False
) -> Candidates:
    """Local minima of the distance between the windows of two groups of clips.

    Args:
        a: windows of one group.
        b: windows of the other; `a` again where `same`.
        agree: [clips of a, clips of b] whether two clips' proportions allow transitions.
        config: radius and gap.
        same: the groups are one: a pair of clips is then met once, and within a clip only frames at least
            `min_gap` apart.

    Returns:
        Pairs in the order of their windows. A pair has the least distance among all whose frames differ by
        at most `radius` in both clips; of equal ones the first. Minima are found in single precision, their
        distances are exact.
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
            i, j = _minima(
                tile, *own, *its, a.clip[rows], b.clip[columns], a.frame[rows], b.frame[columns],
                agree, r, config.min_gap if same else 0, same,
            )  # fmt: skip
            lefts.append(i + rows.start)
            rights.append(j + columns.start)
    left = np.concatenate(lefts) if lefts else np.zeros(0, np.int64)
    right = np.concatenate(rights) if rights else np.zeros(0, np.int64)
    order = np.lexsort((right, left))
    left, right = left[order], right[order]
    return Candidates(left, right, _distances(a.clouds, b.clouds, left, right))


def _distances(a: Clouds, b: Clouds, left: Int64Array, right: Int64Array) -> Float64Array:
    found = np.empty(len(left))
    for start in range(0, len(left), 4096):
        rows = slice(start, start + 4096)
        found[rows] = paired_distance(a.at(left[rows]), b.at(right[rows]))
    return np.round(found, DECIMALS)


@njit(cache=True)
def _minima(  # type: ignore[no-untyped-def]
    tile, row, row_stop, column, column_stop, row_clip, column_clip, row_frame, column_frame, agree, r, gap, same
):
    """Rows and columns of the local minima of tile[row:row_stop, column:column_stop]."""
    rows, columns = [], []
    for i in range(row, row_stop):
        for j in range(column, column_stop):
            if not agree[row_clip[i], column_clip[j]]:
                continue
            if same:
                if row_clip[i] > column_clip[j]:
                    continue
                if row_clip[i] == column_clip[j] and column_frame[j] - row_frame[i] < gap:
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
    if len(starts):
        starts[1:] = np.any([k[1:] != k[:-1] for k in keys], axis=0)
    return starts
