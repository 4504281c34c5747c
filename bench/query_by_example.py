"""Query by example inside sequences beside sub-sequence DTW: `python -m bench.query_by_example [--words N] [--sets S]`.

cmu_exercises, in a lake of its own with the default configuration but for the seed of motifs: windows of 5 words that
lie wholly within a labelled segment are queries against the other takes, if their label occurs in one, a window every
`EVERY` frames. `--words 11` are the 32 frames of the paper's five longer words. Each is asked for as `motionlake find`
does, by every method, for all answers there are. The score of a frame is the distance of the answer that covers it;
frames of no answer come last; relevant are frames labelled like the query; frames without a label are left out. Average
precision over all frames of the other takes at the words' rate, tied frames together; `first` is the share of the ten
first answers in other takes of which half is labelled so. Means over the queries, then over the seeds. Weights are the
pretrained ones, trained without the set.

Other sets, of which as many queries are drawn by seed 0: cmu (cmu_bvh and cmu_86 by their segments; labels alike often)
and clips by their labels. `--choose` measures other constants of the default method; for each set those are chosen that
are best on the others.

Beside them stand floors, seen by the windows that cover a frame, the nearest of them: `words, every window` is how this
bench scored signatures before; DTW aligns the query's frames (the words' features) anywhere in a take, in four forms;
DTW of joints aligns those that moves see, smoothed, sized and turned alike, with windows as long as the query.
"""

from __future__ import annotations

import argparse
import itertools
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final
from unittest import mock

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.deep_motifs.query_by_example import ExampleQuery, distances_along, window_ranges
from motionlake.deep_motifs.signatures import Corpus
from motionlake.errors import UserError
from motionlake.jobs.models import take
from motionlake.jobs.run import run
from motionlake.jobs.session import session
from motionlake.lake.layout import Lake
from motionlake.motion.dtw import STEPS, alignment_ends, dtw_cross
from motionlake.retrieval import fused_ranges
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.protocol import Searcher
from motionlake.retrieval.registry import searcher
from motionlake.stages.registry import ALL
from motionlake.stages.word_network import WORD_NETWORK
from numpy.typing import NDArray

from bench.example_queries import (
    Query,
    Scorer,
    Takes,
    chance,
    mean_average_precision,
    queries_of,
    span_of,
    takes_of,
)
from bench.lakes import make_lake
from bench.pretrained_words import SETS as TRAINED
from bench.pretrained_words import train
from bench.record import hash_files, record, recordings

SEEDS: Final = (0, 1, 2)
SETS: Final = {
    "cmu_exercises": ("cmu_exercises",), "cmu": ("cmu_bvh", "cmu_86"), "hdm05": ("hdm05",), "bandai1": ("bandai1",),
    "utd_mhad": ("utd_mhad",),
}  # fmt: skip
METHODS: Final = ("fused", "words", "alignment", "moves")
STAGES: Final = tuple(stage for stage in ALL if stage not in ("descriptors", "submotions", "graph"))
FIRST: Final = 10  # answers of a first page
# Constants of the default method that are measured: what signature, embedding and moves count, and distance itself.
SHARES: Final = ((1, 1, 1), (1, 1, 2), (1, 1, 4), (1, 1, 0), (0, 0, 1))
DIRECTS: Final = (0.1, 0.5)


def answers(takes: Takes, queries: Sequence[Query], by: Searcher) -> dict[Query, list[Hit]]:
    """Every answer that a command prints; none where a method cannot compare the query."""
    found = {}
    for query in queries:
        try:
            (found[query],) = by.search([takes.asked(query)], 10**9)
        except UserError:  # to "alignment" a posture that is held is no string
            found[query] = []
    return found


def printed(takes: Takes, found: Mapping[Query, Sequence[Hit]]) -> Scorer:
    """The distance of the answer that covers a frame; of no answer it is the farthest."""

    def score(query: Query) -> list[Float64Array]:
        frames = [np.full(clip.frames, np.inf) for clip in takes.corpus.clips]
        for hit in found[query]:
            frames[takes.corpus.positions[hit.clip]][hit.start : hit.stop] = hit.distance
        last = max((hit.distance for hit in found[query]), default=0.0) + 1
        along = (np.where(np.isfinite(each), each, last) for each in frames)
        return [takes.sampled(clip, each) for clip, each in enumerate(along)]

    return score


