"""Whole-sequence retrieval by several labels (section 8.3.1, Table 3) on cmu_bvh and its ranges.

A clip carries a label where one of its ranges has it; clips without ranges stay in the repository and carry none.
Queries are ranges: up to 10 of each label, drawn with the seed, whose frames alone are coded and reduced; the clip
itself is left out of the answers. A label that one clip alone carries has no query. Clips are ranked by their best
sub-sequence, for each symbol of the query ("one way", the paper's), and by the worse of that and of the clip in the
query.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from motionlake.evaluation.pesta.measuring import LabelledRange, drawn_ranges
from motionlake.evaluation.pesta.several_labels import ranged_costs
from motionlake.evaluation.ranking import by_class, ranked_relevance, score_rankings, share_label
from motionlake.pesta.autoencoder import AutoencoderRecipe
from motionlake.pesta.config import AlignmentConfig, PosturesConfig
from motionlake.pesta.dictionary import PostureDictionary
from motionlake.pesta.symbols import SymbolString

from bench.canonical_sets import LabelledClip, features
from bench.pesta.dictionaries import Unit, fitted, string, strings_of
from bench.pesta.measuring import STA3
from bench.pesta.sets import clips_of, segments_of
from bench.pesta.whole import DTW, SCORES, SW, specs
from bench.units import Found

SET: Final = "cmu_bvh"
ALIGNMENTS: Final[dict[str, tuple[AlignmentConfig, bool]]] = {
    "STA w = 3, one way": (STA3, False),
    "DTW, one way": (DTW, False),
    "SW, one way": (SW, False),
    "STA w = 3": (STA3, True),
    "DTW": (DTW, True),
    "SW": (SW, True),
}


def units(seeds: Sequence[int], recipe: AutoencoderRecipe | None) -> list[Unit]:
    return [Unit(name, spec.seeded(seed), seed) for name, spec in specs(recipe).items() for seed in seeds]


def cut(made: PostureDictionary, config: PosturesConfig, clip: LabelledClip, start: int, stop: int) -> SymbolString:
    """The string of frames [start, stop) alone."""
    part = replace(clip, positions=clip.positions[start:stop], rotations=clip.rotations[start:stop])
    (postures,) = features([part], config.frames)
    return string(made.encode(postures), part, config.fps)


def measure(unit: Unit) -> dict[str, Found]:
    """Every alignment of one dictionary."""
    made, strings = fitted(SET, unit.spec), strings_of(SET, unit.spec)
    carried = [{label for _, _, label in segments} for segments in segments_of(SET)]
    names = [str(index) for index in range(len(clips_of(SET)))]
    every = [LabelledRange(name, *one) for name, of in zip(names, segments_of(SET), strict=True) for one in of]
    drawn = drawn_ranges(every, seed=unit.seed)
    labels = [each.label for each in drawn]
    clips, config = clips_of(SET), unit.spec.config
    queries = [cut(made, config, clips[int(each.clip)], each.start, each.stop).symbols for each in drawn]
    candidates = np.arange(len(strings)) != np.array([int(each.clip) for each in drawn])[:, None]
    relevant = share_label(labels, carried) & candidates
    rows = {}
    for name, (alignment, both) in ALIGNMENTS.items():
        costs = ranged_costs(queries, [s.symbols for s in strings], made.distances, alignment, both=both)
        rankings = ranked_relevance(costs, relevant, candidates)
        scores = score_rankings(rankings)
        maps = {label: score_rankings(hits).map for label, hits in by_class(rankings, labels).items()}
        rows[f"{unit.dictionary} + {name}"] = {
            **{key: getattr(scores, key) for key in (*SCORES, "n")},
            "map_by_class": maps,
            "mean_of_classes": float(np.mean(list(maps.values()))),
        }
    return rows
