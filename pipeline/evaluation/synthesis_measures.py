"""What made motions come to beside real ones: errors, movement, likeness. Each returns what `--json` prints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, StepProgress
from motionlake.evaluation.dtw import baseline_features
from motionlake.evaluation.synthesis_likeness import nearest_real_distances
from motionlake.evaluation.synthesis_metrics import (
    MILLISECONDS,
    Energy,
    FootSliding,
    body_poses,
    bone_length_drift,
    energy,
    errors_at,
    euclidean_error,
    foot_sliding,
    joint_error,
    sparse_poses,
    travel_speed,
    within_range,
)
from motionlake.evaluation.synthesis_trials import Begun, Trial
from motionlake.motion.dtw import nearest_stretch

MM: Final = 1000.0
MOST_ALIGNED: Final = 200  # motions of a kind that are aligned with every training clip
NEAR: Final = 0.05  # quantile of the distances of real clips below which a motion is near


def errors(trials: Sequence[Trial]) -> dict[str, Any]:
    """Errors of motions that go on from a clip in its own class, against what really follows."""
    made = [trial.made.positions for trial in trials]
    still = [np.repeat(trial.seed.last_pose[None], len(trial.real.after), axis=0) for trial in trials]
    return {**_errors(made, trials), "zero_velocity": _errors(still, trials)}


def _errors(made: Sequence[Float64Array], trials: Sequence[Trial]) -> dict[str, Any]:
    """Means over trials; in millimetres, but for sparse poses (body lengths)."""
    dense, sparse, timed = [], [], []
    for positions, trial in zip(made, trials, strict=True):
        after, fps = trial.real.after, trial.real.fps
        count = min(len(positions), len(after))
        pair = body_poses(positions[:count]), body_poses(after[:count])
        dense.append((joint_error(*pair), euclidean_error(*pair)))
        pair = sparse_poses(positions[:count], fps), sparse_poses(after[:count], fps)
        sparse.append((joint_error(*pair), euclidean_error(*pair)))
        timed.append(errors_at(positions, after, fps))
    at = np.stack(timed) * MM
    known = np.isfinite(at[..., 0]).sum(axis=0)
    means = np.where(known[:, None] > 0, np.nansum(at, axis=0) / np.maximum(known, 1)[:, None], np.nan)
    joint, euclidean = np.mean(dense, axis=0) * MM
    sparse_joint, sparse_euclidean = np.mean(sparse, axis=0)
    return {
        "mean_per_joint_error": float(joint),
        "euclidean": float(euclidean),
        "sparse": {"mean_per_joint_error": float(sparse_joint), "euclidean": float(sparse_euclidean)},
        "errors_ms": _by_time(means[:, 0]),
        "euclidean_ms": _by_time(means[:, 1]),
        "n_ms": {str(time): int(n) for time, n in zip(MILLISECONDS, known, strict=True)},
    }


def _by_time(values: Float64Array) -> dict[str, float | None]:
    return {str(t): float(v) if np.isfinite(v) else None for t, v in zip(MILLISECONDS, values, strict=True)}


@dataclass(frozen=True)
class Movement:
    """One motion's."""

    sliding: FootSliding
    drift: float
    energy: Energy
    travel: float


def movement_of(positions: Float64Array, fps: float, rest_offsets: Float64Array) -> Movement:
    """What its feet, bones and joints do."""
    return Movement(
        foot_sliding(positions, fps), bone_length_drift(positions, rest_offsets), energy(positions, fps),
        travel_speed(positions, fps),
    )  # fmt: skip


def of_made(trial: Trial) -> Movement:
    return movement_of(trial.made.positions, trial.made.fps, trial.made.rest_offsets)


def of_real(begun: Begun) -> Movement:
    return movement_of(begun.after, begun.fps, begun.motion.rest_offsets)


def movement(
    made: Sequence[Movement], real: Sequence[Movement], classes: Sequence[str], ranges: Mapping[str, Sequence[Energy]]
) -> dict[str, Any]:
    """Made motions beside as many real ones.

    Args:
        made: n.
        real: n, the clips that they are compared with.
        classes: n wanted classes.
        ranges: energies of the real clips of each class.
    """
    within = [within_range([one.energy], ranges[name])[0] for one, name in zip(made, classes, strict=True)]
    return {
        "foot_sliding": {
            **_beside([m.sliding.speed for m in made], [m.sliding.speed for m in real]),
            "standing": _beside([m.sliding.standing_speed for m in made], [m.sliding.standing_speed for m in real]),
            "contact": _beside([m.sliding.contact for m in made], [m.sliding.contact for m in real]),
        },
        "bone_length_drift": max(m.drift for m in made),
        "energy": {
            **_beside([m.energy.mean for m in made], [m.energy.mean for m in real]),
            "made_range": [min(m.energy.low for m in made), max(m.energy.high for m in made)],
            "real_range": [
                min(each.low for name in set(classes) for each in ranges[name]),
                max(each.high for name in set(classes) for each in ranges[name]),
            ],
            "within": float(np.mean(within)),
        },
        "travel_speed": _beside([m.travel for m in made], [m.travel for m in real]),
    }


def _beside(made: Sequence[float], real: Sequence[float]) -> dict[str, float | None]:
    """Means, and their ratio where the real one is not zero."""
    own, known = float(np.mean(made)), float(np.mean(real))
    return {"made": own, "real": known, "ratio": own / known if known > 0 else None}


@dataclass(frozen=True)
class Aligned:
    """A motion to align: its frames as DTW compares them, and the clips that it has to do with."""

    frames: Float32Array
    clips: frozenset[str]


def to_align(positions: Float64Array, fps: float, *clips: str) -> Aligned:
    return Aligned(baseline_features(positions, fps), frozenset(clips))


def copying(
    made: Sequence[Aligned], test: Sequence[Aligned], followed: Sequence[Aligned], training: Sequence[Aligned],
    progress: StepProgress,
) -> dict[str, Any]:  # fmt: skip
    """How near the nearest stretch of a training clip is, in body lengths (the frame distance of `baseline_features`).

    Where there are more than `MOST_ALIGNED` of a kind, so many at even distances are aligned.

    Args:
        made: motions.
        test: what really follows the seeds.
        followed: the same of training clips, each to be compared with all other training clips.
        training: whole clips.
        progress: hears motions done.

    Returns:
        n, mean, median and 5 % quantile of "made", "test" and "training"; `near`: share of the made motions that are
        nearer than the nearest 5 % of "test".
    """
    found = {}
    for name, motions in (("made", made), ("test", test), ("training", followed)):
        some = [motions[i] for i in np.unique(np.linspace(0, len(motions) - 1, MOST_ALIGNED).round().astype(int))]
        allowed = np.array([[not known.clips & motion.clips for known in training] for motion in some])
        far = nearest_real_distances(
            [motion.frames for motion in some], [known.frames for known in training], allowed,
            lambda a, b: nearest_stretch(a, b).cost, partial(progress, f"align {name}"),
        )  # fmt: skip
        found[name] = far[np.isfinite(far)]
    if not all(len(far) for far in found.values()):
        return {}
    near = float(np.quantile(found["test"], NEAR))
    return {
        **{name: _spread(far) for name, far in found.items()},
        "ratio": float(np.median(found["made"]) / max(np.median(found["test"]), 1e-12)),
        "near": float(np.mean(found["made"] < near)),
    }


def _spread(values: Float64Array) -> dict[str, float]:
    return {
        "mean": float(values.mean()),
        "median": float(np.median(values)),
        "q05": float(np.quantile(values, NEAR)),
        "n": len(values),
    }
