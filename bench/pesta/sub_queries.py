"""Sub-queries of long queries (section 8.3.3, Table 4) on cmu_exercises, and what PESTA-LQ saves and loses.

Dictionaries are trained on the takes themselves without labels, but for the pretrained one, which has seen them too.
Means over the sub-queries whose exercise another take shows too; `all_...` counts the others as well, as wrong. A
window of 12 symbols lasts longer the fewer symbols a dictionary has for a take: "same windows" rows ask for the same
frames of every dictionary (`bench.pesta.windows`). Times are medians of every sub-query of every take, interleaved.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Final

from motionlake.evaluation.pesta.measuring import Take
from motionlake.evaluation.pesta.sub_queries import (
    LongQuestion,
    SearchOf,
    ask_all,
    fresh_search,
    long_questions,
    score_sub_queries,
    shared_search,
)
from motionlake.pesta.autoencoder import AutoencoderRecipe
from motionlake.pesta.config import AlignmentConfig
from motionlake.pesta.strings import Distances

from bench.pesta.dictionaries import Unit, codes_of, fitted, pretrained, strings_of
from bench.pesta.measuring import MAIN, STA2
from bench.pesta.sets import segments_of
from bench.pesta.whole import READY, specs
from bench.pesta.windows import SAME, score_windows
from bench.record import interleave
from bench.units import Found

SET: Final = "cmu_exercises"
SCORES: Final = ("p_at_2", "p_at_5", "p_at_10", "all_p_at_2", "all_p_at_5", "all_p_at_10", "n", "all_n", "symbols")
PAPER: Final = {"p_at_2": 0.913, "p_at_5": 0.824, "p_at_10": 0.716, "time": 0.52, "points": 5.0}
METHODS: Final = {
    "PESTA": (fresh_search, STA2),
    "PESTA-LQ": (shared_search, STA2),
    "PESTA, w = 1": (fresh_search, AlignmentConfig("sta", 1)),
    "PESTA, w = 3": (fresh_search, AlignmentConfig("sta", 3)),
    "DTW": (fresh_search, AlignmentConfig("dtw")),
    "SW": (fresh_search, AlignmentConfig("sw")),
}


def units(seeds: Sequence[int], recipe: AutoencoderRecipe | None) -> list[Unit]:
    made = [Unit(name, spec.seeded(seed), seed) for name, spec in specs(recipe).items() for seed in seeds]
    ready = pretrained()
    return made + ([Unit(READY, ready, 0)] if ready else [])


def measure(unit: Unit) -> dict[str, Found]:
    """Every method with one dictionary; of PESTA-LQ the share of PESTA's time and the points of P@10 it loses."""
    made, strings = fitted(SET, unit.spec), strings_of(SET, unit.spec)
    takes = [Take(s, segments) for s, segments in zip(strings, segments_of(SET), strict=True)]
    questions = long_questions(takes)
    rows: dict[str, Found] = {}
    for name, (search, config) in METHODS.items():
        rows[f"{unit.dictionary} + {name}"] = score_sub_queries(questions, made.distances, config, search) | {
            "symbols": sum(len(take.string) for take in takes)
        }
    rows[f"{unit.dictionary} + PESTA, {SAME}"] = score_windows(SET, made, codes_of(SET, unit.spec), STA2)
    fresh, shared = (rows[f"{unit.dictionary} + {name}"] for name in ("PESTA", "PESTA-LQ"))
    seconds = interleave(
        {name: partial(_ask, questions, made.distances, METHODS[name]) for name in ("PESTA", "PESTA-LQ")}
    )
    fresh["seconds"], shared["seconds"] = seconds["PESTA"], seconds["PESTA-LQ"]
    shared["share_of_time"] = seconds["PESTA-LQ"] / seconds["PESTA"]
    shared["points_lost"] = 100 * (fresh["p_at_10"] - shared["p_at_10"])
    return rows


def _ask(questions: Sequence[LongQuestion], distances: Distances, method: tuple[SearchOf, AlignmentConfig]) -> None:
    """What is timed: the answers are forgotten."""
    for _ in ask_all(questions, distances, method[1], method[0]):
        pass


def verdict(rows: dict[str, Found]) -> str:
    """The bars, for the default dictionary."""
    fresh, shared = rows[f"{MAIN} + PESTA"]["mean"], rows[f"{MAIN} + PESTA-LQ"]["mean"]
    lines = [
        f"P@{n} {fresh[f'p_at_{n}']:.3f} (paper {PAPER[f'p_at_{n}']}): "
        + ("met" if fresh[f"p_at_{n}"] > PAPER[f"p_at_{n}"] else "MISSED")
        for n in (2, 5, 10)
    ]
    time, points = shared["share_of_time"], shared["points_lost"]
    lines.append(f"PESTA-LQ takes {time:.0%} of PESTA's time (at most 52 %): {_met(time <= PAPER['time'])}")
    lines.append(f"PESTA-LQ loses {points:.1f} points of P@10 (at most 5): {_met(points <= PAPER['points'])}")
    return "\n".join(f"  {line}" for line in lines)


def _met(is_met: bool) -> str:
    return "met" if is_met else "MISSED"
