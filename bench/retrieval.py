"""Retrieval through the lake: `python -m bench.retrieval hdm05` and `python -m bench.retrieval cross-rig`.

Clips are ingested and `run all` makes signatures with the default configuration but for the seeds; beside
them stand the same measures for the shallow embedding (principal components of the same words). Means over
3 seeds.

"hdm05": leave-one-out over its clips. "cross-rig": kicks and jogs of hdm05 (ASF/AMC) query bandai1 (BVH)
alone, as `motionlake search --dataset bandai1` does, and with `--mirrored` (hdm05's kicks are left, bandai1's right).
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict
from math import comb
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.deep_motifs.emd import emd_many, emd_matrix
from motionlake.evaluation.ranking import leave_one_out
from motionlake.lake.catalog import reading
from motionlake.lake.layout import Lake
from motionlake.retrieval.protocol import Query, Scope
from motionlake.retrieval.signature import SignatureSearcher

from bench.lakes import SignedClips, learned_signatures, make_lake, run_all, shallow_signatures
from bench.record import record, recordings

SEEDS: Final = (0, 1, 2)
FLOORS: Final = {
    "floor: whole-clip DTW": {
        "nn": 1.0, "top5": 0.996, "first_tier": 0.939, "second_tier": 0.981, "map": 0.967, "cross_subject_nn": 1.0,
    },
    "floor: shallow": {"nn": 0.997, "top5": 0.987, "map": 0.963},
}  # fmt: skip
JOG, KICK = "jogLeftCircle4StepsRstart", "kickLFront1Reps"
LOCOMOTION: Final = frozenset({"walk", "walk-back", "walk-left", "walk-right", "run", "dash"})
Scores = dict[str, float]
# Labels of the clips of bandai1, nearest first, for each query of hdm05.
Rankings = list[list[str]]


def hdm05(folder: Path) -> dict[str, Scores]:
    """Leave-one-out measures of both embeddings, beside the floors."""
    lake = make_lake(folder, [recordings() / "hdm05"])
    runs: dict[str, list[Scores]] = {"motionlake": [], "shallow, same words": []}
    for seed in SEEDS:
        run_all(lake, seed)
        for name, signed in (
            ("motionlake", learned_signatures(lake)),
            ("shallow, same words", shallow_signatures(lake, seed)),
        ):
            scores = leave_one_out(emd_matrix(signed.signatures, signed.ground), signed.labels, signed.subjects)
            runs[name].append({k: v for k, v in asdict(scores).items() if v is not None})
            print(f"seed {seed}, {name}: {_line(runs[name][-1])}", flush=True)
    return {name: _mean(each) for name, each in runs.items()} | FLOORS


def cross_rig(folder: Path) -> dict[str, Scores]:
    """Measures of hdm05's kicks and jogs against bandai1, of both embeddings, beside chance."""
    data = recordings()
    lake = make_lake(folder, [data / "hdm05", data / "bandai1"])
    runs: dict[str, list[Scores]] = {"motionlake": [], "motionlake --mirrored": [], "shallow, same words": []}
    for seed in SEEDS:
        run_all(lake, seed)
        signed = shallow_signatures(lake, seed)
        for name, ranked in (
            ("motionlake", lambda label: _search(lake, label)),
            ("motionlake --mirrored", lambda label: _search(lake, label, mirrored=True)),
            ("shallow, same words", lambda label, signed=signed: _rank(signed, label)),
        ):
            runs[name].append(_cross_rig_scores(ranked))
            print(f"seed {seed}, {name}: {_line(runs[name][-1])}", flush=True)
    return {name: _mean(each) for name, each in runs.items()} | {"chance": _chance(signed)}


def _cross_rig_scores(ranked: Callable[[str], Rankings]) -> Scores:
    kicks, jogs = ranked(KICK), ranked(JOG)
    return {
        "first_kick": _reciprocal_rank(kicks, {"kick"}),
        "first_run": _reciprocal_rank(jogs, {"run"}),
        "first_run_or_dash": _reciprocal_rank(jogs, {"run", "dash"}),
        "locomotion_p5": float(np.mean([[label in LOCOMOTION for label in row[:5]] for row in jogs])),
    }


def _search(lake: Lake, label: str, *, mirrored: bool = False) -> Rankings:
    """As a user searches: every clip of bandai1 for each hdm05 clip of a label."""
    with reading(lake) as con:
        clips = con.execute(
            "SELECT clip FROM clips WHERE dataset = 'hdm05' AND label = $label ORDER BY clip", {"label": label}
        ).fetchall()
    queries = [Query(clip) for (clip,) in clips]
    answers = SignatureSearcher(lake).search(queries, 1000, Scope("bandai1", mirrored=mirrored))
    return [[hit.label or "" for hit in hits] for hits in answers]


def _rank(signed: SignedClips, label: str) -> Rankings:
    datasets, labels = np.array(signed.datasets), np.array(signed.labels)
    there = np.flatnonzero(datasets == "bandai1")
    rankings = []
    for query in np.flatnonzero((datasets == "hdm05") & (labels == label)):
        distances = emd_many(signed.signatures[query], signed.signatures[there], signed.ground)
        rankings.append(labels[there[np.argsort(distances, kind="stable")]].tolist())
    return rankings


def _reciprocal_rank(rankings: Rankings, wanted: Collection[str]) -> float:
    first = [next(rank for rank, label in enumerate(row, start=1) if label in wanted) for row in rankings]
    return float(np.mean(1 / np.array(first)))


def _chance(signed: SignedClips) -> Scores:
    labels = [label for label, dataset in zip(signed.labels, signed.datasets, strict=True) if dataset == "bandai1"]
    n = len(labels)

    def among(wanted: Collection[str]) -> int:
        return sum(label in wanted for label in labels)

    return {
        "first_kick": expected_reciprocal_rank(n, among({"kick"})),
        "first_run": expected_reciprocal_rank(n, among({"run"})),
        "first_run_or_dash": expected_reciprocal_rank(n, among({"run", "dash"})),
        "locomotion_p5": among(LOCOMOTION) / n,
    }


def expected_reciprocal_rank(n: int, relevant: int) -> float:
    """Of the first of `relevant` clips in a random order of `n`."""
    ways = comb(n, relevant)
    return sum(comb(n - rank, relevant - 1) / ways / rank for rank in range(1, n - relevant + 2))


def _mean(runs: Sequence[Scores]) -> Scores:
    return {name: float(np.mean([run[name] for run in runs])) for name in runs[0]}


def _line(scores: Scores) -> str:
    return "  ".join(f"{name} {value:.3f}" for name, value in scores.items() if name != "n")


def main() -> None:
    protocols: dict[str, Callable[[Path], dict[str, Scores]]] = {"hdm05": hdm05, "cross-rig": cross_rig}
    parser = argparse.ArgumentParser(description="Measure retrieval through the lake.")
    parser.add_argument("what", choices=protocols)
    what = parser.parse_args().what
    with tempfile.TemporaryDirectory(prefix="bench-retrieval-") as folder:
        figures = protocols[what](Path(folder))
    print("\nmeans")
    for name, scores in figures.items():
        print(f"  {name:24} {_line(scores)}")
    print(record(f"retrieval-{what}", figures | {"seeds": list(SEEDS)}))


if __name__ == "__main__":
    main()
