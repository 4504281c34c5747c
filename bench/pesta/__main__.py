"""`python -m bench.pesta [PART ...] [--seeds N] [--processes N] [--keep DIR] [--without TEXT ...] [--all]`, by part:

whole: Table 5 (hdm05, bandai1; --all: salsa and utd_mhad too). ranges: Table 3. sub_queries: Table 4. robustness:
Fig. 8. elasticity: Table 6. ablations: of the dictionaries, the features and the alignment. recipes: k-means and the
autoencoders at three sizes on four sets, and which is the default. threshold: the pretrained dictionary and one of the
lake's own, by the size of lakes. gaps: symbols that strided alignment may leave out, on three sets. draws: Table 4 by
the default dictionary of many seeds, and by variants of it.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from motionlake.pesta.autoencoder import AutoencoderRecipe

from bench.pesta import ablations, draws, elasticity, gaps, ranges, recipes, robustness, sub_queries, threshold, whole
from bench.pesta.dictionaries import OWN
from bench.pesta.measuring import MAIN, with_seeds
from bench.pesta.sets import hash_sets
from bench.record import record
from bench.units import SEEDS, Found, in_processes, table, unit_options

Rows = dict[str, dict[int, Found]]
Recipe = AutoencoderRecipe | None  # of the autoencoder, if not its own
Measured = tuple[dict[str, Any], Sequence[str]]  # figures, and the sets they are of


def _gathered(
    measure: Callable[[Any], dict[str, Found]],
    units: Sequence[Any],
    given: argparse.Namespace,
    order: Callable[[Any], str],
    timed: bool = False,
) -> dict[str, Rows]:
    """{set: {row: {seed: found}}}, rows in the order of the units; what is timed has the machine for itself."""
    chosen = [unit for unit in units if not any(text in str(unit) for text in given.without)]
    done = dict(in_processes(measure, chosen, 1 if timed else given.processes, str, given.kept))
    gathered: dict[str, Rows] = {}
    for unit in chosen:
        for name, found in done[unit].items():
            gathered.setdefault(order(unit), {}).setdefault(name, {})[getattr(unit, "seed", 0)] = found
    return gathered


def measure_whole(given: argparse.Namespace, recipe: Recipe) -> Measured:
    sets = whole.MORE_SETS if given.all else whole.SETS
    runs = _gathered(whole.measure, whole.units(sets, given.chosen, recipe), given, lambda u: u.set_name)
    result = {name: with_seeds(rows) for name, rows in runs.items()}
    for name, rows in result.items():
        print(f"\n{table(name, rows, (*whole.SCORES, 'n', 'symbols'))}")
        _show_classes(name, rows)
    return result, sets


def measure_ranges(given: argparse.Namespace, recipe: Recipe) -> Measured:
    runs = _gathered(ranges.measure, ranges.units(given.chosen, recipe), given, lambda unit: ranges.SET)
    rows = with_seeds(runs[ranges.SET])
    print(f"\n{table(ranges.SET, rows, ('map', 'mean_of_classes', 'p_at_5', 'nn', 'n'))}")
    _show_classes(ranges.SET, rows)
    return rows, [ranges.SET]


def measure_sub_queries(given: argparse.Namespace, recipe: Recipe) -> Measured:
    units = sub_queries.units(given.chosen, recipe)
    rows = with_seeds(
        _gathered(sub_queries.measure, units, given, lambda unit: sub_queries.SET, timed=True)[sub_queries.SET]
    )
    print(f"\n{table(sub_queries.SET, rows, (*sub_queries.SCORES, 'seconds', 'share_of_time', 'points_lost'))}")
    print(sub_queries.verdict(rows))
    return {"rows": rows, "paper": sub_queries.PAPER}, [sub_queries.SET]


def measure_robustness(given: argparse.Namespace, recipe: Recipe) -> Measured:
    units = robustness.units(given.chosen, recipe)
    runs = _gathered(robustness.measure, units, given, lambda unit: robustness.SET)
    rows = with_seeds(runs[robustness.SET])
    curves = robustness.fall(rows)
    print(f"\nMAP by rate, and its share of that at rate 0, {robustness.SET}")
    for method, curve in curves.items():
        cells = "  ".join(f"{value:.3f}" for value in curve["map"])
        kept = "  ".join(f"{value:.3f}" for value in curve["kept"])
        print(f"  {method:40} {cells}   {kept}")
    print(robustness.verdict(curves))
    if given.pictures:
        _draw(given.pictures, rows)
    return {"curves": curves, "rows": rows}, [robustness.SET]


def _draw(folder: Path, rows: Mapping[str, Found]) -> None:
    """Figure 8 of the main rows of the default dictionary."""
    from motionlake.pictures.evaluation import robustness_figure
    from motionlake.pictures.style import png

    by_rate: dict[str, dict[float, list[float]]] = {}
    for name, row in rows.items():
        method, _, rate = name.rpartition(", rate ")
        if method.startswith(f"{MAIN} +") and ", " not in method:
            by_rate.setdefault(method, {})[float(rate)] = [run["map"] for run in row["seeds"].values()]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robustness.png").write_bytes(png(robustness_figure(by_rate, note=f"{robustness.SET}, all seeds")))
    print(folder / "robustness.png")


def measure_elasticity(given: argparse.Namespace, recipe: Recipe) -> Measured:
    units = elasticity.units(given.chosen, recipe)
    rows = with_seeds(
        _gathered(elasticity.measure, units, given, lambda unit: elasticity.SET, timed=True)[elasticity.SET]
    )
    print(f"\n{table(elasticity.SET, rows, elasticity.SCORES)}")
    return rows, [elasticity.SET]


def measure_ablations(given: argparse.Namespace, recipe: Recipe) -> Measured:
    units = ablations.units(ablations.SETS, recipe)
    runs = _gathered(ablations.measure, units, given, lambda unit: unit.set_name)
    result = {name: with_seeds(rows) for name, rows in runs.items()}
    for name, rows in result.items():
        print(f"\n{table(name, rows, ('map', 'p_at_5', 'nn', 'symbols', 'occupied'))}")
    return result, ablations.SETS


def measure_recipes(given: argparse.Namespace, recipe: Recipe) -> Measured:
    runs = _gathered(recipes.measure, recipes.units(given.chosen, recipe), given, lambda unit: unit.set_name)
    result = {name: with_seeds(rows) for name, rows in runs.items()}
    for name, rows in result.items():
        print(f"\n{table(name, rows, recipes.SCORES)}")
    choice = recipes.chosen(result)
    print(f"\nthe default, chosen with one set left out\n{recipes.verdict(choice)}")
    curves = {
        name: {row: run["curve"] for row, by_seed in rows.items() for run in by_seed.values() if "curve" in run}
        for name, rows in runs.items()
    }
    return {"rows": result, "chosen": choice, "curves": curves}, recipes.SETS


def measure_threshold(given: argparse.Namespace, recipe: Recipe) -> Measured:
    units = threshold.units(given.chosen)
    rows = with_seeds(_gathered(threshold.measure, units, given, lambda unit: "lakes")["lakes"])
    print(threshold.verdict(rows))
    return rows, (*threshold.SETS, threshold.TAKES)


def measure_gaps(given: argparse.Namespace, recipe: Recipe) -> Measured:
    runs = _gathered(gaps.measure, gaps.units(given.chosen), given, lambda u: u.set_name)
    result = {name: with_seeds(rows) for name, rows in runs.items()}
    for name, rows in result.items():
        print(f"\n{table(name, rows, ('map', 'p_at_5', 'nn', 'n'))}")
    print(gaps.verdict(result))
    return result, gaps.SETS


def measure_draws(given: argparse.Namespace, recipe: Recipe) -> Measured:
    runs = _gathered(draws.measure, draws.units(given.chosen), given, lambda u: u.set_name)
    result = {name: with_seeds(rows) for name, rows in runs.items()}
    for name, rows in result.items():
        print(f"\n{table(name, rows, draws.SCORES if name == draws.TAKES else ('map', 'p_at_5', 'nn'))}")
    spread = draws.spread(result[draws.TAKES][draws.DEFAULT])
    for score, one in spread.items():
        print(f"  {score:11} {one['mean']:.4f} ± {one['deviation']:.4f}, {one['draws']} draws")
    return {"rows": result, "spread": spread}, draws.SETS


PARTS: Final[dict[str, Callable[[argparse.Namespace, Recipe], Measured]]] = {
    "whole": measure_whole,
    "ranges": measure_ranges,
    "sub_queries": measure_sub_queries,
    "robustness": measure_robustness,
    "elasticity": measure_elasticity,
    "ablations": measure_ablations,
    "recipes": measure_recipes,
    "threshold": measure_threshold,
    "gaps": measure_gaps,
    "draws": measure_draws,
}


def _show_classes(title: str, rows: Mapping[str, Found]) -> None:
    """MAP of each class, as Tables 3 and 5 have it."""
    classes = sorted({label for row in rows.values() for label in row["mean"]["map_by_class"]})
    print(f"\n{title}, MAP by class: {', '.join(f'{i} {label}' for i, label in enumerate(classes, 1))}")
    for name, row in rows.items():
        by_class = row["mean"]["map_by_class"]
        print(f"  {name:36} {'  '.join(f'{by_class[label]:.3f}' for label in classes)}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)} (default: all)")
    unit_options(parser, processes=2)
    parser.add_argument("--hidden", type=int, help="units and steps of the autoencoders: few, to try the bench itself")
    parser.add_argument("--pictures", type=Path, help="robustness: draw figure 8 into this folder")
    parser.add_argument(
        "--without", nargs="+", default=[], metavar="TEXT", help="leave out what has this in its name: information"
    )
    parser.add_argument("--all", action="store_true", help="whole: salsa and utd_mhad as well")
    given = parser.parse_args()
    if unknown := sorted(set(given.parts) - set(PARTS)):
        parser.error(f"no part {', '.join(unknown)}; there are {', '.join(PARTS)}")
    given.chosen = SEEDS[: given.seeds]
    recipe = AutoencoderRecipe(hidden=given.hidden, steps=given.hidden, every=given.hidden) if given.hidden else None
    for part in given.parts or list(PARTS):
        print(f"\n{part}", flush=True)
        given.kept = given.keep and given.keep / part  # units of two parts may be called alike
        figures, sets = PARTS[part](given, recipe)
        settings = {
            "postures": asdict(OWN),
            "recipe": asdict(recipe or AutoencoderRecipe()),
            "seeds": list(given.chosen),
            "without": given.without,
        }
        print(
            record(
                f"pesta-{part.replace('_', '-')}", {**settings, "figures": figures}, hash_sets(sets), kept=given.kept
            )
        )


if __name__ == "__main__":
    main()
