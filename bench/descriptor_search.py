"""The 10 nearest descriptors of one query and of 100, beside peers, by the size of the repository; on one thread.

Descriptors are those of recordings under the pretrained network, each repeated with noise as large as half the median
distance of a clip from its nearest, and clusters of unit vectors, where a scan can rule out least: 12 directions in
each cluster. Queries are of the same kind and not in the repository.

Times are of the processor: on one thread they are those of a clock where nothing else runs, and elsewhere they are not
those of other programs. Those of a clock stand beside them.
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

import duckdb
import numpy as np
import pyarrow as pa
from motionlake import sql
from motionlake.arrays import Float32Array, Int64Array
from motionlake.deephums.config import DIMENSION, PRETRAINED_DESCRIPTORS
from motionlake.deephums.nearest import DescriptorScan, QuickIndex
from motionlake.deephums.network import load_descriptor
from motionlake.deephums.sequence import clip_sequence
from motionlake.training import on_threads
from numpy.typing import NDArray
from sklearn.neighbors import NearestNeighbors

from bench.canonical_sets import load
from bench.record import record

Times = dict[str, float]

SIZES: Final = (800, 7_000, 56_000, 200_000)
SETS: Final = ("hdm05", "utd_mhad")
QUERIES: Final = 100
K: Final = 10
BARS: Final = {"scan": 10.0, "quick": 3.0}  # milliseconds, one query over 56,000


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=25, help="of single queries; a fifth as many of batches")
    parser.add_argument("--sizes", type=int, nargs="*", default=SIZES)
    chosen = parser.parse_args()
    figures: dict[str, Any] = {"k": K, "bars_ms": BARS, "sets": SETS, "rounds": chosen.rounds}
    with on_threads(1):
        for name, make in (("recordings", of_recordings()), ("clusters", clusters)):
            figures[name] = {}
            for size in chosen.sizes:
                drawn = make(size + QUERIES, np.random.default_rng(size))
                figures[name][size] = row = measure(drawn[:size], drawn[size:], chosen.rounds)
                say(f"{name} {size}", row)
            for method, bar in BARS.items():
                if 56_000 in figures[name]:
                    found = figures[name][56_000]["one_ms"][method]
                    met = "met" if found <= bar else "MISSED"
                    print(f"{name} 56000: {method} {found:.2f} ms (bar {bar:g}: {met})")
    print(record("descriptor-search", figures, packages=("scikit-learn",)))


def say(title: str, row: dict[str, Any]) -> None:
    one = ", ".join(f"{name} {ms:.2f}" for name, ms in row["one_ms"].items())
    many = ", ".join(f"{name} {ms:.1f}" for name, ms in row["batch_ms"].items())
    print(f"{title}: one query, ms: {one}; {QUERIES}: {many}; identical: {row['identical']}", flush=True)


def measure(rows: Float32Array, queries: Float32Array, rounds: int) -> dict[str, Any]:
    """Median times of every method, ratios to the peers, and whether the answers are the same."""
    started = time.perf_counter()
    scan = DescriptorScan(rows)
    scanned = time.perf_counter()
    quick = QuickIndex.build(rows)
    built = time.perf_counter()
    squares, brute = np.square(rows).sum(axis=1), NearestNeighbors(algorithm="brute").fit(rows)
    con = in_duckdb(rows)
    one: dict[str, Callable[[Float32Array], Int64Array]] = {
        "scan": lambda query: scan.nearest(query, K).indices[0],
        "quick": lambda query: quick.nearest(query, K).indices[0],
        "numpy": lambda query: by_numpy(rows, squares, query[None])[0],
        "sklearn": lambda query: brute.kneighbors(query[None], K, return_distance=False)[0],
        "duckdb": lambda query: by_duckdb(con, query),
    }
    expected = scan.nearest(queries, K).indices
    same = np.array_equal(np.stack([one["quick"](query) for query in queries]), expected)
    agree = {name: agreement(method, queries[:20], expected) for name, method in one.items()}
    singles, singles_clock = interleaved({name: over(method, queries) for name, method in one.items()}, rounds)
    batches, batches_clock = interleaved(
        {
            "scan": lambda: scan.nearest(queries, K),
            "quick": lambda: [quick.nearest(query, K) for query in queries],
            "numpy": lambda: by_numpy(rows, squares, queries),
            "sklearn": lambda: brute.kneighbors(queries, K),
        },
        max(3, rounds // 5),
    )
    con.close()
    return {
        "one_ms": singles,
        "batch_ms": batches,
        "one_clock_ms": singles_clock,
        "batch_clock_ms": batches_clock,
        "ratios_one": {name: ms / singles["quick"] for name, ms in singles.items()},
        "ratios_batch": {name: ms / batches["scan"] for name, ms in batches.items()},
        "ready_seconds": {"scan": scanned - started, "quick": built - scanned},
        "blocks": [block.codes.shape[1] for block in quick.blocks],
        "identical": same,
        "agreement": agree,
    }


def interleaved(functions: Mapping[str, Callable[[], object]], rounds: int) -> tuple[Times, Times]:
    """Median milliseconds of each function, of the processor and by the clock, one call of each in turn."""
    spent: dict[str, list[tuple[float, float]]] = {name: [] for name in functions}
    for at in range(rounds + 1):
        for name, function in functions.items():
            before = time.process_time(), time.perf_counter()
            function()
            after = time.process_time(), time.perf_counter()
            if at:  # the first call warms up
                spent[name].append((after[0] - before[0], after[1] - before[1]))
    medians = {name: 1e3 * np.median(pairs, axis=0) for name, pairs in spent.items()}
    return {name: float(m[0]) for name, m in medians.items()}, {name: float(m[1]) for name, m in medians.items()}


def agreement(method: Callable[[Float32Array], Int64Array], queries: Float32Array, expected: Int64Array) -> float:
    """Share of its answers that are among those of the scan."""
    shares = [np.isin(method(query), own).mean() for query, own in zip(queries, expected, strict=False)]
    return float(np.mean(shares))


def over(method: Callable[[Float32Array], Int64Array], queries: Float32Array) -> Callable[[], object]:
    """The method on the next query at every call."""
    turn: Iterator[Float32Array] = itertools.cycle(queries)
    return lambda: method(next(turn))


def by_numpy(rows: Float32Array, squares: Float32Array, queries: Float32Array) -> Int64Array:
    found = squares - 2 * (queries @ rows.T)
    least = np.argpartition(found, K, axis=1)[:, :K]
    order = np.take_along_axis(found, least, axis=1).argsort(axis=1)
    return np.take_along_axis(least, order, axis=1)


def in_duckdb(rows: Float32Array) -> duckdb.DuckDBPyConnection:
    """The tables that the macro of a lake reads, in memory."""
    con = duckdb.connect()
    con.execute("SET threads = 1")
    lists = pa.FixedSizeListArray.from_arrays(pa.array(rows.ravel()), DIMENSION)
    con.register("made", pa.table({"clip": [f"{i:07}" for i in range(len(rows))], "descriptor": lists}))
    con.execute(
        "CREATE TABLE clips AS SELECT clip, NULL AS label, NULL::VARCHAR AS split, 'made' AS dataset, 1.0 AS seconds, "
        "'bvh' AS format FROM made"
    )
    con.execute(sql.read("schema/65_descriptors.sql"))
    con.execute("INSERT INTO descriptors BY NAME SELECT clip, descriptor, 'made' AS model, '' AS part FROM made")
    con.unregister("made")
    for macro in ("find_clip", "good_enough", "nearest_clips"):
        con.execute(sql.read(f"macros/{macro}.sql"))
    return con


def by_duckdb(con: duckdb.DuckDBPyConnection, query: Float32Array) -> Int64Array:
    found = con.execute("SELECT clip FROM clips_near($query, $k)", {"query": query.tolist(), "k": K}).fetchall()
    return np.array([int(clip) for (clip,) in found])


def of_recordings() -> Callable[[int, np.random.Generator], Float32Array]:
    """Descriptors of the sets, repeated with noise."""
    clips = [clip for name in SETS for clip in load(name)]
    real = load_descriptor(PRETRAINED_DESCRIPTORS.file).embed(
        [clip_sequence(clip.positions, clip.fps) for clip in clips]
    )
    apart = np.median(DescriptorScan(real).nearest(real, 2).distances[:, 1])
    print(f"{len(real)} recordings, median distance of a clip from its nearest {apart:.3f}")

    def make(count: int, rng: np.random.Generator) -> Float32Array:
        # Noise in the directions in which clips differ, as far as other takes would be.
        pairs = real[rng.integers(0, len(real), (2, count))]
        noise = pairs[0] - pairs[1]
        noise *= (apart / 2) / np.maximum(np.linalg.norm(noise, axis=1, keepdims=True), 1e-9)
        return unit(real[np.arange(count) % len(real)] + noise)

    return make


def clusters(count: int, rng: np.random.Generator) -> Float32Array:
    """Unit vectors about 60 centres, which differ in 12 directions of their own, and a little in all."""
    centres, spread = rng.standard_normal((60, DIMENSION)), rng.standard_normal((60, 12, DIMENSION)) / 12
    found = np.empty((count, DIMENSION), dtype=np.float32)
    for at, cluster in enumerate(rng.integers(0, 60, count).tolist()):
        found[at] = centres[cluster] + rng.standard_normal(12) @ spread[cluster]
    return unit(found + 0.1 * rng.standard_normal(found.shape, dtype=np.float32))


def unit(rows: NDArray[np.floating]) -> Float32Array:
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True), dtype=np.float32)


if __name__ == "__main__":
    main()
