"""Takes cut by ACA and HACA, and by ours: what `python -m bench.comparators segmentation` measures.

The measure is that of HACA as we understand it: frames are grouped, each group is given one class, no two the same,
so that as many frames as can be are right (Hungarian method), and the share of them counts; of the frames at the
words' rate that have a class. ACA and HACA see the take alone and are told how many classes it has. Ours are told
what the classes look like, by the other takes (cmu_exercises) or by other sets (86_01), as in `bench.segmentation`,
and know nothing of how many there are; a frame has the class of the word whose centre is nearest.

`most` and the width of the kernel are constants of ACA and HACA that no description gives for 24 frames a second:
every pair of `MOST` and `SHARES` is measured, and each take has the pair that is best on the others, by their ground
truth.
"""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float32Array, IntArray
from motionlake.deep_motifs.segmentation import LabelledRange
from motionlake.evaluation.segmentation import segments_of
from motionlake.formats import read_clips
from motionlake.lake.catalog import reading
from motionlake.lake.corpus import read_corpus
from motionlake.lake.layout import Lake
from motionlake.motion.canonicalise import canonicalise
from motionlake.motion.features import word_features
from motionlake.motion.kinematics import solve
from motionlake.motion.rigs import identify, load_rigs
from motionlake.retrieval.segment_methods import segment_method
from scipy.optimize import linear_sum_assignment
from sklearn.cluster import KMeans
from threadpoolctl import threadpool_limits

from bench.comparators.aligned_clusters import aca, haca
from bench.comparators.seen import WORDS
from bench.record import recordings
from bench.units import Found

SETS: Final = ("cmu_86", "cmu_exercises")
STEP: Final = 2  # of so many frames at the words' rate one is seen, as long as a word begins after another
MOST: Final = (24, 48, 96)  # seen frames of a segment: 2, 4 and 8 seconds
SHARES: Final = (0.02, 0.1)
METHODS: Final = {"ACA": aca, "HACA": haca}
# Deep Motifs, section 6.2: ten takes of subject 86.
PAPER: Final = {"ACA": 0.903, "HACA": 0.927, "Deep Motifs": 0.929}
# File of a take, method, its constants, and seed.
Unit = tuple[str, str, int, float, int]


def takes() -> list[str]:
    """Files of the takes, as set/clips/file."""
    found = []
    for name in SETS:
        found += sorted({f"{name}/{row['file']}" for row in _rows(name)})
    return found


def _rows(name: str) -> list[dict[str, str]]:
    with (recordings() / name / "segments.csv").open(newline="", encoding="utf-8") as handle:
        return list(csv.DictReader(handle))


@cache
def frames_of(file: str) -> tuple[Float32Array, list[str]]:
    """Features [T, 88] of a take at the words' rate, and the class of each frame; "" where it has none."""
    clip = read_clips(recordings() / file)[0]
    motion = canonicalise(clip, solve(clip), identify(clip.hierarchy.joints, load_rigs()))
    rows = word_features(motion.positions, motion.rotations, motion.fps, WORDS)
    name, _, own = file.partition("/")
    segments = [(int(r["start"]), int(r["stop"]), r["label"]) for r in _rows(name) if r["file"] == own]
    at = np.arange(len(rows)) * motion.fps / WORDS.fps
    return rows, [next((label for start, stop, label in segments if start <= t < stop), "") for t in at]


def matched(groups: Sequence[str] | IntArray, truth: Sequence[str]) -> float:
    """Share of frames that are right where each group is given one class, no two the same, in the best way.

    Args:
        groups: [T] group of each frame.
        truth: [T] class; frames of "" do not count.
    """
    known = np.array([bool(label) for label in truth])
    _, rows = np.unique(np.asarray(groups)[known], return_inverse=True)
    _, columns = np.unique(np.asarray(truth)[known], return_inverse=True)
    counts = np.zeros((rows.max() + 1, columns.max() + 1), dtype=np.int64)
    np.add.at(counts, (rows, columns), 1)
    return float(counts[linear_sum_assignment(counts, maximize=True)].sum() / known.sum())


def measure(unit: Unit) -> dict[str, Found]:
    """The share of one take by one method, on one thread."""
    file, method, most, share, seed = unit
    with threadpool_limits(limits=1):
        rows, truth = frames_of(file)
        k = len(set(truth) - {""})
        if method == "k-means":
            groups = KMeans(k, n_init=10, random_state=seed).fit_predict(rows[::STEP])
        else:
            groups = METHODS[method](rows[::STEP], k, most, share, seed)
    of_frames = np.repeat(groups, STEP)[: len(rows)]
    return {method: {"matched": matched(of_frames, truth), "frames": len(rows), "classes": k}}


def units(seeds: Sequence[int]) -> list[Unit]:
    constants = [(method, *each) for method in METHODS for each in product(MOST, SHARES)]
    return [
        (file, method, most, share, seed)
        for seed in seeds
        for file in takes()
        for method, most, share in [("k-means", 0, 0.0), *constants]
    ]


def chosen_by_others(found: Mapping[Unit, float]) -> dict[str, dict[str, Any]]:
    """{method: {take: its share by the constants that are best on the other takes, these, and those of all}}."""
    runs: dict[str, dict[tuple[int, float], dict[str, list[float]]]] = defaultdict(lambda: defaultdict(dict))
    for (file, method, most, share, _), value in found.items():
        runs[method][most, share].setdefault(Path(file).stem, []).append(value)
    result: dict[str, dict[str, Any]] = {}
    for method, by_constants in runs.items():
        means = {
            constants: {take: float(np.mean(values)) for take, values in of_takes.items()}
            for constants, of_takes in by_constants.items()
        }
        result[method] = {}
        for take in next(iter(means.values())):
            best = max(means, key=lambda c: np.mean([v for t, v in means[c].items() if t != take] or [0.0]))
            every = [of_takes[take] for of_takes in means.values()]
            result[method][take] = {
                "matched": means[best][take],
                "most": best[0],
                "share": best[1],
                "least": min(every),
                "best": max(every),
            }
    return result


def ours(lake: Lake) -> dict[str, float]:
    """The share of each take of a lake that has segments, by the default of `motionlake segment`.

    Where other clips have labels these teach; else the segments of the other takes do.
    """
    found = {}
    with reading(lake) as con:
        corpus = read_corpus(con)
        ranges = segments_of(con, corpus)
        clips = sorted({each.clip for each in ranges})
        method = segment_method(con, lake, corpus)
        by_label = [
            LabelledRange(i, 0, clip.frames, clip.label)
            for i, clip in enumerate(corpus.clips)
            if clip.label is not None and i not in clips
        ]
        teaching = {clip: by_label or [each for each in ranges if each.clip != clip] for clip in clips}
        method.read({*clips, *(each.clip for of_clip in teaching.values() for each in of_clip)})
        for clip in clips:
            labels = method.taught(teaching[clip])(method.of_clip(clip), False).labels
            file = corpus.clips[clip].clip
            _, truth = frames_of(file)
            centres = np.arange(len(labels)) * WORDS.stride + (WORDS.length - 1) / 2
            nearest = np.abs(np.arange(len(truth))[:, None] - centres[None]).argmin(axis=1)
            found[Path(file).stem] = matched(labels[nearest].tolist(), truth)
    return found
