"""Clusters and classes of whole clips without and with labels: `python -m bench.sorting [SET ...] [--seeds N ...]`.

Every set becomes a lake with the default configuration and a seed of its motifs. Adjusted Rand index against the
labels, with as many clusters as there are labels and with the number that is found: `motionlake cluster` by default,
each of its methods alone, and dynamic time warping, once of the joints at 12 frames a second that moves see ("dtw,
equal features") and once of the joints at 24 ("dtw"), all grouped alike; then the paper's grouping (scaling and
k-means). Share of clips that `motionlake classify` gives their label, each left out in turn, and by split.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.deep_motifs.classification import cluster_clips
from motionlake.evaluation.dtw import dtw_baseline
from motionlake.jobs.run import run
from motionlake.jobs.session import session
from motionlake.lake.catalog import Connection, reading
from motionlake.lake.layout import Lake
from motionlake.motion.dtw import dtw_matrix
from motionlake.retrieval.classes import LakeClassifier, Method
from motionlake.retrieval.clusters import fused, group, pair_distances
from motionlake.retrieval.labelled_clips import SignedClips, signed_clips
from motionlake.retrieval.protocol import ClipFilter, Query
from motionlake.stages.moves import read_tracks
from motionlake.stages.registry import ALL
from sklearn.metrics import adjusted_rand_score

from bench.canonical_sets import SETS
from bench.lakes import make_lake
from bench.record import hash_files, record, recordings

SEEDS: Final = (0, 1, 2)
STAGES: Final = tuple(stage for stage in ALL if stage not in ("descriptors", "submotions"))
DTW: Final = ("dtw, equal features", "dtw")
CLASSIFIERS: Final[tuple[Method, ...]] = ("search", "knn")
Figures = dict[str, float]


def measured(folder: Path, name: str, seed: int) -> Figures:
    """Every figure of a set."""
    chosen = SETS[name]
    lake = make_lake(folder, [recordings() / chosen.folder])
    lake.config_file.write_text(f"[motifs]\nseed = {seed}\n", encoding="utf-8")
    with session(lake, "bench", lambda stage, done, total: None, lambda line: None) as job:
        run(job, STAGES)
    only = ("label", "salsa") if name == "salsa" else None
    with reading(lake) as con:
        signed = signed_clips(con, column=chosen.label, only=only).labelled()
        distances = dict(_distances(con, lake, signed))
    found = dict(_clusters(signed.labels, distances, seed))
    if only is None:
        found |= dict(_classes(lake, signed))
    return found


def _distances(con: Connection, lake: Lake, signed: SignedClips) -> Iterator[tuple[str, Float64Array]]:
    yield from pair_distances(con, lake, signed).items()
    tracks = read_tracks(lake, {clip.clip: clip.part for clip in signed.clips})
    yield DTW[0], dtw_matrix([tracks[clip.clip].turned().joints.astype(np.float32) for clip in signed.clips])
    by_frames = dtw_baseline(lake, signed.clips, True, print)
    assert by_frames is not None
    yield DTW[1], by_frames


def _clusters(labels: Sequence[str], distances: Mapping[str, Float64Array], seed: int) -> Iterator[tuple[str, float]]:
    """Adjusted Rand indices."""
    count = len(set(labels))
    ours = {name: each for name, each in distances.items() if name not in DTW}
    for name, chosen in {"default": ours, **{name: {name: each} for name, each in distances.items()}}.items():
        apart, way = fused(chosen)
        for k, text in ((count, ""), (None, ", number found")):
            clusters, _ = group(apart, way, k)
            yield f"{name}{text}", adjusted_rand_score(labels, clusters.tolist())
    for name in ("signature", *DTW):
        clusters = cluster_clips(distances[name], count, seed=seed).clusters
        yield f"{name}, scaling and k-means", adjusted_rand_score(labels, clusters.tolist())


def _classes(lake: Lake, signed: SignedClips) -> Iterator[tuple[str, float]]:
    """Shares of clips that get their label."""
    with reading(lake) as con:
        splits = dict(con.execute("SELECT clip, split FROM clips").fetchall())
    parts = [("leave one out", signed.clips, ClipFilter(recorded_only=True))]
    if tested := [clip for clip in signed.clips if splits[clip.clip] == "test"]:
        parts.append(("by split", tested, ClipFilter(split="train", recorded_only=True)))
    for method in CLASSIFIERS:
        for protocol, clips, scope in parts:
            found = LakeClassifier(lake, method=method, scope=scope).classify([Query(clip.clip) for clip in clips])
            right = [each.label == clip.label for each, clip in zip(found, clips, strict=True)]
            yield f"classify {method}, {protocol}", float(np.mean(right))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sets", nargs="*", default=list(SETS), help="which to measure (default: all)")
    parser.add_argument("--seeds", nargs="+", type=int, default=list(SEEDS))
    asked = parser.parse_args()
    means: dict[str, Figures] = {}
    with tempfile.TemporaryDirectory(prefix="bench-sorting-") as folder:
        for name in asked.sets:
            runs = [measured(Path(folder) / f"{name}-{seed}", name, seed) for seed in asked.seeds]
            means[name] = {key: float(np.mean([each[key] for each in runs])) for key in runs[0]}
            print(f"{name}: means of seeds {', '.join(map(str, asked.seeds))}")
            for key, value in means[name].items():
                print(f"  {key:45} {value:.3f}", flush=True)
    folders = [recordings() / SETS[name].folder for name in asked.sets]
    files = [path for each in folders for path in each.rglob("*") if path.is_file()]
    print(record("sorting", {"sets": means, "seeds": asked.seeds}, hash_files(files, recordings())))


if __name__ == "__main__":
    main()
