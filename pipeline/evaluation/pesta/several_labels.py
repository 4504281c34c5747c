"""Whole clips that carry several labels (section 8.3.1, Table 3): segments are looked for in whole clips.

A clip carries a label where one of its segments has it; a clip without segments carries none and stays in the
repository. The clip that a query is cut from is not searched. Clips are ranked by the best match of the query in them
("one way", the paper's), and by the worse of that and of the clip in the query.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from motionlake.arrays import FloatArray, Int32Array
from motionlake.evaluation.pesta.measuring import WHOLE_STRIDE, Measuring
from motionlake.evaluation.ranking import by_class, ranked_relevance, score_rankings, share_label
from motionlake.pesta.config import METHODS, AlignmentConfig
from motionlake.pesta.scan import pairwise
from motionlake.pesta.strings import Distances, Repository


def measure_several_labels(measuring: Measuring) -> dict[str, Any]:
    """By method, and by method one way: `RankingScores`, map_by_class and the mean of the classes; n_refused: queries
    that are one symbol, which all_map counts as 0.

    Raises:
        UserError: no class is shown by two clips.
    """
    asked, strings = measuring.asked, measuring.strings
    clips = [clip.clip for clip in measuring.chosen.clips]
    own = [strings.repository.string(strings.positions[clip]) for clip in clips]
    carried = [{label for _, _, label in measuring.segments.get(clip, ())} for clip in clips]
    labels = [each.label for each, _ in asked.queries]
    candidates = np.array([[clip != each.clip for clip in clips] for each, _ in asked.queries])
    relevant = share_label(labels, carried) & candidates
    found: dict[str, Any] = {}
    for both in (False, True):
        for method in METHODS:
            config = measuring.alignment(method, WHOLE_STRIDE)
            costs = ranged_costs(
                [query.symbols for _, query in asked.queries], own, strings.distances, config, both=both
            )
            rankings = ranked_relevance(costs, relevant, candidates)
            scores = score_rankings(rankings)
            maps = {label: score_rankings(hits).map for label, hits in by_class(rankings, labels).items()}
            found[method if both else f"{method}_one_way"] = {
                **asdict(scores),
                "all_map": scores.map * scores.n / (scores.n + asked.refused),
                "n_refused": asked.refused,
                "map_by_class": maps,
                "mean_of_classes": float(np.mean(list(maps.values()))),
            }
    return found


def ranged_costs(
    queries: Sequence[Int32Array],
    strings: Sequence[Int32Array],
    distances: Distances,
    config: AlignmentConfig,
    *,
    both: bool,
) -> FloatArray:
    """[q, n] costs of queries in clips for each symbol; with `both` the greater of those and the clips' in them."""
    costs = pairwise(queries, Repository.of(strings), distances, config)
    costs /= np.array([len(query) for query in queries], dtype=np.float32)[:, None]
    if not both:
        return costs
    back = pairwise(strings, Repository.of(queries), distances, config)
    back /= np.array([len(string) for string in strings], dtype=np.float32)[:, None]
    return np.maximum(costs, back.T)
