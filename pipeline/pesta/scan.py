"""End costs of queries against strings: the last row of the weight matrix, without the matrix (section 6).

Clips are scanned side by side, sorted by length so that all lanes are equally full. A long string is cut into pieces
that are scanned side by side as well. A piece starts some columns early, as if the string began there; where the
columns before its first one then equal those that the piece before it ended with, it has been scanned exactly, and
where they differ it is scanned again from these. So the costs are those of scanning the string from its first column
to its last, for any number of threads.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Final, Literal, get_args

import numpy as np
from motionlake.arrays import Float32Array, Int32Array, Int64Array
from motionlake.kernels import few
from motionlake.pesta.config import DEFAULT_ALIGNMENT, AlignmentConfig
from motionlake.pesta.lanes import LANES
from motionlake.pesta.plain_scan import least_costs, plain_work
from motionlake.pesta.strings import Boundaries, Distances, Repository, SymbolDistances, checked
from motionlake.pesta.thread_work import useful_threads
from motionlake.threads import in_threads
from numpy.typing import ArrayLike

Both = Literal["max", "mean", "query"]

# Columns of a piece of a long string: enough to be worth its own lane, few enough to stay in cache.
LEAST_COLUMNS: Final = 1024
MOST_COLUMNS: Final = 4096
BATCH: Final = 64  # clips that `nearest_strings` searches for in the query at once
ALIKE: Final = 4 * LANES  # queries of about one length whose distances from a string are in memory at once
_NO_COSTS: Final = np.zeros(0, dtype=np.float32)
_ALL_ROWS: Final = np.zeros(0, dtype=np.int64)
_NO_STATES: Final = np.zeros((0, 0, 0), dtype=np.float32)


def end_costs(
    query: ArrayLike,
    repository: Repository,
    distances: Distances,
    config: AlignmentConfig = DEFAULT_ALIGNMENT,
    *,
    boundaries: Boundaries = "kept",
    threads: int = 1,
) -> Float32Array:
    """[Y] W(X, y): the cost of the best match that ends at each symbol of a repository.

    Args:
        query: [X] symbols.
        repository: Y symbols of n clips.
        distances: [m, m] of the dictionary's symbols.
        config: the alignment.
        boundaries: "kept" aligns each clip by itself; else the clips make one string.
        threads: which share the work; the result does not depend on their number.

    Raises:
        ValueError: an empty query, a symbol outside the dictionary, distances that are none.
    """
    symbols, ground = checked(query, repository, distances)
    return scan_ends(symbols, repository.aligned(boundaries), ground, config, threads)


def scan_ends(
    symbols: Int32Array, strings: Repository, ground: SymbolDistances, config: AlignmentConfig, threads: int
) -> Float32Array:
    """[Y] end costs, string by string; all checked before."""
    ends = np.empty(len(strings.symbols), dtype=np.float32)
    warm = 2 * len(symbols) + 2 * LANES
    longest = max(4 * warm, min(max(-(-len(ends) // LANES), LEAST_COLUMNS), MOST_COLUMNS))
    scan = _Scan(symbols, strings.symbols, ground, config)
    whole = _whole(strings, longest + warm)
    _share(lambda part: scan(whole[part], ends=ends), _shares(whole, len(symbols), threads))
    cut = np.flatnonzero(strings.lengths > warm + longest)
    if len(cut):
        bounds = zip(strings.offsets[cut].tolist(), strings.offsets[cut + 1].tolist(), strict=True)
        pieces = np.concatenate([_cut(start, stop, warm, longest) for start, stop in bounds])
        _scan_cut(scan, pieces, warm, longest, (config.reach, len(symbols)), ends, threads)
    return ends


def best_per_clip(
    query: ArrayLike,
    repository: Repository,
    distances: Distances,
    config: AlignmentConfig = DEFAULT_ALIGNMENT,
    *,
    threads: int = 1,
) -> Float32Array:
    """[n] the least end cost of a query in each clip, as `end_costs`; infinite in an empty clip."""
    symbols, ground = checked(query, repository, distances)
    if _without_kernel(Repository.of([symbols]), repository, config):
        return least_costs(Repository.of([symbols]), repository, ground.matrix, config.reach)
    best = np.full(len(repository), np.inf, dtype=np.float32)
    pieces, scan = _whole(repository), _Scan(symbols, repository.symbols, ground, config)
    _share(lambda part: scan(pieces[part], best=best), _shares(pieces, len(symbols), threads))
    return best


def pairwise(
    queries: Sequence[ArrayLike],
    repository: Repository,
    distances: Distances,
    config: AlignmentConfig = DEFAULT_ALIGNMENT,
    *,
    threads: int = 1,
) -> Float32Array:
    """[q, n] the least end cost of each of q queries in every clip; infinite in an empty clip.

    Arguments and errors as in `end_costs`.
    """
    ground = SymbolDistances.of(distances)
    strings = [checked(query, repository, ground)[0] for query in queries]
    return _pairwise(strings, repository, ground, config, threads)


def _pairwise(
    strings: Sequence[Int32Array], repository: Repository, ground: SymbolDistances, config: AlignmentConfig,
    threads: int,
) -> Float32Array:  # fmt: skip
    """The same, all checked before."""
    from motionlake.pesta.kernels import query_profile, scanner

    costs = np.full((len(strings), len(repository)), np.inf, dtype=np.float32)
    pieces = _whole(repository)
    kernel = scanner(config.reach, config.gaps)
    how = (config.local, *ground.scores(config), repository.symbols, _ALL_ROWS)

    def work(part: slice) -> None:
        for query, best in zip(strings[part], costs[part], strict=True):
            kernel(
                query_profile(query, ground.matrix), len(query), *how, pieces, 0, 0, _NO_STATES, _NO_STATES, _NO_STATES,
                _NO_COSTS, best,
            )  # fmt: skip

    threads = useful_threads(threads, sum(map(len, strings)) * len(repository.symbols))
    bounds = np.linspace(0, len(strings), threads + 1).astype(int).tolist()
    _share(work, [slice(a, b) for a, b in itertools.pairwise(bounds)])
    return costs


def _in_one(
    queries: Repository, text: Int32Array, ground: SymbolDistances, config: AlignmentConfig, threads: int
) -> Float32Array:
    """[q] the least end cost of each of q queries in one string, as `pairwise`: queries of about one length side by
    side; of one length, by Smith-Waterman."""
    lengths = queries.lengths
    if _without_kernel(queries, Repository.of([text]), config):
        return least_costs(queries, Repository.of([text]), ground.matrix, config.reach)
    from motionlake.pesta.kernels import query_profiles, scanner

    costs = np.full(len(queries), np.inf, dtype=np.float32)
    held, places = np.unique(text, return_inverse=True)
    kernel, how = scanner(config.reach, config.gaps), (config.local, *ground.scores(config))

    def work(chosen: Int64Array) -> None:
        own, starts = lengths[chosen], np.arange(len(chosen), dtype=np.int64) * len(text)
        profiles = query_profiles(queries.symbols, queries.offsets[chosen], own, held, ground.matrix)
        best = np.full(len(chosen), np.inf, dtype=np.float32)
        texts = (len(held) * np.arange(len(chosen))[:, None] + places).ravel().astype(np.int32)
        kernel(
            profiles, int(own[0]), *how, texts, _ALL_ROWS if config.local else own,
            np.column_stack([starts, starts, starts + len(text), np.arange(len(chosen))]), 0, 0, _NO_STATES, _NO_STATES,
            _NO_STATES, _NO_COSTS, best,
        )  # fmt: skip
        costs[chosen] = best

    order = queries.by_length
    alike = np.split(order, np.flatnonzero(np.diff(lengths[order])) + 1) if config.local else [order]
    parts = [group[at : at + ALIKE] for group in alike for at in range(0, len(group), ALIKE)]
    in_threads(work, parts, useful_threads(threads, int(lengths.sum()) * len(text)))
    return costs


def symmetric_costs(
    strings: Sequence[ArrayLike] | Repository,
    distances: Distances,
    config: AlignmentConfig = DEFAULT_ALIGNMENT,
    *,
    both: Both = "max",
    threads: int = 1,
) -> Float32Array:
    """[n, n] costs between whole strings for each symbol of the query.

    A cost grows with the query's length, and a short query is found in many strings; hence the division, and both ways.

    Args:
        strings: n strings, none of them empty.
        distances, config, threads: as in `end_costs`.
        both: the greater ("max") or mean of cost(a in b) / len(a) and cost(b in a) / len(b); "query" the first alone,
            with a the row.

    Raises:
        ValueError: as in `end_costs`; an unknown `both`.
    """
    _check(both)
    repository = strings if isinstance(strings, Repository) else Repository.of(strings)
    queries = [repository.string(clip) for clip in range(len(repository))]
    costs = pairwise(queries, repository, distances, config, threads=threads)
    costs /= np.maximum(repository.lengths, 1)[:, None].astype(np.float32)
    return costs if both == "query" else _both_ways(costs, costs.T, both)


def nearest_strings(
    query: ArrayLike,
    repository: Repository,
    distances: Distances,
    k: int,
    config: AlignmentConfig = DEFAULT_ALIGNMENT,
    *,
    both: Both = "max",
    without: int | None = None,
    threads: int = 1,
) -> list[tuple[int, float]]:
    """(clip, cost) of the k nearest clips, in ascending cost, ties by clip: a row of `symmetric_costs`.

    The costs of the query in the clips are lower bounds of the greater of both ways (half of them those of the mean),
    so clips are searched for in the query in that order until no more of them can be among the k nearest.

    Args:
        query: [X] symbols of a whole clip.
        repository, distances, config, both, threads: as in `symmetric_costs`. Empty clips are left out.
        k: how many at most.
        without: a clip to leave out: the query itself.

    Raises:
        ValueError: as in `symmetric_costs`; k below 0.
    """
    if k < 0:
        raise ValueError(f"k is {k}: it is at least 0")
    _check(both)
    symbols, ground = checked(query, repository, distances)
    costs = best_per_clip(symbols, repository, ground, config, threads=threads) / np.float32(len(symbols))
    if without is not None:
        costs[without] = np.inf
    order = np.argsort(costs, kind="stable")[: int(np.isfinite(costs).sum())]
    if both == "query":
        return [(int(clip), float(costs[clip])) for clip in order[:k]]
    found: list[tuple[float, int]] = []
    batch = max(BATCH, min(k, len(order)))
    for start in range(0, len(order) if k else 0, batch):
        clips = order[start : start + batch].tolist()
        bound = float(costs[clips[0]]) * (1.0 if both == "max" else 0.5)
        if len(found) >= k and bound > found[k - 1][0] and not config.local:
            break
        own = Repository.of([repository.string(clip) for clip in clips])
        back = _in_one(own, symbols, ground, config, threads)
        back /= repository.lengths[clips].astype(np.float32)
        cost = _both_ways(costs[clips], back, both)
        found = sorted([*found, *zip(cost.tolist(), clips, strict=True)])[: max(k, 1)]
    return [(clip, cost) for cost, clip in found[:k]]


def _without_kernel(queries: Repository, texts: Repository, config: AlignmentConfig) -> bool:
    plain = not (config.local or config.gaps)
    return plain and few(plain_work(queries, texts, config.reach))


def _check(both: Both) -> None:
    if both not in get_args(Both):
        raise ValueError(f"both is {both!r}, not max, mean or query")


def _both_ways(there: Float32Array, back: Float32Array, both: Both) -> Float32Array:
    return np.maximum(there, back) if both == "max" else (there + back) / np.float32(2)


class _Scan:
    """The kernel, for one query against some strings; its other arguments are left out where it need not fill them."""

    def __init__(
        self, query: Int32Array, symbols: Int32Array, ground: SymbolDistances, config: AlignmentConfig
    ) -> None:
        from motionlake.pesta.kernels import query_profile, scanner

        self._kernel = scanner(config.reach, config.gaps)
        profile = query_profile(query, ground.matrix)
        self._query = profile, len(query), config.local, *ground.scores(config), symbols, _ALL_ROWS

    def __call__(
        self,
        pieces: Int64Array,
        warm: int = 0,
        full: int = 0,
        *,
        initial: Float32Array = _NO_STATES,
        entries: Float32Array = _NO_STATES,
        exits: Float32Array = _NO_STATES,
        ends: Float32Array = _NO_COSTS,
        best: Float32Array = _NO_COSTS,
    ) -> None:
        self._kernel(*self._query, pieces, warm, full, initial, entries, exits, ends, best)


def _whole(repository: Repository, most: int | None = None) -> Int64Array:
    """[p, 4] pieces of `kernels.scanner`: the clips of at least one and at most `most` symbols, longest first."""
    clips = repository.by_length
    if most is not None:
        clips = clips[repository.lengths[clips] <= most]
    starts = repository.offsets[clips]
    return np.column_stack([starts, starts, repository.offsets[clips + 1], clips]).astype(np.int64)


def _cut(start: int, stop: int, warm: int, longest: int) -> Int64Array:
    """[p, 4] pieces of one clip, one after another: the first of warm + longest columns, all others of `longest`."""
    kept = np.concatenate([[start], np.arange(start + warm + longest, stop, longest)])
    first = np.concatenate([[start], kept[1:] - warm])
    return np.column_stack([first, kept, np.append(kept[1:], stop), np.full(len(kept), -1)]).astype(np.int64)


def _scan_cut(
    scan: _Scan,
    pieces: Int64Array,
    warm: int,
    longest: int,
    state: tuple[int, int],
    ends: Float32Array,
    threads: int,
) -> None:
    """Fill the end costs of clips that are cut into several pieces each, the last columns of a piece [stride, rows]."""
    order = np.argsort(pieces[:, 0] - pieces[:, 2], kind="stable")
    by_length = pieces[order]
    entries, exits = (np.empty((len(pieces), *state), dtype=np.float32) for _ in range(2))

    def work(part: slice) -> None:
        scan(by_length[part], warm, warm + longest, entries=entries[part], exits=exits[part], ends=ends)

    _share(work, _shares(by_length, state[1], threads))
    place = np.argsort(order)
    entries, exits = entries[place], exits[place]
    for piece in range(1, len(pieces)):
        first, kept, stop, _ = pieces[piece].tolist()
        if first == kept or np.array_equal(entries[piece], exits[piece - 1]):
            continue  # it goes on from where the piece before it ended, or begins a clip
        alone = np.array([[kept, kept, stop, -1]], dtype=np.int64)
        out = exits[piece : piece + 1]
        scan(alone, 0, stop - kept, initial=exits[piece - 1 : piece], entries=out, exits=out, ends=ends)


def _shares(pieces: Int64Array, n_rows: int, threads: int) -> list[slice]:
    """Consecutive pieces for each thread, whole groups of lanes with about as many columns each."""
    groups = pieces[::LANES]
    columns = np.concatenate([[0], np.cumsum(groups[:, 2] - groups[:, 0])])
    threads = useful_threads(threads, int(columns[-1]) * LANES * n_rows)
    if threads == 1:
        return [slice(0, len(pieces))]
    goals = np.linspace(0, columns[-1], threads + 1)[1:-1]
    bounds = [0, *np.searchsorted(columns, goals).tolist(), len(groups)]
    return [slice(a * LANES, b * LANES) for a, b in itertools.pairwise(bounds) if b > a]


def _share(work: Callable[[slice], None], parts: list[slice]) -> None:
    in_threads(work, parts, len(parts))
