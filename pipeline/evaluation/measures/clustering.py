"""How well clusters follow labels."""

from __future__ import annotations

from collections.abc import Sequence


def adjusted_rand_index(labels: Sequence[str], clusters: Sequence[int]) -> float:
    """1 where clusters are the classes, about 0 for clusters drawn at random (Hubert and Arabie, 1985).

    Args:
        labels: [n] class of each clip.
        clusters: [n] its cluster.
    """
    from sklearn.metrics import adjusted_rand_score

    return float(adjusted_rand_score(labels, clusters))
