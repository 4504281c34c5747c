"""A Gaussian filter over frames by the sums of `scipy.ndimage.gaussian_filter1d`, to the last bit.

To import scipy.ndimage takes longer than most commands that smooth a clip or two.
"""

from __future__ import annotations

from typing import Final, Literal

import numpy as np
from motionlake.arrays import Float64Array

Ends = Literal["reflect", "nearest"]  # how frames go on beyond either end: mirrored, or as the last one
_PADDING: Final[dict[Ends, Literal["symmetric", "edge"]]] = {"reflect": "symmetric", "nearest": "edge"}


def smoothed(frames: Float64Array, deviation: float, ends: Ends = "reflect") -> Float64Array:
    """[N, ...] of `frames` [N, ...], N at least 1; `deviation` of the filter in frames, above 0."""
    reach = int(4 * deviation + 0.5)
    weights = np.exp(-0.5 / (deviation * deviation) * np.arange(-reach, reach + 1) ** 2)
    weights /= weights.sum()
    count = len(frames)
    padded = np.pad(frames, ((reach, reach), *[(0, 0)] * (frames.ndim - 1)), mode=_PADDING[ends])
    found = padded[reach : reach + count] * weights[reach]
    for back in range(reach, 0, -1):
        found += (padded[reach - back :][:count] + padded[reach + back :][:count]) * weights[reach - back]
    return np.asarray(found)
