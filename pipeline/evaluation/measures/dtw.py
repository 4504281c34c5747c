"""The baseline without motifs: what whole clips are compared by under `motionlake.motion.clip_dtw`.

Fifteen joints seen from the body (centred at the hips, turned to face one way, divided by leg plus torso length) at 24
frames a second.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.motion.features import Float32Array, Float64Array, WordConfig, word_features

BASELINE: Final = WordConfig(root_weight=0.0, velocity_weight=0.0, smoothing=0.0)


def baseline_features(positions: Float64Array, fps: float) -> Float32Array:
    """[T, 42] the baseline's numbers of a clip with canonical joint `positions` [F, 21, 3] at `fps`.

    The fifteenth joint is the origin. Raises `ValueError` as `word_features` does.
    """
    return word_features(positions, np.zeros((0, 0, 4)), fps, BASELINE)