def first_answers(takes: Takes, found: Mapping[Query, Sequence[Hit]]) -> float:
    """The share of the ten first labelled answers in other takes of which half is labelled like the query."""
    shares = []
    for query, hits in found.items():
        right: list[bool] = []
        for hit in hits:
            at = takes.corpus.positions[hit.clip]
            rate = takes.corpus.clips[at].fps / takes.config.fps
            labels = takes.labels[at][round((hit.start or 0) / rate) : max(round((hit.stop or 0) / rate), 1)]
            if len(right) < FIRST and at != query.clip and np.count_nonzero(labels) > len(labels) / 2:
                right.append(bool(np.mean(labels == query.label) >= 0.5))
        shares.append(float(np.mean(right)) if right else 0.0)
    return float(np.mean(shares))


def frame_distances_along(corpus: Corpus, clip: int, query: ExampleQuery) -> Float64Array:
    """[F] distance of the nearest window that covers each frame of a clip; beyond its last word, that word's."""
    return _covered(corpus, clip, query.n_words, distances_along(corpus, clip, query))


def _covered(corpus: Corpus, clip: int, n_words: int, along: Float64Array) -> Float64Array:
    frames = np.full(corpus.clips[clip].frames, np.inf)
    for (start, stop), distance in zip(window_ranges(corpus, clip, n_words), along, strict=True):
        np.minimum(frames[start:stop], distance, out=frames[start:stop])
    known = np.flatnonzero(np.isfinite(frames))
    frames[known[-1] + 1 :] = frames[known[-1]]
    return frames


def signatures(takes: Takes) -> Scorer:
    """The signature of the query's words, by the nearest window over each frame."""

    def score(query: Query) -> list[Float64Array]:
        motifs = takes.corpus.motifs[takes.corpus.words_of(query.clip)][query.first : query.first + query.words]
        asked = ExampleQuery(motifs)
        clips = range(len(takes.labels))
        return [takes.sampled(clip, frame_distances_along(takes.corpus, clip, asked)) for clip in clips]

    return score


def dtw(takes: Takes, steps: str, squared: bool) -> Scorer:
    """The frames of the query's words, aligned."""

    def score(query: Query) -> list[Float64Array]:
        start = query.first * takes.config.stride
        frames = takes.features[query.clip][start : start + span_of(takes, query.words)]
        return [frame_costs(*alignment_ends(frames, each, steps, squared=squared)) for each in takes.features]

    return score


def dtw_of_joints(takes: Takes, n_words: int) -> Scorer:
    """The joints that moves see, of windows as long as the query that begin at every word."""
    corpus = takes.corpus
    windows = [
        [_joints(takes, clip, start, stop) for start, stop in window_ranges(corpus, clip, n_words)]
        for clip in range(len(corpus.clips))
    ]

    def score(query: Query) -> list[Float64Array]:
        asked = windows[query.clip][query.first]
        along = (dtw_cross([asked], each)[0] for each in windows)
        return [takes.sampled(clip, _covered(corpus, clip, n_words, each)) for clip, each in enumerate(along)]

    return score


def _joints(takes: Takes, clip: int, start: int, stop: int) -> Float32Array:
    track = takes.tracks[clip]
    pace = max(1, takes.corpus.clips[clip].frames - 1) / (len(track.joints) - 1)
    joints = track.cut(round(start / pace), round((stop - 1) / pace) + 1).turned().joints
    return np.asarray(joints - joints[:, :3].mean(axis=0)[None].repeat(15, axis=0).reshape(1, -1), dtype=np.float32)


def frame_costs(costs: Float64Array, starts: NDArray[np.int64]) -> Float64Array:
    """[T] cost of the cheapest alignment that covers each frame; where none does, that of the dearest."""
    covered = np.full(len(costs), np.inf)
    for end in range(len(costs)):
        span = covered[starts[end] : end + 1]
        np.minimum(span, costs[end], out=span)
    covered[~np.isfinite(covered)] = np.max(covered[np.isfinite(covered)], initial=0.0)
    return covered


def made(folder: Path, name: str) -> Lake:
    """A lake of a set with the word network that comes with the package, trained without it."""
    lake = make_lake(folder, [recordings() / source for source in SETS[name]])
    if set(SETS[name]) & set(TRAINED):
        weights = folder / "words.safetensors"
        train(tuple(each for each in TRAINED if each not in SETS[name])).save(weights)
        with session(lake, "bench", lambda stage, done, total: None, lambda line: None) as job:
            take(job, WORD_NETWORK, weights)
    return lake


def brought_up(lake: Lake, seed: int) -> None:
    """Every stage that ranges are found by, with a seed of motifs."""
    lake.config_file.write_text(f"[motifs]\nseed = {seed}\n", encoding="utf-8")
    with session(lake, "bench", lambda stage, done, total: None, lambda line: None) as job:
        run(job, STAGES)
        failed = [f"{stage}: {outcome.reason}" for stage, outcome in job.outcomes.items() if outcome.failed]
    if failed:
        raise RuntimeError("; ".join(failed))


