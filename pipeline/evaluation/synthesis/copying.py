"""Whether made motions are copies: how near the nearest stretch of a clip is that the generator has learned from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, StepProgress
from motionlake.evaluation.dtw import baseline_features
from motionlake.motion.dtw import nearest_stretch

MOST_ALIGNED: Final = 200  # motions of a kind that are aligned with every training clip
NEAR: Final = 0.05  # quantile of the distances of real clips below which a motion is near


@dataclass(frozen=True)
class Aligned:
    """A motion to align: its frames [T, D] as DTW compares them, and the clips that it has to do with."""

    frames: Float32Array
    clips: frozenset[str]

    @classmethod
    def of(cls, positions: Float64Array, fps: float, *clips: str) -> Aligned:
        return cls(baseline_features(positions, fps), frozenset(clips))


def nearest_real_distances(
    motions: Sequence[Aligned], real: Sequence[Aligned], progress: Callable[[int, int], None] = lambda done, total: None
) -> Float64Array:
    """[q] cost of aligning each of q motions with the nearest stretch of a real clip that it has nothing to do with.

    NaN where there is none; `progress` hears motions done and q.
    """
    found = np.full(len(motions), np.nan)
    for i, motion in enumerate(motions):
        apart = [other for other in real if not other.clips & motion.clips]
        found[i] = min((nearest_stretch(motion.frames, other.frames).cost for other in apart), default=np.nan)
        progress(i + 1, len(motions))
    return found


def copying(
    made: Sequence[Aligned], test: Sequence[Aligned], followed: Sequence[Aligned], training: Sequence[Aligned],
    unseen: Sequence[Aligned], progress: StepProgress,
) -> dict[str, Any]:  # fmt: skip
    """How near the nearest stretch of a training clip is, in body lengths (the frame distance of `baseline_features`).

    Where there are more than `MOST_ALIGNED` of a kind, so many at even distances are aligned.

    Args:
        made: motions.
        test: what really follows the seeds.
        followed: the same of training clips, each to be compared with all other training clips.
        training: whole clips.
        unseen: whole test clips.
        progress: hears motions done.

    Returns:
        n, mean, median and 5 % quantile of "made", "test" and "training"; `ratio` of the medians of made and test;
        `near`: share of the made motions that are nearer than the nearest 5 % of "test"; `z` (Meehan et al. 2020, the
        z-score of Mann and Whitney's U of "made" against "test": below -3 made motions are nearer to training clips
        than unseen real ones are); `unseen`: medians of made motions to the nearest of as many training clips
        ("training") and test clips ("test") and their ratio, below 1 where training clips are nearer.
    """
    found = {}
    for name, motions in (("made", made), ("test", test), ("training", followed)):
        far = nearest_real_distances(_some(motions, MOST_ALIGNED), training, partial(progress, f"align {name}"))
        found[name] = far[np.isfinite(far)]
    if not all(len(far) for far in found.values()):
        return {}
    medians = {name: float(np.median(far)) for name, far in found.items()}
    quantiles = {name: float(np.quantile(far, NEAR)) for name, far in found.items()}
    return {
        **{
            name: {"mean": float(far.mean()), "median": medians[name], "q05": quantiles[name], "n": len(far)}
            for name, far in found.items()
        },
        "ratio": medians["made"] / max(medians["test"], 1e-12),
        "near": float(np.mean(found["made"] < quantiles["test"])),
        "z": rank_z(found["made"], found["test"]),
        "unseen": _by_kind(_some(made, MOST_ALIGNED), training, unseen, progress),
    }


def rank_z(made: Float64Array, real: Float64Array) -> float:
    """z-score of Mann and Whitney's U of two samples: 0 where they are alike, negative where `made` is smaller."""
    from scipy.stats import rankdata

    n, m = len(made), len(real)
    u = float(rankdata(np.concatenate([made, real]))[:n].sum()) - n * (n + 1) / 2
    return float((u - n * m / 2) / np.sqrt(n * m * (n + m + 1) / 12))


def _by_kind(
    made: Sequence[Aligned], training: Sequence[Aligned], unseen: Sequence[Aligned], progress: StepProgress
) -> dict[str, float] | None:
    count = min(len(training), len(unseen))
    found = {}
    for name, clips in (("training", training), ("test", unseen)):
        far = nearest_real_distances(made, _some(clips, count), partial(progress, f"align made with {name}"))
        if not np.isfinite(far).any():
            return None
        found[name] = float(np.nanmedian(far))
    return {**found, "ratio": found["training"] / max(found["test"], 1e-12)}


def _some(motions: Sequence[Aligned], most: int) -> list[Aligned]:
    """At most so many, at even distances."""
    return [motions[i] for i in np.unique(np.linspace(0, len(motions) - 1, most).round().astype(int))]
