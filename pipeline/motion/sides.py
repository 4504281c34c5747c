"""Classes that are done with one side: by their names, or since their mirror images are unlike their recordings."""

from __future__ import annotations

import re
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray, Int64Array

HANDED: Final = 2.0  # times as far as others that mirror images of a class are which is done with one side
_SIDE: Final = re.compile(r"(?<![a-z])(left|right|((counter|anti)-?)?clockwise)(?![a-z])", re.IGNORECASE)


def names_a_side(label: str) -> bool:
    """Whether a label says left, right, or which way round (turn_left, clockwise)."""
    return _SIDE.search(label) is not None


def unlike_mirrored(
    poses: FloatArray, mirrored: FloatArray, clips: Int64Array, others: FloatArray, clips_of_others: Int64Array
) -> bool:
    """Whether poses of a class are, mirrored, far from those of other clips; of one clip alone nobody knows.

    Medians of nearest distances: of eight classes of utd_mhad and five of CMU those of one side have 3.7 times and more
    (throw, tennis_swing, knock, swipe_left), the others up to 1.5.

    Args:
        poses, mirrored: [n, d] some, and their mirror images.
        clips: [n] of which clips they are.
        others: [m, d] those that they are compared with.
        clips_of_others: [m].
    """
    near, far = (nearest_of_another(each, clips, others, clips_of_others) for each in (poses, mirrored))
    return bool(len(near) and np.isfinite(near).all() and np.median(far) > HANDED * np.median(near))


def nearest_of_another(
    poses: FloatArray, clips: Int64Array, others: FloatArray, clips_of_others: Int64Array
) -> Float64Array:
    """[n] distances of poses [n, d] from the nearest of others [m, d] of another clip; infinite where there is none."""
    return np.asarray(apart_of_another(poses, clips, others, clips_of_others).min(axis=1, initial=np.inf))


def apart_of_another(
    poses: FloatArray, clips: Int64Array, others: FloatArray, clips_of_others: Int64Array
) -> Float64Array:
    """[n, m] distances of poses [n, d] from others [m, d]; infinite between poses of one clip."""
    from scipy.spatial.distance import cdist

    return np.where(clips[:, None] == clips_of_others, np.inf, cdist(poses, others)).astype(np.float64)
