"""Whether made motions are like real ones: Frechet distance, and the classes they are taken for (section 4.3.3)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any

import numpy as np
from motionlake.arrays import Float64Array, FloatArray
from motionlake.evaluation.synthesis.trials import SeededClip, Trial
from numpy.typing import NDArray
from scipy.linalg import cholesky, qr, solve_triangular
from scipy.spatial.distance import cdist

# [n, d] descriptors of n motions, each positions [F, 21, 3] and frames a second.
Describe = Callable[[Sequence[tuple[Float64Array, float]]], FloatArray]


def frechet_distance(real: FloatArray, made: FloatArray) -> float:
    """Frechet distance of two sets of vectors, each taken for a normal distribution (FID in their space).

    |mean difference|^2 + tr S + tr T - 2 tr (S T)^(1/2) with the sample covariances S and T (divisor n - 1), as they
    are: no shrinkage, nothing added to the diagonal. tr (S T)^(1/2) is the sum of the singular values of A' B where
    S = A A' and T = B B', so it is exact where n or m is below d and the covariances are singular. Sets that small
    measure too far apart; compare only scores over as many vectors, and with the score of real against real.

    Args:
        real: [n, d].
        made: [m, d].

    Raises:
        ValueError: fewer than two vectors in a set, or of different lengths.
    """
    if real.ndim != 2 or made.ndim != 2 or real.shape[1] != made.shape[1] or min(len(real), len(made)) < 2:
        raise ValueError(f"sets of shapes {real.shape} and {made.shape} have no Frechet distance")
    a, b = _factor(real), _factor(made)
    apart = np.square(real.astype(np.float64).mean(axis=0) - made.astype(np.float64).mean(axis=0)).sum()
    common = np.linalg.svd(a @ b.T, compute_uv=False).sum()
    return max(0.0, float(apart + np.square(a).sum() + np.square(b).sum() - 2 * common))


def _factor(vectors: FloatArray) -> Float64Array:
    """[min(n, d), d] R with R' R the covariance of vectors [n, d]."""
    centred = vectors.astype(np.float64)
    centred = (centred - centred.mean(axis=0)) / np.sqrt(len(vectors) - 1)
    return np.asarray(qr(centred, mode="r", check_finite=True)[0][: min(centred.shape)], dtype=np.float64)


def recognise(
    gallery: FloatArray,
    labels: Sequence[str],
    queries: FloatArray,
    left_out: Sequence[Collection[int]] | None = None,
) -> list[str]:
    """The class of each of q vectors by linear discriminant analysis of n labelled ones.

    The class with the nearest mean, by the Mahalanobis distance of the covariance within classes; that is shrunk as
    Ledoit and Wolf do, so vectors may be fewer than their numbers. Of equal ones the first by name.

    Args:
        gallery: [n, d].
        labels: [n].
        queries: [q, d].
        left_out: [q] rows of `gallery` that each must do without, such as those of the same clip.

    Returns:
        [q] classes, "" where nothing is left to learn from.
    """
    given = [tuple(sorted(rows)) for rows in left_out or [()] * len(queries)]
    names = np.asarray(labels)
    found = np.full(len(queries), "", dtype=object)
    for rows in dict.fromkeys(given):
        kept = np.setdiff1d(np.arange(len(gallery)), rows)
        at = [i for i, own in enumerate(given) if own == rows]
        if len(kept):
            found[at] = _nearest_means(gallery[kept], names[kept], queries[at])
    return [str(name) for name in found]


def _nearest_means(gallery: FloatArray, labels: NDArray[np.str_], queries: FloatArray) -> NDArray[np.str_]:
    from sklearn.covariance import ledoit_wolf

    classes, places = np.unique(labels, return_inverse=True)
    means = np.stack([gallery[places == c].astype(np.float64).mean(axis=0) for c in range(len(classes))])
    within = gallery.astype(np.float64) - means[places]
    covariance = ledoit_wolf(within, assume_centered=True)[0] if within.any() else np.eye(gallery.shape[1])
    covariance += 1e-9 * np.trace(covariance) / len(covariance) * np.eye(len(covariance))
    factor = cholesky(covariance, lower=True)
    apart = cdist(*(solve_triangular(factor, each.T, lower=True).T for each in (queries.astype(np.float64), means)))
    return np.asarray(classes[apart.argmin(axis=1)])


class Likeness:
    """Descriptors of motions, and the classes that they are recognised as.

    Attributes:
        real: [b, d] of what really follows in the test clips.
        gallery: [n, d] of what follows in the training clips.
        made: [t, d] of the trials.
    """

    def __init__(
        self, trials: Sequence[Trial], seeded: Sequence[SeededClip], gallery: Sequence[SeededClip], describe: Describe
    ) -> None:
        self.real = describe([(each.after, each.fps) for each in seeded])
        self.gallery = describe([(each.after, each.fps) for each in gallery])
        self.made = describe([(trial.made.positions, trial.made.fps) for trial in trials])
        rows: dict[str, set[int]] = {}
        for i, each in enumerate(gallery):
            rows.setdefault(each.motion.clip, set()).add(i)

        def of(*clips: SeededClip) -> set[int]:
            return set().union(*(rows.get(each.motion.clip, ()) for each in clips))

        labels = [each.motion.label for each in gallery]
        seen = recognise(self.gallery, labels, self.made, [of(trial.seed, trial.real) for trial in trials])
        seen_real = recognise(self.gallery, labels, self.real, [of(each) for each in seeded])
        beside = dict(zip(seeded, seen_real, strict=True))
        self._right = np.array([trial.wanted == name for trial, name in zip(trials, seen, strict=True)])
        self._right_real = np.array([trial.wanted == beside[trial.real] for trial in trials])

    def recognised(self, others: Sequence[int], own: Sequence[int]) -> dict[str, Any] | None:
        """Of trials from other classes' seeds and from own ones, as many real clips beside the former."""
        if not others:
            return None
        made, real = (float(np.mean(right[list(others)])) for right in (self._right, self._right_real))
        alone = float(np.mean(self._right[list(own)])) if own else None
        return {
            "made": made, "real": real, "ratio": made / real if real else None, "own_seeds": alone, "n": len(others)
        }  # fmt: skip
