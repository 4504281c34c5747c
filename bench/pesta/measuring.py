"""Scores of strings of whole clips."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from motionlake.arrays import FloatArray
from motionlake.evaluation.pesta.whole import scores
from motionlake.evaluation.ranking import by_class, others, ranked_relevance, relatives, score_rankings
from motionlake.pesta.config import AlignmentConfig
from motionlake.pesta.nearest import Both, symmetric_costs
from motionlake.pesta.strings import Distances
from motionlake.pesta.symbols import SymbolString

from bench import units
from bench.units import Found

Scores = dict[str, float]

MAIN: Final = "neural gas"  # the default dictionary
STA3: Final = AlignmentConfig("sta", 3)
STA2: Final = AlignmentConfig("sta", 2)
GAPS3: Final = AlignmentConfig("sta", 3, gaps=True)
GAPS2: Final = AlignmentConfig("sta", 2, gaps=True)


def whole_scores(
    strings: Sequence[SymbolString],
    distances: Distances,
    labels: Sequence[str],
    config: AlignmentConfig,
    both: Both = "max",
) -> Found:
    """Each clip queries all others: scores of `score_distances`, of the costs of whole strings."""
    return score_distances(symmetric_costs([s.symbols for s in strings], distances, config, both=both), labels)


def score_distances(distances: FloatArray, labels: Sequence[str]) -> Found:
    """Scores of [n, n] distances as `motionlake evaluate pesta` has them, and MAP of each class."""
    of_classes = by_class(ranked_relevance(distances, relatives(labels), others(len(labels))), labels)
    return scores(distances, labels) | {
        "map_by_class": {label: score_rankings(hits).map for label, hits in of_classes.items()}
    }


def with_seeds(rows: Mapping[str, Mapping[int, Found]]) -> dict[str, Found]:
    """What is kept of seeds; what is drawn only of the main rows of the default dictionary."""
    return units.with_seeds(rows, lambda name: name.startswith(f"{MAIN} +") and ", " not in name)
