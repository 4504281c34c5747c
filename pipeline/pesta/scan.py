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
from typing import Final

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

# Columns of a piece of a long string: enough to be worth its own lane, few enough to stay in cache.
LEAST_COLUMNS: Final = 1024
MOST_COLUMNS: Final = 4096
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


def least_in_one(
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


def _without_kernel(queries: Repository, texts: Repository, config: AlignmentConfig) -> bool:
    plain = not (config.local or config.gaps)
    return plain and few(plain_work(queries, texts, config.reach))


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
