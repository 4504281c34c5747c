"""Retrieval, classification and clustering by signatures: `python -m bench.signatures [--k K] [SET ...]`.

Each labelled set is a lake of its own. Each figure stands twice: with the pretrained weights (for cmu_dance: the same
training without cmu_dance), and with weights trained on the lake's own clips without labels. Leave one out over whole
clips, as `motionlake evaluate signatures` measures it, whole-clip DTW beside it; clusters are MDS and k-means with as
many clusters as classes, of EMD and of DTW distances. Means over 3 seeds of training and k-means.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.deep_motifs.classification import cluster_clips
from motionlake.deep_motifs.emd import emd_matrix
from motionlake.evaluation.clips import LabelledOptions
from motionlake.evaluation.dtw import dtw_baseline
from motionlake.evaluation.signatures import evaluate_signatures
from motionlake.lake.catalog import reading
from motionlake.lake.layout import Lake
from motionlake.retrieval.labelled_clips import lake_ground, signed_clips
from sklearn.metrics import adjusted_rand_score

from bench.lakes import make_lake, run_all
from bench.pretrained_words import pretrained_for
from bench.record import hash_files, record, recordings

SEEDS: Final = (0, 1, 2)
MEASURES: Final = ("nn", "top5", "first_tier", "second_tier", "map", "cross_subject_nn")


@dataclass(frozen=True)
class Labelled:
    """A set, the column of its labels file that says the class, and which of its clips have one."""

    folder: str
    column: str = "label"
    only: tuple[str, str] | None = None
    floors: Mapping[str, float] | None = None


LABELLED: Final = {
    "hdm05": Labelled("hdm05", floors={"shallow": 0.963, "dtw": 0.967}),
    "salsa": Labelled("cmu_dance", "subject", ("label", "salsa"), {"shallow": 0.947, "dtw": 0.885}),
    "bandai1": Labelled("bandai1", floors={"shallow": 0.377, "dtw": 0.441}),
    "utd_mhad": Labelled("utd_mhad", floors={"shallow": 0.724, "dtw": 0.664}),
}


def measure(lake: Lake, chosen: Labelled, seed: int, *, dtw: bool) -> dict[str, dict[str, float]]:
    """Measures of the lake's signatures, and of DTW where asked for."""
    with reading(lake) as con:
        found = evaluate_signatures(con, lake, LabelledOptions(column=chosen.column, only=chosen.only, dtw=dtw))
        signed = signed_clips(con, column=chosen.column, only=chosen.only).labelled()
        distances = {"signatures": emd_matrix(signed.signatures, lake_ground(con))}
        by_frames = dtw_baseline(lake, signed.clips, dtw, print)
        if by_frames is not None:
            distances["dtw"] = by_frames
    rows = {"signatures": found} | ({"dtw": found["dtw"]} if dtw else {})
    return {
        name: {
            **{key: float(row[key]) for key in MEASURES if row[key] is not None},
            "one_vs_all": float(row["classification"]["accuracy"]),
            "rand_index": _rand_index(signed.labels, distances[name], SEEDS if name == "dtw" else (seed,)),
        }
        for name, row in rows.items()
    }


def _rand_index(labels: list[str], distances: Float64Array, seeds: Sequence[int]) -> float:
    """Mean over seeds of k-means (DTW has no other)."""
    found = [cluster_clips(distances, len(set(labels)), seed=seed).clusters.tolist() for seed in seeds]
    return float(np.mean([adjusted_rand_score(labels, clusters) for clusters in found]))


def measure_set(name: str, k: int, folder: Path) -> dict[str, dict[str, float]]:
    """Means over the seeds, with pretrained and with own weights, and DTW."""
    chosen = LABELLED[name]
    lake = make_lake(folder / name, [recordings() / chosen.folder])
    ready = pretrained_for(chosen.folder, folder)
    runs: dict[str, list[dict[str, float]]] = {"pretrained": [], "own": [], "whole-clip DTW": []}
    for seed in SEEDS:
        for origin, weights in (("pretrained", ready), ("own", None)):
            run_all(lake, seed, weights, k)
            found = measure(lake, chosen, seed, dtw=origin == "own" and seed == SEEDS[0])
            runs[origin].append(found["signatures"])
            print(f"  {name}, seed {seed}, {origin}: {_line(found['signatures'])}", flush=True)
            if "dtw" in found:
                runs["whole-clip DTW"].append(found["dtw"])
    means = {
        origin: {key: float(np.mean([row[key] for row in rows])) for key in rows[0]} for origin, rows in runs.items()
    }
    return means | {"floors": dict(chosen.floors or {})}


def _line(row: Mapping[str, float]) -> str:
    return "  ".join(f"{key} {value:.3f}" for key, value in row.items())


def main() -> None:
    parser = argparse.ArgumentParser(description="Measure retrieval, classification and clustering by signatures.")
    parser.add_argument("sets", nargs="*", default=list(LABELLED))
    parser.add_argument("--k", type=int, default=100, help="number of motifs")
    given = parser.parse_args()
    figures: dict[str, Any] = {}
    paths = []
    with tempfile.TemporaryDirectory(prefix="bench-signatures-") as folder:
        for name in given.sets:
            figures[name] = measure_set(name, given.k, Path(folder))
            paths += [p for p in (recordings() / LABELLED[name].folder).rglob("*") if p.is_file()]
    print("\nmeans")
    for name, rows in figures.items():
        for origin, row in rows.items():
            print(f"  {name:10} {origin:16} {_line(row)}")
    result = {"sets": figures, "k": given.k, "seeds": list(SEEDS)}
    print(record(f"signatures-k{given.k}", result, hash_files(paths, recordings())))


if __name__ == "__main__":
    main()
