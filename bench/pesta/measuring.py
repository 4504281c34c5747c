"""Scores of strings of whole clips, units of work over processes, and tables of means over seeds."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from typing import Any, Final, TypeVar

import numpy as np
from threadpoolctl import threadpool_limits

from pipeline.alignment.config import AlignmentConfig
from pipeline.alignment.scan import Both, symmetric_costs
from pipeline.alignment.strings import Distances
from pipeline.evaluation.confusion import confusion
from pipeline.evaluation.ranking import (
    others,
    precision_recall,
    precision_recall_classes,
    ranked_relevance,
    relatives,
    score_classes,
    score_rankings,
)
from pipeline.symbols.strings import SymbolString

SEEDS: Final = (0, 1, 2)
Scores = dict[str, float]
# What is measured of one row of a table.
Found = dict[str, Any]
Unit = TypeVar("Unit")

STA3: Final = AlignmentConfig("sta", 3)
STA2: Final = AlignmentConfig("sta", 2)


def whole_scores(
    strings: Sequence[SymbolString],
    distances: Distances,
    labels: Sequence[str],
    config: AlignmentConfig,
    both: Both = "max",
) -> Found:
    """Each clip queries all others: scores of `score_distances`, of the costs of whole strings."""
    return score_distances(symmetric_costs([s.symbols for s in strings], distances, config, both=both), labels)


def score_distances(distances: np.ndarray, labels: Sequence[str]) -> Found:
    """Scores of [n, n] distances, MAP of each class, precision-recall curves and the confusion of the first 20."""
    rankings = ranked_relevance(distances, relatives(labels), others(len(labels)))
    return {
        **asdict(score_rankings(rankings)),
        "map_by_class": {label: scores.map for label, scores in score_classes(rankings, labels).items()},
        "curve": precision_recall(rankings) | {"by_class": precision_recall_classes(rankings, labels)},
        "confusion": confusion(distances, labels, labels, others(len(labels))).as_dict(),
    }


def in_processes(
    measure: Callable[[Unit], dict[str, Found]], units: Sequence[Unit], processes: int, say: Callable[[Unit], str]
) -> Iterator[tuple[Unit, dict[str, Found]]]:
    """(unit, what was found of each of its rows), as they are done; one thread each. A line is printed of each."""
    if processes == 1:
        for done, unit in enumerate(units, 1):
            with threadpool_limits(limits=1):
                found = measure(unit)
            print(f"  {done}/{len(units)} {say(unit)}{_maps(found)}", flush=True)
            yield unit, found
        return
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn"), initializer=_alone) as pool:
        pending = {pool.submit(measure, unit): unit for unit in units}
        for done, future in enumerate(as_completed(pending), 1):
            found = future.result()
            print(f"  {done}/{len(units)} {say(pending[future])}{_maps(found)}", flush=True)
            yield pending[future], found


def _alone() -> None:
    threadpool_limits(limits=1)


def _maps(found: Mapping[str, Found]) -> str:
    key = next((key for key in ("map", "p_at_10") if any(key in row for row in found.values())), None)
    shown = [f"{name} {row[key]:.3f}" for name, row in list(found.items())[:6] if key in row] if key else []
    return ": " + ", ".join(shown) + (" ..." if len(found) > 6 else "") if shown else ""


def mean_of(runs: Sequence[Mapping[str, Any]]) -> Found:
    """Means of the numbers of a row over its seeds; of what is drawn (curves, confusions) the first seed's."""
    first = runs[0]
    return {key: _mean([run[key] for run in runs]) if key not in DRAWN else first[key] for key in first}


DRAWN: Final = ("curve", "confusion")
COUNTS: Final = ("n", "symbols", "occupied")


def _mean(values: Sequence[Any]) -> Any:
    if isinstance(values[0], Mapping):
        return {key: _mean([value[key] for value in values]) for key in values[0]}
    if isinstance(values[0], bool | int | float) and None not in values:
        return float(np.mean(values))
    return values[0]


def with_seeds(rows: Mapping[str, Mapping[int, Found]]) -> dict[str, Found]:
    """{row: {mean, seeds}}, what is kept: of seeds their numbers, what is drawn only of the autoencoder's main rows."""
    kept = {}
    for name, runs in rows.items():
        mean = mean_of([runs[seed] for seed in sorted(runs)])
        left_out = () if name.startswith("AAE") and ", " not in name else DRAWN
        kept[name] = {
            "mean": _rounded({key: value for key, value in mean.items() if key not in left_out}),
            "seeds": {seed: _rounded(_numbers(runs[seed])) for seed in sorted(runs)},
        }
    return kept


def _numbers(found: Found) -> Found:
    return {key: value for key, value in found.items() if not isinstance(value, Mapping | list)}


def _rounded(value: Any, digits: int = 5) -> Any:
    if isinstance(value, Mapping):
        return {key: _rounded(each, digits) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(each, digits) for each in value]
    return round(value, digits) if isinstance(value, float) else value


def table(title: str, rows: Mapping[str, Found], keys: Sequence[str]) -> str:
    """Lines of `with_seeds`: means over the seeds, and the least and the greatest of the first key."""
    width = max(map(len, [title, *rows])) + 2
    title, span = title.ljust(width), {key: max(len(key), 6) + 2 for key in keys}
    lines = [title + "".join(key.rjust(span[key]) for key in keys) + f"   {keys[0]} by seed"]
    for name, row in rows.items():
        cells = "".join(_cell(key, row["mean"].get(key)).rjust(span[key]) for key in keys)
        runs = [run[keys[0]] for run in row["seeds"].values()]
        spread = f"   {min(runs):.3f}-{max(runs):.3f}" if len(runs) > 1 else ""
        lines.append(name.ljust(width) + cells + spread)
    return "\n".join(lines)


def _cell(key: str, value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:.0f}" if key in COUNTS else f"{value:.3f}"
