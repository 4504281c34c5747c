"""`python -m bench.glogen [--first-seed N] [--seeds N] [--processes N] [--epochs N] [--methods NAME ...] [PART ...]`.

sparse: the poses that follow five sparse poses, on utd_mhad (tables 4.1, 4.4). whole: all frames that follow them there
(table 4.2). dense: what follows them in real time, every clip of a CMU set left out once (table 4.3). long: ten seconds
from clips left out as for dense: energy, feet, travel. search: settings of baselines, by what is held out of the data
to train on. between: LocGen beside curves, between true sparse poses of clips left out as for dense. measures: what
each measure says of made motion, of real motion and of controls (every second clip left out), and of the generator of
the package.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from motionlake.evaluation.synthesis.errors import MILLISECONDS

from bench.glogen import between, dense, folds, long, measured, search, sparse, whole
from bench.glogen.sets import SETS
from bench.record import hash_files, record, recordings
from bench.units import SEEDS, Found, in_processes, table, with_seeds


def measure_sparse(given: argparse.Namespace) -> tuple[dict[str, Any], list[str]]:
    return _of_split(sparse, given)


def measure_whole(given: argparse.Namespace) -> tuple[dict[str, Any], list[str]]:
    return _of_split(whole, given)


def _of_split(part: ModuleType, given: argparse.Namespace) -> tuple[dict[str, Any], list[str]]:
    """Scores of the methods of a part that is measured on the split of one set."""
    units = [sparse.Unit(m, s, given.epochs) for m in given.methods or part.METHODS for s in given.chosen]
    runs: dict[str, dict[int, Found]] = {}
    for unit, found in in_processes(part.measure, units, given.processes, str, given.keep):
        for row, values in found.items():
            runs.setdefault(row, {})[unit.seed] = values
    ordered = {name: runs[name] for name in part.METHODS if name in runs}
    result = with_seeds(ordered, bool)
    print(table(sparse.SET, result, sparse.SCORES))
    return {sparse.SET: result}, [sparse.SET]


def measure_dense(given: argparse.Namespace) -> tuple[dict[str, Any], list[str]]:
    units = [
        dense.Unit(name, method, seed, fold, given.epochs, given.generators)
        for name in given.sets or folds.SETS for method in given.methods or dense.METHODS
        for seed in given.chosen for fold in folds.folds_of(name)
    ]  # fmt: skip
    return _of_folds(dense, dense.means, units, given, dense.METHODS, [f"pose_{ms}" for ms in MILLISECONDS])


def measure_long(given: argparse.Namespace) -> tuple[dict[str, Any], list[str]]:
    scores = ["travel_speed", "energy", "usual", "skate_ratio", "penetration", "airborne", "jerk", "bone_length_drift"]
    return _of_folds(long, folds.means, _ours(given), given, long.ROWS, scores)


def measure_between(given: argparse.Namespace) -> tuple[dict[str, Any], list[str]]:
    return _of_folds(between, folds.means, _ours(given), given, between.ROWS, ["joint_error"])


def _ours(given: argparse.Namespace) -> list[folds.Unit]:
    """Every fold of every set with every seed."""
    return [
        folds.Unit(name, seed, fold, given.epochs, given.generators)
        for name in given.sets or folds.SETS for seed in given.chosen for fold in folds.folds_of(name)
    ]  # fmt: skip


def _of_folds(
    part: ModuleType,
    means: Callable[[Sequence[Any]], Found],
    units: Sequence[Any],
    given: argparse.Namespace,
    order: Sequence[str],
    scores: Sequence[str],
) -> tuple[dict[str, Any], list[str]]:
    """Figures by set, row and seed of a part that leaves every clip out once, means over all folds; the folders."""
    kept: dict[str, dict[str, dict[int, list[Any]]]] = {unit.set_name: {} for unit in units}
    for unit, found in in_processes(part.measure, units, given.processes, str, given.keep):
        for row, values in found.items():
            kept[unit.set_name].setdefault(row, {}).setdefault(unit.seed, []).append(values)
    result = {}
    for name, rows in kept.items():
        by_seed = {
            row: {seed: means(each) for seed, each in rows[row].items()} for row in sorted(rows, key=list(order).index)
        }
        result[name] = with_seeds(by_seed, bool)
        print(f"\n{table(name, result[name], scores)}")
    return result, sorted({SETS[name].folder for name in kept})


def measure_measures(given: argparse.Namespace) -> tuple[dict[str, Any], list[str]]:
    """What the measures say of made and of real motion and of controls; and of the generator of the package."""
    units = [folds.Unit(name, seed, 0, given.epochs) for name in given.sets or ["walk"] for seed in given.chosen]
    runs: dict[str, dict[str, dict[int, Found]]] = {unit.set_name: {} for unit in units}
    for unit, found in in_processes(measured.measure, units, given.processes, str, given.keep):
        for row, values in found.items():
            runs[unit.set_name].setdefault(row, {})[unit.seed] = values
    result: dict[str, Any] = {name: with_seeds(rows, bool) for name, rows in runs.items()}
    for name, rows in result.items():
        print(f"\n{table(name, rows, measured.SCORES)}")
    result["pretrained"] = measured.pretrained()
    return result, sorted({SETS[name].folder for name in (*runs, "walk")})


def measure_search(given: argparse.Namespace) -> tuple[dict[str, Any], list[str]]:
    units = search.units(given.sets or list(search.SETS), given.methods or [], given.epochs)
    runs: dict[str, dict[str, dict[int, Found]]] = {unit.set_name: {} for unit in units}
    for unit, found in in_processes(search.measure, units, given.processes, str, given.keep):
        for row, values in found.items():
            runs[unit.set_name].setdefault(row, {})[unit.seed] = values
    result = {name: with_seeds(rows, bool) for name, rows in runs.items()}
    for name, rows in result.items():
        print(f"\n{table(name, rows, ['joint_error'])}")
    return result, sorted({SETS[name].folder for name in runs})


PARTS: Final[dict[str, Callable[[argparse.Namespace], tuple[dict[str, Any], list[str]]]]] = {
    "sparse": measure_sparse,
    "whole": measure_whole,
    "dense": measure_dense,
    "long": measure_long,
    "between": measure_between,
    "search": measure_search,
    "measures": measure_measures,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], default=[])
    parser.add_argument("--methods", nargs="+")
    parser.add_argument("--sets", nargs="+", choices=search.SETS, help="of dense, long, between and search")
    parser.add_argument("--first-seed", type=int, default=SEEDS[0])
    parser.add_argument("--seeds", type=int, default=len(SEEDS), help="how many, from the first one")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--epochs", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="a folder that keeps what is measured, to go on from")
    given = parser.parse_args()
    given.chosen = tuple(range(given.first_seed, given.first_seed + given.seeds))
    kept = given.keep
    given.generators = kept and kept / "generators"
    for part in given.parts or PARTS:
        given.keep = kept and kept / part  # units of different parts may be called alike
        figures, sets = PARTS[part](given)
        files = [path for name in sets for path in (recordings() / name).rglob("*") if path.is_file()]
        print(f"wrote {record(f'glogen-{part}', figures, hash_files(files, recordings()), kept=given.keep)}")


if __name__ == "__main__":
    main()
