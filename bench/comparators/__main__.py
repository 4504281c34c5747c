"""Comparators beside ours: `python -m bench.comparators [--seeds N] [--processes N] [--keep FOLDER] [PART ...]`.

retrieval: whole clips of four sets, leave one out (`bench.comparators.retrieval`). segmentation: takes of exercises
and 86_01 by ACA and HACA (`bench.comparators.segmentation`). Methods that draw have `--seeds` seeds, others one. A
folder to keep lets a run that was interrupted go on.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.deep_motifs.config import PRETRAINED_WORDS

from bench.canonical_sets import SETS
from bench.comparators import retrieval, segmentation
from bench.lakes import make_lake, run_all
from bench.record import hash_files, record, recordings
from bench.segmentation import teaching_clips
from bench.units import SEEDS, Found, in_processes, table, unit_options, with_seeds

PARTS: Final = ("retrieval", "segmentation")


def measure_retrieval(given: argparse.Namespace) -> dict[str, Any]:
    """{set: {row: its measures}}."""
    seeds = SEEDS[: given.seeds]
    units = [
        (name, method, seed)
        for name in given.sets
        for method in given.methods
        for seed in (seeds if retrieval.METHODS[method][1] else seeds[:1])
    ]
    runs: dict[str, dict[str, dict[int, Found]]] = {name: {} for name in given.sets}
    done = dict(in_processes(retrieval.measure, units, given.processes, str, given.keep))
    for unit in units:
        for row, found in done[unit].items():
            runs[unit[0]].setdefault(row, {})[unit[2]] = found
    result = {name: with_seeds(rows, lambda row: False) for name, rows in runs.items()}
    for name, rows in result.items():
        print(f"\n{table(name, rows, retrieval.SCORES)}")
    return result


def measure_segmentation(given: argparse.Namespace) -> dict[str, Any]:
    """{method: {take: share}}, the papers' figures beside them."""
    units = segmentation.units(SEEDS[: given.seeds])
    found = dict(in_processes(segmentation.measure, units, given.processes, str, given.keep))
    shares = {unit: next(iter(rows.values()))["matched"] for unit, rows in found.items()}
    result = segmentation.chosen_by_others(shares)
    with tempfile.TemporaryDirectory(prefix="bench-comparators-") as folder:
        sources = ([recordings() / "cmu_86", teaching_clips(Path(folder))], [recordings() / "cmu_exercises"])
        ours: dict[str, float] = {}
        for source in sources:
            lake = make_lake(Path(folder) / source[0].name, source)
            run_all(lake, SEEDS[0], PRETRAINED_WORDS.file)
            ours |= segmentation.ours(lake)
    result["ours (taught)"] = {take: {"matched": share} for take, share in ours.items()}
    for method, of_takes in result.items():
        cells = "  ".join(f"{take} {each['matched']:.3f}" for take, each in sorted(of_takes.items()))
        mean = np.mean([each["matched"] for each in of_takes.values()])
        print(f"{method:15} mean {mean:.3f}  {cells}")
    return {"takes": result, "paper": segmentation.PAPER}


def main() -> None:
    parser = argparse.ArgumentParser(description="Methods that Deep Motifs compares itself with, beside ours.")
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}")
    parser.add_argument("--sets", nargs="+", default=list(SETS), choices=SETS, help="of retrieval")
    parser.add_argument("--methods", nargs="+", default=list(retrieval.METHODS), choices=retrieval.METHODS)
    unit_options(parser)
    given = parser.parse_args()
    if unknown := set(given.parts) - set(PARTS):
        parser.error(f"{', '.join(sorted(unknown))}: no such part")
    measures = {"retrieval": measure_retrieval, "segmentation": measure_segmentation}
    folders = {"retrieval": [SETS[name].folder for name in given.sets], "segmentation": list(segmentation.SETS)}
    for part in given.parts or PARTS:
        paths = [p for name in folders[part] for p in (recordings() / name).rglob("*") if p.is_file()]
        figures = {"figures": measures[part](given), "seeds": list(SEEDS[: given.seeds])}
        print(record(f"comparators-{part}", figures, hash_files(paths, recordings()), kept=given.keep))


if __name__ == "__main__":
    main()
