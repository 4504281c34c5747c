"""The recurrence of section 6 without a kernel, for a process that aligns few strings (`motionlake.kernels.few`).

W(1, y) = D(e_1, s_y); W(x, y) = min over the window of W(m, n) + D(e_x, s_y) * max(x - m, y - n), as in `kernels`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Int32Array, Int64Array
from motionlake.pesta.strings import Repository

Padded = tuple[Int32Array, Int64Array]
GROUP: Final = 1024  # strings of about one length that are worked out at once
# Cells that are worked out in the time that one of all strings takes beside its own, for a column that it looks back.
_STEP: Final = 200


def plain_work(queries: Repository, texts: Repository, stride: int) -> int:
    """What `few` is asked for before `least_costs`."""
    lengths = np.sort((queries if len(queries) > 1 else texts).lengths)[::-1]
    longest = lengths[::GROUP]  # of each group
    together = np.minimum(GROUP, len(lengths) - np.arange(len(longest)) * GROUP) + _STEP * (stride + 1)
    other = (texts if len(queries) > 1 else queries).lengths.max(initial=0)
    return int((longest * other * together).sum())


def least_costs(queries: Repository, texts: Repository, distances: Float32Array, stride: int) -> Float32Array:
    """[n] the least end cost of query i in text i, without gaps; of one query, or in one text, that all n share.

    The costs of `kernels.scanner`, to the last bit. No query is empty; a cost is infinite in an empty text.

    Args:
        queries, texts: n strings, or one.
        distances: [m, m] of a symbol of a query from one of a text.
        stride: symbols that an alignment may stride over, plus one.
    """
    many = queries if len(queries) > 1 else texts
    best = np.empty(len(many), dtype=np.float32)
    order = np.argsort(-many.lengths, kind="stable")
    for first in range(0, len(order), GROUP):
        some = order[first : first + GROUP]
        best[some] = _least_costs(_padded(queries, some), _padded(texts, some), distances, stride)
    return best


def _least_costs(queries: Padded, texts: Padded, distances: Float32Array, stride: int) -> Float32Array:
    """The same of some: a column of all is worked out at once."""
    (query, lengths), (text, ends) = queries, texts
    lanes = max(len(lengths), len(ends))
    best = np.full(lanes, np.inf, dtype=np.float32)
    last = np.broadcast_to(lengths - 1, lanes)
    # W of the last columns, the latest first; `stride` rows before the first of a query cost infinitely much.
    columns = [np.full((stride + len(query), lanes), np.inf, dtype=np.float32) for _ in range(stride + 1)]
    for y in range(len(text)):
        column = columns.pop()
        columns.insert(0, column)
        distance = np.broadcast_to(distances[query, text[y]], (len(query), lanes))
        costs = column[stride:]
        costs[:] = np.inf
        for steps in range(1, stride + 1):
            penalty = distance if steps == 1 else distance * np.float32(steps)
            for back, rows in _before(steps):
                cells = columns[back][stride - rows : stride - rows + len(query)]
                np.minimum(costs, cells + penalty, out=costs)
        costs[0] = distance[0]
        for x in range(1, len(query)):
            for steps in range(1, stride + 1):
                penalty = distance[x] if steps == 1 else distance[x] * np.float32(steps)
                np.minimum(costs[x], column[stride + x - steps] + penalty, out=costs[x])
        reached = costs[last, np.arange(lanes)]
        best = np.where(y < ends, np.minimum(best, reached), best)
    return best


def _before(steps: int) -> Iterator[tuple[int, int]]:
    """Columns and rows back of the cells so many steps away in columns before this one."""
    for back in range(1, steps):
        yield back, steps
    for rows in range(steps + 1):
        yield steps, rows


def _padded(strings: Repository, some: Int64Array) -> Padded:
    """[l, n] some strings in columns, or the one that there is, filled up with zeros; and their lengths [n]."""
    chosen = some if len(strings) > 1 else np.zeros(1, dtype=np.int64)
    lengths = strings.lengths[chosen]
    padded = np.zeros((int(lengths.max(initial=0)), len(chosen)), dtype=np.int32)
    lane = np.repeat(np.arange(len(chosen)), lengths)
    row = np.arange(len(lane)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    padded[row, lane] = strings.symbols[strings.offsets[chosen][lane] + row]
    return padded, lengths