def floors(takes: Takes, n_words: int) -> Iterator[tuple[str, Scorer]]:
    for steps, squared in itertools.product(STEPS, (False, True)):
        yield f"sub-sequence DTW, {steps} steps, {'squared ' if squared else ''}distances", dtw(takes, steps, squared)
    yield "DTW of joints, every window", dtw_of_joints(takes, n_words)


def measure(name: str, n_words: int, count: int | None, methods: Sequence[str]) -> dict[str, object]:
    """Average precision by method and floor, mean over seeds of what has one."""
    runs: dict[str, list[dict[str, float]]] = {}
    with tempfile.TemporaryDirectory(prefix="bench-find-") as folder:
        lake = made(Path(folder), name)
        for seed in SEEDS:
            brought_up(lake, seed)
            takes = takes_of(lake, [recordings() / source for source in SETS[name]])
            queries = queries_of(takes, n_words, count)
            for method in methods if seed == SEEDS[0] else [m for m in methods if m in ("fused", "words")]:
                by = searcher("range", method, lake)
                found = answers(takes, queries, by)
                scores = mean_average_precision(takes, queries, printed(takes, found))
                runs.setdefault(method, []).append(scores | {"first": first_answers(takes, found)})
                print(f"{name}, seed {seed}, {method}: {_line(runs[method][-1])}", flush=True)
            dense = mean_average_precision(takes, queries, signatures(takes))
            runs.setdefault("words, every window", []).append(dense)
        for floor, scorer in floors(takes, n_words):
            runs[floor] = [mean_average_precision(takes, queries, scorer)]
            print(f"{name}, {floor}: {_line(runs[floor][0])}", flush=True)
    means = {how: {key: float(np.mean([r[key] for r in rows])) for key in rows[0]} for how, rows in runs.items()}
    by_seed = {how: [row["mean"] for row in rows] for how, rows in runs.items() if len(rows) > 1}
    return {"average_precision": means, "by_seed": by_seed, "queries": len(queries), "chance": chance(takes, queries)}


def choose(names: Sequence[str], n_words: int, count: int | None) -> dict[str, object]:
    """Average precision by constants of the default method and set; for each set, that of the best on the others."""
    found: dict[str, dict[str, float]] = {}
    for name in names:
        with tempfile.TemporaryDirectory(prefix="bench-find-") as folder:
            lake = made(Path(folder), name)
            brought_up(lake, SEEDS[0])
            takes = takes_of(lake, [recordings() / source for source in SETS[name]])
            queries = queries_of(takes, n_words, count)
            by = searcher("range", "fused", lake)
            for shares, direct in itertools.product(SHARES, DIRECTS):
                weights = dict(zip(("signature", "embedding", "moves"), map(float, shares), strict=True))
                with mock.patch.multiple(fused_ranges, WEIGHTS=weights, DIRECT=direct):
                    found_by = answers(takes, queries, by)
                mean = mean_average_precision(takes, queries, printed(takes, found_by))["mean"]
                found.setdefault(f"{shares} {direct}", {})[name] = mean
                print(f"{name} {shares} {direct}: {mean:.3f}", flush=True)
    left_out = {}
    for name in names:
        others = [other for other in names if other != name] or [name]
        best = max(found, key=lambda how: float(np.mean([found[how][other] for other in others])))
        left_out[name] = {"constants": best, "mean": found[best][name]}
    return {"by constants": found, "left out": left_out}


def main() -> None:
    parser = argparse.ArgumentParser(description="Measure query by example beside sub-sequence DTW.")
    parser.add_argument("--words", type=int, default=5)
    parser.add_argument("--sets", nargs="+", choices=SETS, default=["cmu_exercises"])
    parser.add_argument("--queries", type=int, help="how many a set (default: all of them)")
    parser.add_argument("--methods", nargs="+", default=list(METHODS))
    parser.add_argument("--choose", action="store_true", help="measure other constants of the default method")
    given = parser.parse_args()
    figures: dict[str, object]
    if given.choose:
        figures = choose(given.sets, given.words, given.queries)
        print(figures["left out"])
    else:
        figures = {name: measure(name, given.words, given.queries, given.methods) for name in given.sets}
    sources = [recordings() / source for name in given.sets for source in SETS[name]]
    data = hash_files([path for source in sources for path in source.rglob("*") if path.is_file()], recordings())
    print(record("query-by-example", figures | {"words": given.words, "seeds": list(SEEDS)}, data))


def _line(scores: Mapping[str, float]) -> str:
    return "  ".join(f"{name} {value:.3f}" for name, value in scores.items())


if __name__ == "__main__":
    main()
