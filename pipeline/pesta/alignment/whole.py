"""The clips nearest to a whole one, both ways: it in them, and they in it."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.pesta.alignment.config import AlignmentConfig
from motionlake.pesta.alignment.scan import Both, best_per_clip, pairwise
from motionlake.pesta.alignment.strings import Distances, Repository, query_string
from numpy.typing import ArrayLike

BATCH: Final = 64  # clips that are sought in the query at once


def nearest_strings(
    query: ArrayLike,
    repository: Repository,
    distances: Distances,
    k: int,
    config: AlignmentConfig | None = None,
    *,
    both: Both = "max",
    without: int | None = None,
    threads: int = 1,
) -> list[tuple[int, float]]:
    """(clip, cost) of the k nearest clips, in ascending cost, ties by clip: a row of `symmetric_costs`.

    The costs of the query in the clips are lower bounds of the greater of both ways (half of them those of the mean),
    so clips are sought in the query in that order until no more of them can be among the k nearest.

    Args:
        query: [X] symbols of a whole clip.
        repository, distances, config, both, threads: as in `symmetric_costs`. Empty clips are left out.
        k: how many at most.
        without: a clip to leave out: the query itself.

    Raises:
        ValueError: as in `symmetric_costs`; k below 0.
    """
    if k < 0:
        raise ValueError(f"k is {k}: it is at least 0")
    if both not in ("max", "mean", "query"):
        raise ValueError(f"both is {both!r}, not max, mean or query")
    config, symbols = config or AlignmentConfig(), query_string(query)
    costs = best_per_clip(symbols, repository, distances, config, threads=threads) / np.float32(len(symbols))
    if without is not None:
        costs[without] = np.inf
    order = np.argsort(costs, kind="stable")[: int(np.isfinite(costs).sum())]
    if both == "query":
        return [(int(clip), float(costs[clip])) for clip in order[:k]]
    inside = Repository.of([symbols])
    found: list[tuple[float, int]] = []
    for start in range(0, len(order), BATCH):
        clips = order[start : start + BATCH].tolist()
        bound = float(costs[clips[0]]) * (1.0 if both == "max" else 0.5)
        if len(found) >= k and bound > found[k - 1][0] and not config.local:
            break
        own = [repository.string(clip) for clip in clips]
        back = pairwise(own, inside, distances, config, threads=threads)[:, 0]
        back /= np.array([len(string) for string in own], dtype=np.float32)
        there = costs[clips]
        cost = np.maximum(there, back) if both == "max" else (there + back) / np.float32(2)
        found = sorted([*found, *zip(cost.tolist(), clips, strict=True)])[: max(k, 1)]
    return [(clip, cost) for cost, clip in found[:k]]
