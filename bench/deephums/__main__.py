"""`python -m bench.deephums [--seeds N] [--processes N] [--keep DIR] [--epochs N] [--methods NAME ...] [PART ...]`.

retrieval: test clips of utd_mhad and hdm05 query their training clips, by every method, with the rows of robustness.
curves: learning curves with one training subject held out. choices: what the thesis leaves open, by cross-validation
over training subjects. unlabelled: constants without labels, chosen with one set left out in turn. submotion: pieces of
clips and the clips they are from. performances: slow and fast performances as they were recorded, and pieces of clips.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from bench import canonical_sets
from bench.deephums import choices, curves, performances, retrieval, submotion, unlabelled
from bench.deephums.sets import SETS
from bench.record import hash_files, record, recordings
from bench.units import SEEDS, Found, in_processes, table, with_seeds

DRAWN_ROWS: Final = frozenset(retrieval.METHODS)


def measure_retrieval(given: argparse.Namespace) -> dict[str, Any]:
    units = retrieval.units(given.sets, given.methods or retrieval.METHODS, given.chosen, given.epochs)
    runs: dict[str, dict[str, dict[int, Found]]] = {name: {} for name in given.sets}
    for unit, found in in_processes(retrieval.measure, units, given.processes, str, given.kept):
        for row, values in found.items():
            runs[unit.set_name].setdefault(row, {})[unit.seed] = values
    order = {name: i for i, name in enumerate(retrieval.METHODS)}
    result = {}
    for name, rows in runs.items():
        ordered = dict(sorted(rows.items(), key=lambda item: order.get(item[0], len(order))))
        result[name] = with_seeds(ordered, DRAWN_ROWS.__contains__)
        print(f"\n{table(name, result[name], retrieval.SCORES)}")
    return result


def measure_curves(given: argparse.Namespace) -> dict[str, Any]:
    return curves.measure(given.sets[0], given.epochs, given.processes, given.kept)


def measure_choices(given: argparse.Namespace) -> dict[str, Any]:
    return choices.measure(given.epochs, given.processes, given.kept, choices.named(given.rows, given.choices))


def measure_unlabelled(given: argparse.Namespace) -> dict[str, Any]:
    return unlabelled.measure(list(canonical_sets.SETS))


def measure_submotion(given: argparse.Namespace) -> dict[str, Any]:
    return submotion.measure(given.chosen, given.steps, given.epochs, rows=given.rows)


def measure_performances(given: argparse.Namespace) -> dict[str, Any]:
    return performances.measure(performances.SETS, given.chosen)


PARTS: Final[dict[str, Callable[[argparse.Namespace], dict[str, Any]]]] = {
    "retrieval": measure_retrieval,
    "curves": measure_curves,
    "choices": measure_choices,
    "unlabelled": measure_unlabelled,
    "submotion": measure_submotion,
    "performances": measure_performances,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], default=[])
    parser.add_argument("--sets", nargs="+", choices=SETS, default=list(SETS))
    parser.add_argument("--methods", nargs="+", choices=retrieval.METHODS)
    parser.add_argument("--seeds", type=int, default=len(SEEDS))
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="retrieval, curves, choices go on from this folder")
    parser.add_argument("--epochs", type=int, default=0)
    parser.add_argument("--steps", type=int, default=0, help="submotion: of the sub-motion encoder's training")
    parser.add_argument(
        "--rows", nargs="+", choices=submotion.RECIPES, default=[*submotion.RECIPES], help="choices, submotion"
    )
    parser.add_argument(
        "--choices", nargs="+", default=[], choices=[choice.strip() for choice in choices.CHOICES], metavar="CHOICE",
        help="choices: by name (default: all)",
    )  # fmt: skip
    given = parser.parse_args()
    given.chosen = tuple(range(given.seeds))
    for part in given.parts or PARTS:
        given.kept = given.keep and given.keep / part  # units of two parts may be called alike
        figures = PARTS[part](given)
        every = [chosen.folder for chosen in canonical_sets.SETS.values()]
        sets = {"retrieval": given.sets, "unlabelled": every, "performances": [*performances.SETS]}.get(
            part, ["utd_mhad"]
        )
        files = [path for name in sets for path in (recordings() / name).rglob("*") if path.is_file()]
        print(f"wrote {record(f'deephums-{part}', figures, hash_files(files, recordings()), kept=given.kept)}")


if __name__ == "__main__":
    main()
