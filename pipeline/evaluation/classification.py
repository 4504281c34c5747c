"""How often clips get their class from other clips (Deep Motifs, section 5.3 and table 1).

Also, clips that hold pieces of other motions (PESTA, section 8.4 and Fig. 8).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array, FloatArray, Int64Array
from motionlake.evaluation.ranking import ranked

# Distances [q, n] of clips from n labelled ones, distances [n, n] of these, their labels [n] -> q classes.
Classifier = Callable[[Float64Array, Float64Array, list[str]], list[str]]


def folded_accuracy(distances: Float64Array, labels: Sequence[str], folds: int, classify: Classifier) -> float:
    """Share of clips that get their own class while they, and the others of their part, are left out.

    Each class is dealt evenly over `folds` parts; n parts of n clips leave one out. Clips whose class nobody
    else holds then are left out of the share.

    Args:
        distances: [n, n], row i from clip i.
        labels: [n].
        folds: how many parts.
        classify: a method.

    Raises:
        ValueError: shapes that do not fit, or no clip with another of its class.
    """
    names = np.asarray(labels)
    if distances.shape != (len(names), len(names)):
        raise ValueError(f"distances of shape {distances.shape} do not fit {len(names)} labels")
    part = np.empty(len(names), dtype=np.int64)
    part[np.argsort(names, kind="stable")] = np.arange(len(names)) % folds
    right, total = 0, 0
    for fold in range(folds):
        test, known = np.flatnonzero(part == fold), np.flatnonzero(part != fold)
        test = test[np.isin(names[test], names[known])]
        if len(test):
            found = classify(distances[np.ix_(test, known)], distances[np.ix_(known, known)], names[known].tolist())
            right += int(np.sum(np.asarray(found) == names[test]))
            total += len(test)
    if not total:
        raise ValueError("no clip has another of its class: nothing to learn from")
    return right / total


@dataclass(frozen=True)
class Confusion:
    """counts[a, b]: hits of class b among the first hits of the queries of class a; `classes` by name."""

    classes: tuple[str, ...]
    counts: Int64Array

    def as_dict(self) -> dict[str, object]:
        return {"classes": list(self.classes), "counts": self.counts.tolist()}


def confusion(
    distances: FloatArray, queries: Sequence[str], clips: Sequence[str], candidates: BoolArray, top: int = 20
) -> Confusion:
    """Count the classes of the first hits.

    Args:
        distances: [q, n].
        queries, clips: [q] and [n] classes.
        candidates: [q, n] what a query may find.
        top: how many hits of each query count.

    Raises:
        ValueError: shapes that do not fit.
    """
    classes = sorted({*queries, *clips})
    place = {label: i for i, label in enumerate(classes)}
    counts = np.zeros((len(classes), len(classes)), dtype=np.int64)
    of_clips = np.array([place[label] for label in clips], dtype=np.int64)
    for label, hits in zip(queries, ranked(distances, candidates), strict=True):
        counts[place[label]] += np.bincount(of_clips[hits[:top]], minlength=len(classes))
    return Confusion(tuple(classes), counts)


def adjusted_rand_index(labels: Sequence[str], clusters: Sequence[int]) -> float:
    """1 where clusters are the classes, about 0 for clusters drawn at random (Hubert and Arabie, 1985).

    Args:
        labels: [n] class of each clip.
        clusters: [n] its cluster.
    """
    from sklearn.metrics import adjusted_rand_score

    return float(adjusted_rand_score(labels, clusters))


PIECE: Final = 10  # frames


def singular_pieces(
    lengths: Sequence[int], labels: Sequence[str], rate: float, seed: int, piece: int = PIECE
) -> list[Int64Array]:
    """Which pieces of clips are replaced, and by what.

    A clip is cut into pieces from its first frame on (what is left over at its end stays); the given share of them,
    drawn at random, is replaced by pieces drawn at random from clips of other labels. With one seed, what a rate
    replaces a higher rate replaces alike.

    Args:
        lengths: [n] frames of each clip.
        labels: [n].
        rate: share of the pieces, from 0 to 1.
        seed: of the draw.
        piece: frames of a piece.

    Returns:
        Of each clip [r, 3]: first frame of a replaced piece, clip and first frame that it is replaced by; in order.

    Raises:
        ValueError: a rate that is no share, or a clip for which no clip of another label is long enough.
    """
    if not 0 <= rate <= 1:
        raise ValueError(f"the rate of replaced pieces is {rate}, not from 0 to 1")
    sizes, names = np.asarray(lengths), np.asarray(labels)
    found = []
    for clip, length in enumerate(lengths):
        rng = np.random.default_rng([seed, clip])
        count = length // piece
        sources = np.flatnonzero((names != names[clip]) & (sizes >= piece))
        if count and not len(sources):
            raise ValueError(f"no clip of another label than {labels[clip]!r} has {piece} frames to take a piece of")
        places = rng.permutation(count) * piece
        taken = rng.choice(sources, count) if count else np.zeros(0, dtype=np.int64)
        starts = rng.integers(0, sizes[taken] - piece + 1) if count else taken
        rows = np.column_stack([places, taken, starts])[: round(rate * count)]
        found.append(rows[np.argsort(rows[:, 0])].astype(np.int64))
    return found
