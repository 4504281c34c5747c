"""The pretrained dictionary against one of the lake's own, for lakes of growing size: which size is enough?

Lakes are clips of a set drawn at random until they hold so many postures (`COUNTS`, three draws), or the first takes of
cmu_exercises. Either dictionary codes the same clips: whole clips query all others (`sta`, strided alignment, w = 3,
both ways), and windows of takes, the same frames for both, the other takes (Table 4: P@10, unanswered windows count as
wrong). The pretrained dictionary has seen the takes, and no clip of the other sets.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.evaluation.ranking import others, ranked_relevance, relatives, score_rankings
from motionlake.pesta.config import ENOUGH, PRETRAINED_POSTURES
from motionlake.pesta.dictionary import load_dictionary
from motionlake.pesta.dictionary_fitting import fit_dictionary
from motionlake.pesta.nearest import symmetric_costs

from bench.pesta.dictionaries import OWN, string
from bench.pesta.measuring import STA2, STA3
from bench.pesta.sets import clips_of, labels_of, postures_of
from bench.pesta.windows import score_windows
from bench.units import Found

SETS: Final = ("hdm05", "bandai1", "utd_mhad")
TAKES: Final = "cmu_exercises"
COUNTS: Final = (1_000, 2_000, 4_000, 8_000, 16_000)
DRAWS: Final = (0, 1, 2)


@dataclass(frozen=True)
class Unit:
    """Clips of a set that make a lake; takes are the first of cmu_exercises."""

    set_name: str
    count: int
    seed: int

    def __str__(self) -> str:
        what = "takes" if self.set_name == TAKES else "postures"
        return f"{self.set_name}, {self.count} {what}, draw {self.seed}"


def units(draws: Sequence[int]) -> list[Unit]:
    whole = [Unit(name, count, seed) for name in SETS for count in COUNTS for seed in draws]
    return whole + [Unit(TAKES, takes, 0) for takes in range(2, len(clips_of(TAKES)) + 1)]


def drawn(set_name: str, count: int, seed: int) -> list[int]:
    """Clips of a set, at random, until they hold so many postures; in order."""
    lengths = [len(rows) for rows in postures_of(set_name, OWN.frames)]
    order = np.random.default_rng(seed).permutation(len(lengths))
    enough = int(np.searchsorted(np.cumsum([lengths[i] for i in order]), count)) + 1
    return sorted(order[:enough].tolist())


def measure(unit: Unit) -> dict[str, Found]:
    """One row: either dictionary on the clips of a lake."""
    clips = list(range(unit.count)) if unit.set_name == TAKES else drawn(unit.set_name, unit.count, unit.seed)
    postures = [postures_of(unit.set_name, OWN.frames)[i] for i in clips]
    size = sum(map(len, postures))
    made = {"pretrained": load_dictionary(PRETRAINED_POSTURES.file)}
    if size >= OWN.m:
        made["own"] = fit_dictionary(postures, OWN)
    found: Found = {"postures": size, "clips": len(clips), "a_symbol": size / OWN.m}
    for name, dictionary in made.items():
        codes = [dictionary.encode(rows) for rows in postures]
        found[f"{name}_occupied"] = len(np.unique(np.concatenate(codes)))
        if unit.set_name == TAKES:
            scores = score_windows(unit.set_name, dictionary, codes, STA2)
            found |= {f"{name}_{key}": scores[key] for key in ("p_at_2", "p_at_5", "p_at_10", "n", "unanswered")}
        else:
            chosen = [clips_of(unit.set_name)[i] for i in clips]
            strings = [string(own, clip, OWN.fps).symbols for own, clip in zip(codes, chosen, strict=True)]
            labels = [labels_of(unit.set_name)[i] for i in clips]
            costs = symmetric_costs(strings, dictionary.distances, STA3, both="max")
            relevance = ranked_relevance(costs, relatives(labels), others(len(labels)))
            found[f"{name}_sta"] = score_rankings(relevance).map
    return {f"{unit.set_name} {unit.count}": found}


def verdict(rows: dict[str, Found]) -> str:
    """Of every row both numbers, and which size is the smallest from which on a lake's own is ahead."""
    lines = []
    for name, row in rows.items():
        mean = row["mean"]
        key = "p_at_10" if "pretrained_p_at_10" in mean else "sta"
        own = mean.get(f"own_{key}")
        taken = "own" if mean["a_symbol"] >= ENOUGH else "pretrained"
        shown = "too few postures" if own is None else f"own {own:.3f}"
        lines.append(
            f"  {name}: {mean['a_symbol']:.1f} postures a symbol, pretrained {mean[f'pretrained_{key}']:.3f}, {shown}; "
            f"a lake takes: {taken}"
        )
    return "\n".join(lines)
