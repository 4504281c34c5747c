"""Nearest signatures by Earth Mover's Distance against scanning with POT: `python -m bench.emd`.

Top 10 of 10,000 signatures for 50 others, K = 200 motifs, one thread, one process, interleaved query by query.
Words are those of four labelled sets, embedded by their principal components. Two collections:

- "windows": windows of 60 to 240 words over the clips of a set laid end to end, about 15 motifs each
- "mixed": seven windows of 4 to 24 words from seven clips each, about 30 motifs: as many as signatures of long
  recordings hold, and harder, since mixtures resemble one another

Three scans stand beside the search: POT's `emd2` on the non-zero support as it is called by default, the same
without its checks, and `emd_many`, which solves what two signatures do not share. Answers must equal those of
the last to the last bit. Bars: 20 times the fastest scan, at most 2 % of the transports solved.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import ot
from motionlake.arrays import Float32Array, Float64Array, Int32Array
from motionlake.deep_motifs.emd import emd_many, ground_distances
from motionlake.deep_motifs.emd_search import SignatureIndex
from motionlake.deep_motifs.motifs import assign, fit_motifs
from motionlake.deep_motifs.signatures import inverse_document_frequency, signature
from motionlake.motion.features import WordConfig
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from bench.canonical_sets import SETS, features, load
from bench.record import record
from bench.representation import shallow

K: Final = 200
COUNT: Final = 10_000
QUERIES: Final = 50
TOP: Final = 10
PEER_QUERIES: Final = 5  # of the 50; a scan takes seconds
PEERS: Final[dict[str, dict[str, bool]]] = {
    "emd2": {},
    "emd2_unchecked": {"check_marginals": False, "center_dual": False},
}
BARS: Final = {"ratio": 20.0, "solved_share": 0.02}


@dataclass(frozen=True)
class Words:
    """Motifs of the words of each clip, the set of each clip, and what signatures need besides."""

    clips: list[Int32Array]
    sets: list[str]
    idf: Float64Array
    ground: Float64Array


def read_words() -> Words:
    """The words of all sets over one vocabulary of motifs."""
    config = WordConfig()
    clips: list[Float32Array] = []
    sets: list[str] = []
    for name in SETS:
        found = features(load(name), config)
        clips += found
        sets += [name] * len(found)
    embedded = shallow(clips, config, 0)
    motifs = fit_motifs(np.concatenate(embedded), K, 0)
    assigned = [assign(vectors, motifs) for vectors in embedded]
    counts = np.stack([np.bincount(words, minlength=motifs.k) for words in assigned])
    idf = inverse_document_frequency(counts)
    return Words(assigned, sets, idf, ground_distances(motifs.centroids))


def windows(words: Words, count: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """[count, K] signatures of windows over clips laid end to end."""
    names = sorted(set(words.sets))
    streams = [np.concatenate([c for c, s in zip(words.clips, words.sets, strict=True) if s == n]) for n in names]
    lengths = np.array([len(stream) for stream in streams])
    found = []
    for at in rng.choice(len(streams), count, p=lengths / lengths.sum()):
        found.append(_sign(words, [_window(streams[at], 60, 240, rng)]))
    return np.stack(found)


def mixed(words: Words, count: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """[count, K] signatures of mixtures of short windows."""
    chosen = rng.integers(0, len(words.clips), (count, 7))
    return np.stack([_sign(words, [_window(words.clips[c], 4, 24, rng) for c in row]) for row in chosen])


def _window(stream: Int32Array, shortest: int, longest: int, rng: np.random.Generator) -> Int32Array:
    length = min(len(stream), int(rng.integers(shortest, longest + 1)))
    start = int(rng.integers(0, len(stream) - length + 1))
    return stream[start : start + length]


def _sign(words: Words, parts: list[Int32Array]) -> NDArray[np.float32]:
    return signature(np.bincount(np.concatenate(parts), minlength=len(words.idf)), words.idf)


def scan_support(
    query: Float64Array, rows: Float64Array, ground: Float64Array, options: dict[str, bool]
) -> Float64Array:
    """[n] POT's `emd2` from each of `rows` [n, K] on what either holds."""
    i = np.flatnonzero(query)
    found = []
    for row in rows:
        j = np.flatnonzero(row)
        found.append(ot.emd2(query[i], row[j], np.ascontiguousarray(ground[np.ix_(i, j)]), **options))
    return np.array(found)


