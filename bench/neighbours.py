"""The 5 nearest words of each of 1,000,000 under DTW: `python -m bench.neighbours [--words N]`.

The corpus: every word of stride 1 of every set of MOTIONLAKE_DATA, the same words mirrored, and four time-warped
copies of each of both, drawn at random to N. Words of one clip whose first frames are less than a word apart, and
all their copies, are one source: they are no neighbours of each other. The search is approximate, on `--threads`
threads; 1,000 words drawn at random are then compared with every word (brute force), which gives recall@5 and how
much farther the words found are than the nearest. How candidates are found was chosen on smaller corpora of another
seed.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float32Array, Int64Array
from motionlake.deep_motifs.words.dtw import word_distances
from motionlake.deep_motifs.words.neighbours import Neighbours, SearchConfig, search
from motionlake.deep_motifs.words.triplets import time_warped
from motionlake.deep_motifs.words.word_index import WordSet, fit_index
from motionlake.formats import is_clip
from motionlake.jobs.run import run
from motionlake.jobs.session import session
from motionlake.lake.catalog import reading
from motionlake.lake.config import LakeConfig
from motionlake.lake.layout import Lake
from motionlake.motion.features import WordConfig, mirrored_features, padded
from motionlake.stages import words
from threadpoolctl import threadpool_limits

from bench.lakes import make_lake
from bench.record import hash_files, record, recordings

K: Final = 5
ANCHORS: Final = 1000
WARPED: Final = 4  # time-warped copies of each word
RECALL_BAR, SECONDS_BAR = 0.95, 3600.0
BLOCK: Final = 8192
CONFIG: Final = WordConfig(stride=1)
# A distance that equals the fifth nearest but for rounding is as good.
RELATIVE, ABSOLUTE = 1e-4, 1e-6


def all_features(folder: Path) -> list[Float32Array]:
    """Features of every clip of every set, in order of the clips."""
    sets = sorted(p for p in recordings().iterdir() if p.is_dir() and any(map(is_clip, p.rglob("*"))))
    lake = make_lake(folder, sets)
    with session(lake, "bench", lambda stage, done, total: None, lambda line: None) as job:
        run(job, ["words"])
    return features_of(lake)


def features_of(lake: Lake) -> list[Float32Array]:
    with reading(lake) as con:
        files = words.features_files(con, LakeConfig().words)
    found: dict[str, Float32Array] = {}
    for file in files.values():
        found.update(words.read_features(lake.path(file)))
    return [found[clip] for clip in sorted(found)]


def corpus(features: list[Float32Array], count: int, seed: int) -> tuple[WordSet, Int64Array]:
    """`count` words, and for each the place of its source among all frames."""
    clips = [padded(f, CONFIG) for f in features]
    both = [np.concatenate(clips), np.concatenate([mirrored_features(c, CONFIG) for c in clips])]
    lengths = np.array([len(c) for c in clips])
    first = np.cumsum([0, *lengths[:-1]])
    starts = np.concatenate([np.arange(f, f + n - CONFIG.length + 1) for f, n in zip(first, lengths, strict=True)])
    # Clips lie a word apart, so that words of two clips are never one source.
    places = starts + CONFIG.length * np.repeat(np.arange(len(clips)), lengths - CONFIG.length + 1)
    rng = np.random.default_rng(seed)
    drawn = np.sort(rng.permutation(len(starts) * 2 * (1 + WARPED))[:count])
    copy, source = drawn // len(starts), drawn % len(starts)
    plain = int(np.searchsorted(copy, 2))
    frames = np.empty((len(both[0]) * 2 + (len(drawn) - plain) * CONFIG.length, CONFIG.dimension), np.float32)
    frames[: 2 * len(both[0])] = np.concatenate(both)
    where = starts[source] + (copy % 2) * len(both[0])
    originals = WordSet(frames[: 2 * len(both[0])], where, CONFIG.length)
    for low in range(plain, len(drawn), BLOCK):
        rows = slice(low, min(low + BLOCK, len(drawn)))
        warped = time_warped(originals.take(rows), rng)
        where[rows] = 2 * len(both[0]) + (np.arange(rows.start, rows.stop) - plain) * CONFIG.length
        frames[where[low] : where[low] + warped.shape[0] * CONFIG.length] = warped.reshape(-1, CONFIG.dimension)
    return WordSet(frames, where, CONFIG.length), places[source]


def nearest_by_brute_force(corpus: WordSet, places: Int64Array, anchors: Int64Array, threads: int) -> Float32Array:
    """[A, K] distances of the nearest words of other sources, every word aligned."""
    asked = corpus.take(anchors)

    def nearest(low: int) -> Float32Array:
        rows = slice(low, low + BLOCK)
        distances = word_distances(asked, corpus.take(rows))
        distances[np.abs(places[anchors][:, None] - places[rows]) < CONFIG.length] = np.inf
        filled = np.pad(distances, ((0, 0), (0, K)), constant_values=np.inf)
        return np.partition(filled, K - 1, axis=1)[:, :K]

    with threadpool_limits(limits=1), ThreadPoolExecutor(threads) as pool:
        best = list(pool.map(nearest, range(0, len(corpus), BLOCK)))
    return np.sort(np.concatenate(best, axis=1), axis=1)[:, :K]


def figures_of(found: Neighbours, anchors: Int64Array, truth: Float32Array) -> dict[str, float]:
    distances = found.distances[anchors]
    right = distances <= truth[:, -1:] * (1 + RELATIVE) + ABSOLUTE
    return {
        "recall_at_5": float(right.mean()),
        "anchors_with_all_5": float(right.all(axis=1).mean()),
        "mean_distance_ratio": float(distances.sum() / truth.sum()),
        "unfilled": float((found.indices < 0).mean()),
    }


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m bench.neighbours", description=__doc__)
    parser.add_argument("--words", type=int, default=1_000_000)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0, help="of the corpus and the anchors")
    parser.add_argument("--lake", type=Path, help="take the features of this lake instead of making one")
    chosen = parser.parse_args()
    if chosen.lake:
        features, data = features_of(Lake(chosen.lake.absolute())), ""
    else:
        with tempfile.TemporaryDirectory() as folder:
            features = all_features(Path(folder))
        data = hash_files([p for p in recordings().rglob("*") if p.is_file()], recordings())
    words_, places = corpus(features, chosen.words, chosen.seed)
    print(f"{len(words_)} words of {len(features)} clips")
    config = SearchConfig(apart=CONFIG.length)
    started, processor = time.perf_counter(), time.process_time()
    searched = fit_index(words_, places)
    indexed = time.perf_counter() - started
    print(f"indexed in {indexed:.0f} s")
    progress = _Shares(time.perf_counter())
    found = search(searched, words_, places, K, config, threads=chosen.threads, progress=progress)
    seconds, processor = time.perf_counter() - started, time.process_time() - processor
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    anchors = np.sort(np.random.default_rng(chosen.seed + 1).permutation(len(words_))[:ANCHORS])
    started = time.perf_counter()
    truth = nearest_by_brute_force(words_, places, anchors, chosen.threads)
    brute = time.perf_counter() - started
    figures: dict[str, Any] = {
        "words": len(words_), "clips": len(features), "k": K, "threads": chosen.threads, "seed": chosen.seed,
        "seconds": seconds, "seconds_index": indexed, "processor_seconds": processor, "peak_gib": memory,
        "anchors": len(anchors), "brute_force_seconds": brute,
        "brute_force_all_words_seconds": brute / len(anchors) * len(words_),
        **figures_of(found, anchors, truth),
        "bars": {"recall_at_5": RECALL_BAR, "seconds": SECONDS_BAR},
    }  # fmt: skip
    met = figures["recall_at_5"] >= RECALL_BAR and seconds <= SECONDS_BAR
    for name, value in figures.items():
        print(f"{name:32} {value:.4g}" if isinstance(value, float) else f"{name:32} {value}")
    print(f"recall@5 at least {RECALL_BAR} within {SECONDS_BAR:.0f} s: {'met' if met else 'MISSED'}")
    print(record("neighbours", figures, data))


class _Shares:
    """Says every tenth of the way how long it took."""

    def __init__(self, started: float) -> None:
        self._started, self._told = started, 0

    def __call__(self, done: int, total: int) -> None:
        if 10 * done // total > self._told:
            self._told = 10 * done // total
            print(f"{self._told * 10} % after {time.perf_counter() - self._started:.0f} s", flush=True)


if __name__ == "__main__":
    main()
