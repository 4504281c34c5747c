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
from concurrent.futures import ThreadPoolExecutor
from typing import Final, Literal

import numpy as np
from motionlake.arrays import Float32Array, Int32Array, Int64Array
from motionlake.pesta.alignment.kernels import query_profile, scanner
from motionlake.pesta.alignment.strings import Distances, Repository, SymbolDistances, checked
from motionlake.pesta.alignment.vectors import LANES
from motionlake.pesta.config import AlignmentConfig
from numpy.typing import ArrayLike

Boundaries = Literal["kept", "crossed", "dropped"]
Both = Literal["max", "mean", "query"]

# Columns of a piece of a long string: enough to be worth its own lane, few enough to stay in cache.
LEAST_COLUMNS: Final = 1024
MOST_COLUMNS: Final = 4096
_NO_COSTS: Final = np.zeros(0, dtype=np.float32)
_NO_STATES: Final = np.zeros((0, 0, 0), dtype=np.float32)


def end_costs(
    query: ArrayLike,
    repository: Repository,
    distances: Distances,
    config: AlignmentConfig | None = None,
    *,
    boundaries: Boundaries = "kept",
    threads: int = 1,
) -> Float32Array:
    """W(X, y): the cost of the best match that ends at each symbol of a repository.

    Args:
        query: [X] symbols.
        repository: Y symbols of n clips.
        distances: [m, m] of the dictionary's symbols.
        config: the alignment.
        boundaries: "kept" aligns each clip by itself; else the clips make one string.
        threads: which share the work; the result does not depend on their number.

    Returns:
        [Y] float32.

    Raises:
        ValueError: an empty query, a symbol outside the dictionary, distances that are none.
    """
    config = config or AlignmentConfig()
    ground = SymbolDistances.of(distances)
    query = checked(query, repository, ground)
    where = repository if boundaries == "kept" else repository.joined
    return scan_ends(query, where, ground, config, threads)


def best_per_clip(
    query: ArrayLike,
    repository: Repository,
    distances: Distances,
    config: AlignmentConfig | None = None,
    *,
    threads: int = 1,
) -> Float32Array:
    """[n] the least end cost of a query in each clip, as `end_costs`; infinite in an empty clip."""
    config = config or AlignmentConfig()
    ground = SymbolDistances.of(distances)
    query = checked(query, repository, ground)
    best = np.full(len(repository), np.inf, dtype=np.float32)
    pieces = _whole(repository)
    scan, profile = scanner(config.reach), query_profile(query, ground.matrix)

    def work(part: slice) -> None:
        scan(
            profile, len(query), config.local, *ground.scores(config), repository.symbols, pieces[part], 0, 0,
            _NO_STATES, _NO_STATES, _NO_STATES, _NO_COSTS, best,
        )  # fmt: skip

    _share(work, _shares(pieces, threads))
    return best


def pairwise(
    queries: Sequence[ArrayLike],
    repository: Repository,
    distances: Distances,
    config: AlignmentConfig | None = None,
    *,
    threads: int = 1,
) -> Float32Array:
    """The least end cost of every query in every clip.

    Args:
        queries: q strings.
        repository, distances, config, threads: as in `end_costs`.

    Returns:
        [q, n] float32; infinite in an empty clip.

    Raises:
        ValueError: as in `end_costs`.
    """
    config = config or AlignmentConfig()
    ground = SymbolDistances.of(distances)
    checked_queries = [checked(query, repository, ground) for query in queries]
    costs = np.full((len(queries), len(repository)), np.inf, dtype=np.float32)
    pieces = _whole(repository)
    scan = scanner(config.reach)

    def work(part: slice) -> None:
        for query, best in zip(checked_queries[part], costs[part], strict=True):
            scan(
                query_profile(query, ground.matrix), len(query), config.local, *ground.scores(config),
                repository.symbols, pieces, 0, 0, _NO_STATES, _NO_STATES, _NO_STATES, _NO_COSTS, best,
            )  # fmt: skip

    bounds = np.linspace(0, len(queries), max(1, threads) + 1).astype(int).tolist()
    _share(work, [slice(a, b) for a, b in itertools.pairwise(bounds)])
    return costs


def symmetric_costs(
    strings: Sequence[ArrayLike] | Repository,
    distances: Distances,
    config: AlignmentConfig | None = None,
    *,
    both: Both = "max",
    threads: int = 1,
) -> Float32Array:
    """Costs between whole strings for each symbol of the query.

    A cost grows with the query's length, and a short query is found in many strings; hence the division, and both ways.

    Args:
        strings: n strings, none of them empty.
        distances, config, threads: as in `end_costs`.
        both: the greater ("max") or mean of cost(a in b) / len(a) and cost(b in a) / len(b); "query" the first alone,
            with a the row.

    Returns:
        [n, n] float32.

    Raises:
        ValueError: as in `end_costs`; an unknown `both`.
    """
    if both not in ("max", "mean", "query"):
        raise ValueError(f"both is {both!r}, not max, mean or query")
    repository = strings if isinstance(strings, Repository) else Repository.of(strings)
    queries = [repository.string(clip) for clip in range(len(repository))]
    costs = pairwise(queries, repository, distances, config, threads=threads)
    costs /= np.maximum(repository.lengths, 1)[:, None].astype(np.float32)
    if both == "query":
        return costs
    return np.maximum(costs, costs.T) if both == "max" else (costs + costs.T) / np.float32(2)


