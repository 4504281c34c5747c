"""Elasticity (section 8.5.1, Table 6): whole clips by strings over dictionaries of several sizes.

Each dictionary is of the lake's kind and seed, and is fitted without labels to the postures of all clips of the lake.
The lake's own dictionary and its strings stay as they are.
"""

from __future__ import annotations

import statistics
import time
from dataclasses import replace
from typing import Any, Final

from motionlake.errors import UserError
from motionlake.evaluation.pesta.framed import coded, read_framed
from motionlake.evaluation.pesta.measuring import WHOLE_STRIDE, Measuring
from motionlake.evaluation.ranking import others, ranked_relevance, relatives, score_rankings
from motionlake.lake.settings import served_config
from motionlake.pesta.config import ENOUGH, AlignmentConfig
from motionlake.pesta.dictionary_fitting import fit_dictionary
from motionlake.pesta.nearest import nearest_strings, symmetric_costs
from motionlake.pesta.strings import Repository, SymbolDistances
from motionlake.stages.model_kind import Selection
from motionlake.stages.posture_dictionary import POSTURE_DICTIONARY
from motionlake.stages.reader import LakeReader

SIZES: Final = (50, 100, 200, 300, 400, 500, 600, 700, 800)
FIRST: Final = 20  # answers to a query whose time is taken
ROUNDS: Final = 3


def measure_sizes(measuring: Measuring) -> dict[str, Any] | None:
    """By m: map, p_at_5, nn and n of "sta", both ways; symbols, of all strings together; milliseconds a query for the
    first `FIRST` answers, on one thread; occupied, the symbols in use. None where no two clips share a label.

    Raises:
        UserError: the lake has fewer than `ENOUGH` postures for each symbol of the least dictionary.
    """
    chosen, lake = measuring.chosen.labelled(), measuring.lake
    labels, settings = chosen.labels, served_config(lake)
    if len(set(labels)) == len(labels):
        return None
    postures = POSTURE_DICTIONARY.data(LakeReader(measuring.con, lake, settings), Selection()) or []
    held = sum(map(len, postures))
    sizes = [m for m in SIZES if ENOUGH * m <= held]
    if not sizes:
        raise UserError(f"the lake holds {held} postures: {ENOUGH * SIZES[0]} are needed for {SIZES[0]} symbols")
    if left_out := SIZES[len(sizes) :]:
        measuring.options.notice(f"m = {', '.join(map(str, left_out))}: left out, as the lake holds {held} postures")
    clips, coding = read_framed(lake, chosen.clips), settings.postures
    features = [clip.postures(coding.frames) for clip in clips]
    config, found = measuring.alignment("sta", WHOLE_STRIDE), {}
    for done, m in enumerate(sizes):
        measuring.progress("sizes", done, len(sizes))
        made = fit_dictionary(postures, replace(coding, m=m))
        strings = Repository.of(coded(made, clips, features, settings.symbols))
        ground = SymbolDistances.of(made.distances)
        costs = symmetric_costs(strings, ground, config)
        scores = score_rankings(ranked_relevance(costs, relatives(labels), others(len(labels))))
        found[str(m)] = {
            "map": scores.map, "p_at_5": scores.p_at_5, "nn": scores.nn, "n": scores.n, "symbols": len(strings.symbols),
            "milliseconds": query_milliseconds(strings, ground, config), "occupied": made.metrics["occupied"],
        }  # fmt: skip
    measuring.progress("sizes", len(sizes), len(sizes))
    return found


def query_milliseconds(
    strings: Repository, distances: SymbolDistances, config: AlignmentConfig, rounds: int = ROUNDS
) -> float:
    """How long a whole clip as a query takes to be answered by `FIRST` others, on one thread: the median of some rounds
    in which each clip asks, after one that does not count."""
    seconds = []
    for _ in range(1 + rounds):
        start = time.perf_counter()
        for clip in range(len(strings)):
            nearest_strings(strings.string(clip), strings, distances, FIRST, config, without=clip)
        seconds.append(time.perf_counter() - start)
    return 1e3 * statistics.median(seconds[1:]) / len(strings)
