"""Learning rates over a training."""

from __future__ import annotations

import math
from typing import Final

WARM_UP: Final = 0.3


def one_cycle(done: float) -> float:
    """Share of the highest rate when a share `done` of training is over: up along a cosine, then down to nothing."""
    if done < WARM_UP:
        return 0.04 + 0.96 * (1 - math.cos(math.pi * done / WARM_UP)) / 2
    return (1 + math.cos(math.pi * (done - WARM_UP) / (1 - WARM_UP))) / 2
