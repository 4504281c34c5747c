"""What several methods make of one query, and all of them together along the graph of what is near to each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Generic, TypeVar

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.diffusion import diffused_again

TOGETHER_MOST: Final = 400  # clips that are nearest by all methods, among which the way of all methods goes
_ITSELF: Final = 1 - 1e-9  # how near a clip is that is the query
Clip = TypeVar("Clip")


@dataclass(frozen=True)
class View(Generic[Clip]):
    """What one method makes of one query.

    Attributes:
        clips: the m nearest, nearest first.
        distances: [m] theirs.
        near: [m] how near each is by that alone, from 0 to 1.
        ways: [m + 1, m + 1] how near they and the query, the last, are to one another along the graph; None without it.
    """

    clips: Sequence[Clip]
    distances: Float64Array
    near: Float64Array
    ways: Float64Array | None


def near_again(views: Mapping[str, View[Clip]], weights: Mapping[str, float], clips: int) -> dict[Clip, float]:
    """How near clips are along the graph of what is near by all methods together; empty without graphs.

    Args:
        views: by method.
        weights: how much each counts.
        clips: that the lake holds.
    """
    joined = {name: view for name, view in views.items() if view.ways is not None and len(view.clips)}
    if not joined:
        return {}
    known = list(dict.fromkeys(clip for view in joined.values() for clip in view.clips))
    place = {clip: at for at, clip in enumerate(known)}
    total = sum(weights[name] for name in joined)
    near = np.zeros((len(known) + 1, len(known) + 1))
    for name, view in joined.items():
        assert view.ways is not None
        rows = np.array([*(place[clip] for clip in view.clips), len(known)])
        near[np.ix_(rows, rows)] += weights[name] / total * view.ways
    best = np.sort(np.argsort(-near[-1, :-1], kind="stable")[:TOGETHER_MOST])
    rows = np.append(best, len(known))
    found = diffused_again(near[np.ix_(rows, rows)], clips)[-1, :-1]
    found[near[-1, best] > _ITSELF] = 1.0
    return {known[at]: float(way) for at, way in zip(best.tolist(), found, strict=True)}