def measure(signatures: NDArray[np.float32], ground: Float64Array) -> dict[str, Any]:
    """Times, answers, and the bounds of one collection."""
    rows, queries = signatures[:COUNT], signatures[COUNT:]
    masses = signatures.astype(np.float64)
    masses /= masses.sum(axis=1, keepdims=True)
    started = time.perf_counter()
    index = SignatureIndex.build(rows, ground)
    built = time.perf_counter() - started
    index.nearest(queries[0], TOP)
    seconds: dict[str, list[float]] = {name: [] for name in ("search", "emd_many", *PEERS)}
    same, solved, tightness = True, [], []
    for at, query in enumerate(queries):
        mass = masses[COUNT + at]
        found = _time(seconds["search"], index.nearest, query, TOP)
        exact = _time(seconds["emd_many"], emd_many, query, rows, ground)
        if at < PEER_QUERIES:
            for name, options in PEERS.items():
                theirs = _time(seconds[name], scan_support, mass, masses[:COUNT], ground, options)
                np.testing.assert_allclose(theirs, exact, rtol=1e-9, atol=1e-12)
        order = np.lexsort((np.arange(COUNT), exact))[:TOP]
        same &= np.array_equal(found.indices, order) and np.array_equal(found.distances, exact[order])
        solved.append(found.solved / COUNT)
        tightness.append(_tightness(index, mass, exact))
    ratios = {name: _ratio(values, seconds["search"]) for name, values in seconds.items() if name != "search"}
    return {
        "motifs_a_signature": float(np.count_nonzero(signatures, axis=1).mean()),
        "index_seconds": built,
        "seconds": {name: statistics.median(values) for name, values in seconds.items()},
        "ratios": ratios,
        "ratio": min(ratios.values()),
        "solved_share": float(np.mean(solved)),
        "solved_share_max": float(np.max(solved)),
        "identical": bool(same),
        "bounds": {name: [float(v) for v in np.mean([t[name] for t in tightness], axis=0)] for name in tightness[0]},
    }


def _time(seconds: list[float], function: Callable[..., Any], *arguments: Any) -> Any:
    started = time.perf_counter()
    found = function(*arguments)
    seconds.append(time.perf_counter() - started)
    return found


def _ratio(scans: list[float], searches: list[float]) -> float:
    """Median over the queries that were scanned."""
    return statistics.median(scan / search for scan, search in zip(scans, searches, strict=False))


def _tightness(index: SignatureIndex, mass: Float64Array, exact: Float64Array) -> dict[str, tuple[float, float, float]]:
    """Of each bound: mean share of the exact distance, over all and over the nearest 100; pairs a second."""
    everything = np.arange(len(index))
    near = np.argsort(exact)[:100]
    found = {}
    for name, bound in (("projection", index.cheap_bounds), ("transfer", index.tight_bounds)):
        started = time.perf_counter()
        values = bound(mass, everything)
        rate = len(index) / (time.perf_counter() - started)
        assert (values <= exact).all()
        share = np.divide(values, exact, out=np.ones(len(index)), where=exact > 0)
        found[name] = (float(share.mean()), float(share[near].mean()), rate)
    return found


def main() -> None:
    figures: dict[str, Any] = {"k": K, "count": COUNT, "queries": QUERIES, "top": TOP, "bars": BARS}
    with threadpool_limits(limits=1):
        words = read_words()
        for make in (windows, mixed):
            result = measure(make(words, COUNT + QUERIES, np.random.default_rng(0)), words.ground)
            figures[make.__name__] = result
            print(f"{make.__name__}: {result['motifs_a_signature']:.1f} motifs a signature")
            for name, seconds in result["seconds"].items():
                print(f"  {name:15} {seconds * 1e3:9.1f} ms a query")
            for name, (share, near, rate) in result["bounds"].items():
                print(f"  {name}: {share:.3f} of the distance, {near:.3f} of the nearest, {rate / 1e6:.2f} M pairs/s")
            good = result["ratio"] >= BARS["ratio"] and result["solved_share"] <= BARS["solved_share"]
            print(
                f"  {result['ratio']:.0f} times the fastest scan (bar {BARS['ratio']:g}), {result['solved_share']:.2%} "
                f"solved (bar {BARS['solved_share']:.0%}), identical answers: {result['identical']}: "
                + ("met" if good and result["identical"] else "MISSED")
            )
    print(record("emd", figures, packages=("pot",)))


if __name__ == "__main__":
    main()
