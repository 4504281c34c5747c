"""Made motions as a set beside real ones: are they as real ones are, and as many different ones.

A set is vectors [n, d], descriptors of stretches of at most `WINDOW` seconds that do not overlap, so that motions of
different lengths weigh as they last. Real clips that a generator has learned from are measured against the unseen ones
in the same way and in equal numbers: what they reach is what can be reached.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array, FloatArray, Int64Array
from motionlake.evaluation.synthesis.likeness import Describe, frechet_distance
from motionlake.evaluation.synthesis.motions import Stretch
from motionlake.motion.features import body_length
from motionlake.motion.skeleton import body_poses
from scipy.spatial.distance import cdist, pdist, squareform

WINDOW: Final = 2.0  # seconds
NEAREST: Final = 5  # neighbours, as Naeem et al. take
MOST_PAIRS: Final = 500


def windows(motion: Stretch) -> list[Float64Array]:
    """The stretches of a motion, `WINDOW` seconds each; a rest at the end is left out, a shorter motion is one."""
    width = max(2, round(WINDOW * motion.fps))
    if len(motion.positions) <= width:
        return [motion.positions]
    return [motion.positions[start : start + width] for start in range(0, len(motion.positions) - width + 1, width)]


class Windows:
    """Descriptors [n, d] of the windows of motions, the motion [n] that each is of, and its place [n] there."""

    def __init__(self, motions: Sequence[Stretch], describe: Describe) -> None:
        parts = [windows(motion) for motion in motions]
        self.of: Int64Array = np.repeat(np.arange(len(parts)), [len(some) for some in parts])
        self.place: Int64Array = np.array([i for some in parts for i in range(len(some))], dtype=np.int64)
        flat = [(part, motion.fps) for some, motion in zip(parts, motions, strict=True) for part in some]
        self.vectors: FloatArray = describe(flat)

    def some(self, motions: Sequence[int]) -> FloatArray:
        """Those of some motions."""
        return self.vectors[np.isin(self.of, list(motions))]


def neighbourhoods(real: FloatArray, made: FloatArray, nearest: int = NEAREST) -> dict[str, float]:
    """Improved precision and recall (Kynkäänniemi et al. 2019), density and coverage (Naeem et al. 2020).

    Balls about each vector reach to its `nearest`th neighbour of its own set, fewer where the set is that small.
    Precision: share of the made vectors in a real ball; recall: share of the real ones in a made ball. Density: in how
    many real balls a made vector is, over `nearest`: 1 where both are alike, more where made ones crowd where real ones
    are dense. Coverage: share of the real balls that hold a made vector; an outlier among real vectors gains nothing.

    Args:
        real: [n, d].
        made: [m, d].

    Raises:
        ValueError: fewer than two vectors in a set.
    """
    if min(len(real), len(made)) < 2:
        raise ValueError("two vectors a set are needed, to have neighbours")
    k = _neighbours(real, made, nearest)
    inside = held_in_balls(real, made, nearest)
    return {
        "precision": float(inside.any(axis=0).mean()),
        "recall": float(held_in_balls(made, real, nearest).any(axis=0).mean()),
        "density": float(inside.sum() / (k * len(made))),
        "coverage": float(inside.any(axis=1).mean()),
    }


def held_in_balls(real: FloatArray, made: FloatArray, nearest: int = NEAREST) -> BoolArray:
    """[n, m] which of the made vectors [m, d] are in which of the balls about real ones [n, d] (`neighbourhoods`)."""
    reach = _reach(real, _neighbours(real, made, nearest))
    return np.asarray(cdist(real.astype(np.float64), made.astype(np.float64)) < reach[:, None])


def _neighbours(real: FloatArray, made: FloatArray, nearest: int) -> int:
    return min(nearest, len(real) - 1, len(made) - 1)


def _reach(vectors: FloatArray, nearest: int) -> Float64Array:
    """[n] distance to the `nearest`th neighbour."""
    return np.asarray(np.sort(squareform(pdist(vectors.astype(np.float64))), axis=1)[:, nearest])


def likeness(real: FloatArray, made: FloatArray, count: int) -> dict[str, Any] | None:
    """`fid` and `neighbourhoods` of `count` of the made vectors, at even distances, against real ones.

    None where a set has fewer than two.
    """
    if min(len(real), len(made), count) < 2:
        return None
    some = made[np.linspace(0, len(made) - 1, min(count, len(made))).round().astype(int)]
    return {"fid": frechet_distance(real, some), **neighbourhoods(real, some), "n": len(some)}


def spread(
    vectors: FloatArray, of: Int64Array, place: Int64Array, classes: Sequence[str] | None = None
) -> float | None:
    """Mean distance of two vectors of different motions, at the same place in both.

    All such pairs count, of which published measures draw some: diversity, and with `classes` [motions] of motions of
    the same class multimodality (Guo et al. 2020). A motion that is made again and again has none, however it goes on.
    None where there is no pair.
    """
    apart = squareform(pdist(vectors.astype(np.float64)))
    pairs = (of[:, None] != of) & (place[:, None] == place)
    if classes is not None:
        named = np.asarray(classes)[of]
        pairs &= named[:, None] == named
    return float(apart[pairs].mean()) if pairs.any() else None


def pose_spread(motions: Sequence[Stretch]) -> float | None:
    """Body lengths by which the joints of two motions of a class lie apart at the same time, over their first seconds.

    Seen from the body (`body_poses`), mean over joints, over the frames up to `WINDOW` seconds that both have, and over
    pairs (`MOST_PAIRS` of them at even distances, where there are more). It needs no descriptor. None where no class
    has two motions.
    """
    poses = [body_poses(m.positions[: round(WINDOW * m.fps)]) / body_length(m.positions) for m in motions]
    pairs = [
        (i, j) for i in range(len(motions)) for j in range(i) if motions[i].label == motions[j].label
        and motions[i].fps == motions[j].fps
    ]  # fmt: skip
    apart = []
    for at in np.linspace(0, len(pairs) - 1, min(MOST_PAIRS, len(pairs))).astype(int).tolist():
        i, j = pairs[at]
        count = min(len(poses[i]), len(poses[j]))
        apart.append(float(np.linalg.norm(poses[i][:count] - poses[j][:count], axis=2).mean()))
    return float(np.mean(apart)) if apart else None
