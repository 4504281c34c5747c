"""Whether made motions are like real ones, as a set and one by one (section 4.3.3), and whether they are copies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Float64Array, FloatArray
from motionlake.evaluation.synthesis_trials import Begun, Trial
from motionlake.motion.dtw import clip_dtw
from numpy.typing import NDArray
from scipy.linalg import cholesky, qr, solve_triangular
from scipy.spatial.distance import cdist


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


def nearest_real_distances(
    asked: Sequence[Float32Array],
    real: Sequence[Float32Array],
    allowed: BoolArray | None = None,
    distance: Callable[[Float32Array, Float32Array], float] = clip_dtw,
    progress: Callable[[int, int], None] | None = None,
) -> Float64Array:
    """[q] distance of each of q motions from the real clip nearest to it.

    Args:
        asked: q motions, each [T, D].
        real: r real clips, each [T, D].
        allowed: [q, r] which clips count; not the clip itself, where the motions are real clips too.
        distance: of two motions; whole-clip DTW by default.
        progress: hears motions done and q.

    Raises:
        ValueError: `allowed` of another shape.
    """
    may = np.ones((len(asked), len(real)), dtype=bool) if allowed is None else allowed
    if may.shape != (len(asked), len(real)):
        raise ValueError(f"allowed of shape {may.shape} does not fit {len(asked)} motions and {len(real)} clips")
    found = np.full(len(asked), np.nan)
    for i, motion in enumerate(asked):
        near = [distance(motion, real[j]) for j in np.flatnonzero(may[i]).tolist()]
        found[i] = min(near, default=np.nan)
        if progress is not None:
            progress(i + 1, len(asked))
    return found


def recognise(
    known: FloatArray,
    labels: Sequence[str],
    asked: FloatArray,
    left_out: Sequence[Sequence[int]] | None = None,
) -> list[str]:
    """The class of each of q vectors by linear discriminant analysis of n labelled ones.

    The class with the nearest mean, by the Mahalanobis distance of the covariance within classes; that is shrunk as
    Ledoit and Wolf do, so vectors may be fewer than their numbers. Of equal ones the first by name.

    Args:
        known: [n, d].
        labels: [n].
        asked: [q, d].
        left_out: [q] rows of `known` that each must do without, such as those of the same clip.

    Returns:
        [q] classes, "" where nothing is left to learn from.

    Raises:
        ValueError: shapes that do not fit.
    """
    given = [()] * len(asked) if left_out is None else [tuple(sorted(rows)) for rows in left_out]
    if not len(known) == len(labels) or not len(given) == len(asked):
        raise ValueError(f"{len(labels)} labels and {len(given)} exceptions: {len(known)} and {len(asked)} are needed")
    names = np.asarray(labels)
    found = np.full(len(asked), "", dtype=object)
    for rows in dict.fromkeys(given):
        kept = np.setdiff1d(np.arange(len(known)), rows)
        at = [i for i, own in enumerate(given) if own == rows]
        if len(kept):
            found[at] = _nearest_means(known[kept], names[kept], asked[at])
    return [str(name) for name in found]


def _nearest_means(known: FloatArray, labels: NDArray[np.str_], asked: FloatArray) -> NDArray[np.str_]:
    from sklearn.covariance import ledoit_wolf

    classes, places = np.unique(labels, return_inverse=True)
    means = np.stack([known[places == c].astype(np.float64).mean(axis=0) for c in range(len(classes))])
    within = known.astype(np.float64) - means[places]
    covariance = ledoit_wolf(within, assume_centered=True)[0] if within.any() else np.eye(known.shape[1])
    covariance += 1e-9 * np.trace(covariance) / len(covariance) * np.eye(len(covariance))
    factor = cholesky(covariance, lower=True)
    apart = cdist(*(solve_triangular(factor, each.T, lower=True).T for each in (asked.astype(np.float64), means)))
    return np.asarray(classes[apart.argmin(axis=1)])


def recognised(wanted: Sequence[str], seen: Sequence[str]) -> float:
    """Share of motions whose class is seen to be the wanted one.

    Raises:
        ValueError: no motions, or lists of different lengths.
    """
    if len(wanted) != len(seen) or not wanted:
        raise ValueError(f"{len(wanted)} classes wanted and {len(seen)} seen do not compare")
    return float(np.mean([a == b for a, b in zip(wanted, seen, strict=True)]))


# [n, d] descriptors of n motions, each positions [F, 21, 3] and frames a second.
Describe = Callable[[Sequence[tuple[Float64Array, float]]], FloatArray]


class Likeness:
    """Descriptors of motions, and the classes that they are recognised as."""

    def __init__(
        self, trials: Sequence[Trial], begins: Sequence[Begun], known: Sequence[Begun], describe: Describe
    ) -> None:
        self.real = describe([(each.after, each.fps) for each in begins])
        self.known = describe([(each.after, each.fps) for each in known])
        self.made = describe([(trial.made.positions, trial.made.fps) for trial in trials])
        place = {id(each): i for i, each in enumerate(begins)}
        self._wanted = [trial.wanted for trial in trials]
        self._beside = [place[id(trial.real)] for trial in trials]
        rows: dict[str, list[int]] = {}
        for i, each in enumerate(known):
            rows.setdefault(each.motion.clip, []).append(i)
        labels = [each.motion.label for each in known]
        own = [rows.get(each.motion.clip, []) for each in begins]
        either = [
            sorted({*rows.get(trial.seed.motion.clip, []), *rows.get(trial.real.motion.clip, [])}) for trial in trials
        ]
        self._seen = recognise(self.known, labels, self.made, either)
        self._seen_real = recognise(self.known, labels, self.real, own)

    def recognised(self, others: Sequence[int], own: Sequence[int]) -> dict[str, Any] | None:
        """Of trials from other classes' seeds and from own ones, as many real clips beside the former."""
        if not others:
            return None
        wanted = [self._wanted[i] for i in others]
        made = recognised(wanted, [self._seen[i] for i in others])
        real = recognised(wanted, [self._seen_real[self._beside[i]] for i in others])
        alone = recognised([self._wanted[i] for i in own], [self._seen[i] for i in own]) if own else None
        return {
            "made": made, "real": real, "ratio": made / real if real else None, "own_seeds": alone, "n": len(others)
        }  # fmt: skip
