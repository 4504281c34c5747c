"""Whole clips found by each method, leave one out: what `python -m bench.comparators retrieval` measures.

Rows of ours and of DTW beside them see the same features. Rows with "labels" are told what the others are not:

- "templates, labels of the found": a clip is as near as the query fits the template of its class, which was learned
  without the query; among clips of one class the one is nearer whose features are
- "templates, class of the query": the class of the query is asked for by its template, as in the paper; no clip is
  compared with a template that was learned from it
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import cache
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.evaluation.ranking import leave_one_out
from motionlake.motion.dtw import dtw_matrix
from threadpoolctl import threadpool_limits

from bench.canonical_sets import LabelledClip, features, load
from bench.comparators import keys, manifold, relational, templates, volumes
from bench.comparators.seen import WORDS, Seen, seen
from bench.representation import learned, score
from bench.units import Found

SCORES: Final = ("nn", "top5", "first_tier", "second_tier", "map", "cross_subject_nn")
# Distances [n, n] of each row, and what else is known of it.
Distances = dict[str, tuple[Float64Array, Found]]


@cache
def clips_of(name: str) -> list[LabelledClip]:
    return load(name)


def by_templates(clips: Sequence[Seen], seed: int) -> Distances:
    """Three rows of one method: two with labels, and the features alone."""
    relations = [relational.relational(clip) for clip in clips]
    labels = [clip.label for clip in clips]
    apart = templates.distances(relations)
    classes, costs = templates.fits(relations, labels)
    own = np.array([classes.index(label) for label in labels])
    near = costs[:, own] + 1e-6 * apart / max(float(apart.max()), 1e-12)
    right = {"classified": float((costs.argmin(axis=1) == own).mean())}
    return {
        "templates, labels of the found": (near, right),
        "templates, class of the query (label)": (costs[:, own].T, {}),
        "relational features, DTW": (apart, {}),
    }


def by_volumes(clips: Sequence[Seen], seed: int) -> Distances:
    return {
        "motion volumes, cross-correlation": (volumes.distances(clips, warped=False), {}),
        "motion volumes, DTW": (volumes.distances(clips, warped=True), {}),
    }


def by_keys(clips: Sequence[Seen], seed: int) -> Distances:
    return {"motion keys": (keys.distances(clips), {})}


def by_manifold(clips: Sequence[Seen], seed: int) -> Distances:
    found, loss = manifold.distances(clips, seed)
    return {"motion manifold": (found, {"loss": loss})}


def by_frames(clips: Sequence[Seen], seed: int) -> Distances:
    return {"whole-clip DTW, equal features": (dtw_matrix([clip.features for clip in clips]), {})}


# What makes the distances, and whether it draws by the seed.
METHODS: Final[dict[str, tuple[Callable[[Sequence[Seen], int], Distances], bool]]] = {
    "frames": (by_frames, False),
    "keys": (by_keys, False),
    "volumes": (by_volumes, False),
    "templates": (by_templates, False),
    "manifold": (by_manifold, True),
    "signatures": (lambda clips, seed: {}, False),
}
# Set, method and seed.
Unit = tuple[str, str, int]


def measure(unit: Unit) -> dict[str, Found]:
    """The measures of each row of one method on one set, on one thread."""
    name, method, seed = unit
    with threadpool_limits(limits=1):
        clips = clips_of(name)
        if method == "signatures":
            return {"signatures (ours)": _signatures(clips, seed)}
        return {row: _scored(*found, clips) for row, found in METHODS[method][0](seen(clips), seed).items()}


def _signatures(clips: list[LabelledClip], seed: int) -> Found:
    """Of the default words, whose network is trained on the clips without their labels."""
    embedded = learned(features(clips, WORDS), WORDS, seed)
    return {key: value for key, value in asdict(score(embedded, clips, seed)).items() if value is not None}


def _scored(distances: Float64Array, known: Found, clips: Sequence[LabelledClip]) -> Found:
    subjects = [clip.subject for clip in clips]
    scores = leave_one_out(distances, [clip.label for clip in clips], subjects if len(set(subjects)) > 1 else None)
    return {**{key: value for key, value in asdict(scores).items() if value is not None}, **known}