def scan_ends(
    query: Int32Array, repository: Repository, ground: SymbolDistances, config: AlignmentConfig, threads: int
) -> Float32Array:
    """[Y] end costs, clip by clip; all checked before."""
    ends = np.empty(len(repository.symbols), dtype=np.float32)
    warm = 2 * len(query) + 2 * LANES
    longest = max(4 * warm, min(max(-(-len(ends) // LANES), LEAST_COLUMNS), MOST_COLUMNS))
    cut = np.flatnonzero(repository.lengths > warm + longest)
    run = _Scan(query, repository.symbols, ground, config, ends, threads)
    run.whole(_whole(repository, longest + warm))
    if len(cut):
        bounds = zip(repository.offsets[cut].tolist(), repository.offsets[cut + 1].tolist(), strict=True)
        run.cut([_cut(start, stop, warm, longest) for start, stop in bounds], warm, longest)
    return ends


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


class _Scan:
    """One query scanned over pieces of strings, all of their end costs kept."""

    def __init__(
        self,
        query: Int32Array,
        symbols: Int32Array,
        ground: SymbolDistances,
        config: AlignmentConfig,
        ends: Float32Array,
        threads: int,
    ) -> None:
        self._kernel = scanner(config.reach)
        self._query = query_profile(query, ground.matrix), len(query), config.local, *ground.scores(config)
        self._symbols, self._ends, self._threads = symbols, ends, threads
        self._state = config.reach, len(query)

    def whole(self, pieces: Int64Array) -> None:
        """Scan clips that are one piece each."""

        def work(part: slice) -> None:
            self._run(pieces[part], 0, 0)

        _share(work, _shares(pieces, self._threads))

    def cut(self, clips: list[Int64Array], warm: int, longest: int) -> None:
        """Scan clips that are several pieces each."""
        pieces = np.concatenate(clips)
        order = np.argsort(pieces[:, 0] - pieces[:, 2], kind="stable")
        entries, exits = (np.empty((len(pieces), *self._state), dtype=np.float32) for _ in range(2))
        by_length = pieces[order]

        def work(part: slice) -> None:
            self._run(by_length[part], warm, warm + longest, entries=entries[part], exits=exits[part])

        _share(work, _shares(by_length, self._threads))
        place = np.empty(len(pieces), dtype=np.int64)
        place[order] = np.arange(len(pieces))
        self._mend(pieces, entries[place], exits[place])

    def _mend(self, pieces: Int64Array, entries: Float32Array, exits: Float32Array) -> None:
        """Scan those pieces again that do not go on from where the piece before them ended."""
        for piece in range(1, len(pieces)):
            first, kept, stop, _ = pieces[piece].tolist()
            if first == kept or np.array_equal(entries[piece], exits[piece - 1]):
                continue
            alone = np.array([[kept, kept, stop, -1]], dtype=np.int64)
            out = exits[piece : piece + 1]
            self._run(alone, 0, stop - kept, initial=exits[piece - 1 : piece], entries=out, exits=out)

    def _run(
        self,
        pieces: Int64Array,
        warm: int,
        full: int,
        *,
        initial: Float32Array = _NO_STATES,
        entries: Float32Array = _NO_STATES,
        exits: Float32Array = _NO_STATES,
    ) -> None:
        self._kernel(
            *self._query, self._symbols, pieces, warm, full, initial, entries, exits, self._ends, _NO_COSTS
        )  # fmt: skip


def _shares(pieces: Int64Array, threads: int) -> list[slice]:
    """Consecutive pieces for each thread, whole groups of lanes with about as many columns each."""
    if threads <= 1:
        return [slice(0, len(pieces))]
    groups = pieces[::LANES]
    columns = np.concatenate([[0], np.cumsum(groups[:, 2] - groups[:, 0])])
    goals = np.linspace(0, columns[-1], threads + 1)[1:-1]
    bounds = [0, *np.searchsorted(columns, goals).tolist(), len(groups)]
    return [slice(a * LANES, b * LANES) for a, b in itertools.pairwise(bounds) if b > a]


def _share(work: Callable[[slice], None], parts: list[slice]) -> None:
    if len(parts) <= 1:
        for part in parts:
            work(part)
        return
    with ThreadPoolExecutor(len(parts)) as pool:
        for _ in pool.map(work, parts):
            pass
