"""Sections 6 and 7 of PESTA written out cell by cell: what the kernels are compared with."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from motionlake.arrays import Float32Array, Int32Array

Path = list[tuple[int, int]]
Score = float | np.float32


def cells(stride: int) -> list[tuple[int, int]]:
    """(rows, columns) back, in the order of ties: the fewest steps; the diagonal, columns falling, rows falling."""
    offsets = [(m, n) for m in range(stride + 1) for n in range(stride + 1) if m or n]
    return sorted(offsets, key=lambda o: (max(o), o[0] < max(o), -o[1] if o[0] == max(o) else -o[0]))


def weights(query: Int32Array, string: Int32Array, distances: Float32Array, stride: int) -> Float32Array:
    """[X, Y] W of section 6."""
    w = np.zeros((len(query), len(string)), dtype=np.float32)
    for x, e in enumerate(query):
        for y, s in enumerate(string):
            before = [(m, n) for m, n in cells(stride) if m <= x and n <= y]
            steps = [w[x - m, y - n] + distances[e, s] * np.float32(max(m, n)) for m, n in before]
            w[x, y] = min(steps) if x else distances[e, s]
    return w


def step_back(w: Float32Array, x: int, y: int, distance: np.float32, stride: int) -> tuple[int, int] | None:
    """(rows, columns) back to the cell that the cost of a cell comes from: of those equally far the cheapest."""
    for p in range(1, stride + 1):
        before = [(m, n) for m, n in cells(stride) if max(m, n) == p and m <= x and n <= y]
        if before:
            m, n = min(before, key=lambda o: w[x - o[0], y - o[1]])
            if w[x - m, y - n] + distance * np.float32(p) == w[x, y]:
                return m, n
    return None


def path_back(
    w: Float32Array, query: Int32Array, string: Int32Array, distances: Float32Array, stride: int, end: int
) -> Path:
    """The path from the last row in column `end`, first cell first."""
    x, y = len(query) - 1, end
    path = [(x, y)]
    while x:
        step = step_back(w, x, y, distances[query[x], string[y]], stride)
        assert step
        x, y = x - step[0], y - step[1]
        path.append((x, y))
    return path[::-1]


def gapped_weights(
    query: Int32Array, string: Int32Array, distances: Float32Array, stride: int, query_gap: Score, clip_gap: Score
) -> Float32Array:
    """[X, Y] W of section 6 where symbols of the query and of the string may be left out at a price."""
    w = np.zeros((len(query), len(string)), dtype=np.float32)
    for x, e in enumerate(query):
        for y, s in enumerate(string):
            before = [(m, n) for m, n in cells(stride) if m <= x and n <= y]
            steps = [w[x - m, y - n] + distances[e, s] * np.float32(max(m, n)) for m, n in before]
            left_out = [w[x, y - 1] + np.float32(clip_gap)] if y else []
            left_out.append((w[x - 1, y] if x else np.float32(0)) + np.float32(query_gap))
            w[x, y] = min([*(steps if x else [distances[e, s]]), *left_out])
    return w


def gapped_path(
    w: Float32Array,
    query: Int32Array,
    string: Int32Array,
    distances: Float32Array,
    stride: int,
    clip_gap: Score,
    end: int,
) -> Path:
    """The pairs that are matched on the path from the last row in column `end`, first cell first; there may be none."""
    x, y, path = len(query) - 1, end, []
    while x >= 0:
        distance = distances[query[x], string[y]]
        step = step_back(w, x, y, distance, stride) if x else (1, 0) if w[x, y] == distance else None
        if step is not None:
            path.append((x, y))
            x, y = x - step[0], y - step[1]
        elif y and w[x, y - 1] + np.float32(clip_gap) == w[x, y]:
            y -= 1
        else:
            x -= 1
    return path[::-1]


def local_weights(
    query: Int32Array, string: Int32Array, distances: Float32Array, threshold: Score, gap: Score
) -> Float32Array:
    """[X + 1, Y + 1] Smith-Waterman as costs."""
    t, g = np.float32(threshold), np.float32(gap)
    h = np.zeros((len(query) + 1, len(string) + 1), dtype=np.float32)
    for x in range(1, len(query) + 1):
        for y in range(1, len(string) + 1):
            alike = h[x - 1, y - 1] + (distances[query[x - 1], string[y - 1]] - t)
            h[x, y] = min(np.float32(0), alike, h[x - 1, y] + g, h[x, y - 1] + g)
    return h


def local_path(
    h: Float32Array,
    query: Int32Array,
    string: Int32Array,
    distances: Float32Array,
    threshold: Score,
    gap: Score,
    end: int,
) -> Path:
    """Matched pairs of the best local alignment that ends in column `end`."""
    x, y, path = int(np.argmin(h[:, end + 1])), end + 1, []
    while h[x, y] < 0:
        if h[x - 1, y - 1] + (distances[query[x - 1], string[y - 1]] - np.float32(threshold)) == h[x, y]:
            x, y = x - 1, y - 1
            path.append((x, y))
        elif h[x - 1, y] + np.float32(gap) == h[x, y]:
            x -= 1
        else:
            y -= 1
    return path[::-1]


def apart(
    costs: Iterable[float], spans: Iterable[tuple[int, int] | None], k: int, taken: Iterable[int] = ()
) -> list[tuple[int, int, float]]:
    """(start, stop, cost) of the k cheapest spans that overlap none before them nor `taken`, in ascending cost."""
    used = set(taken)
    found: list[tuple[int, int, float]] = []
    for cost, _, span in sorted(
        ((c, i, s) for i, (c, s) in enumerate(zip(costs, spans, strict=True)) if s), key=lambda t: t[:2]
    ):
        if len(found) < k and not used & set(range(*span)):
            used |= set(range(*span))
            found.append((*span, float(cost)))
    return found


def long_query(
    query: Int32Array, string: Int32Array, distances: Float32Array, stride: int, segments: int, start: int, stop: int
) -> list[tuple[float, Path]]:
    """Section 7 on one string: cost and whole path from every column of the last row of the last covering segment."""
    length = -(-len(query) // segments)
    filled = np.concatenate([query, np.repeat(query[-1:], segments * length - len(query))])
    parts = [filled[j * length : (j + 1) * length] for j in range(segments)]
    first, last = start // length, (stop - 1) // length
    w = {j: weights(parts[j], string, distances, stride) for j in range(first, last + 1)}
    result = []
    for y in range(len(string)):
        cost, column = w[last][-1, y], y
        path: Path = []
        for j in range(last, first - 1, -1):
            piece = path_back(w[j], parts[j], string, distances, stride, column)
            path = [(x + j * length, n) for x, n in piece] + path
            if j > first:
                top = piece[0][1]
                near = [n for n in (top - 1, top, *range(top - 2, top - stride - 1, -1)) if n >= 0]
                column = min(near, key=lambda n: w[j - 1][-1, n])
                cost = cost + w[j - 1][-1, column]
        result.append((float(cost), path))
    return result
