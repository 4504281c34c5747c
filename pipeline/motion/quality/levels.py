"""How far above its threshold a fault goes, so that it can be judged against what is usual in a dataset later."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.quality.faults import RUNGS, Level
from motionlake.motion.runs import runs


def sustained(values: Float64Array, gap: int, least: int) -> Float64Array:
    """[F] the highest threshold at which each frame belongs to a run of [F] values above it, as `runs` joins them.

    The closing by `gap` + 1 frames, and of that the opening by `least` (grey morphology, which commutes with
    thresholds).
    """
    from scipy.ndimage import grey_closing, grey_opening

    edge = gap + least + 1
    padded = np.pad(values, edge, constant_values=-np.inf)
    if gap:
        padded = grey_closing(padded, size=gap + 1)
    if least > 1:
        padded = grey_opening(padded, size=least)
    kept: Float64Array = padded[edge:-edge]
    return kept


def levels(
    kind: str, values: Float64Array, thresholds: Sequence[float], names: Sequence[str], gap: int, least: int
) -> list[Level]:
    """Of each joint whose values [F, joints] exceed its threshold for long enough."""
    found = []
    for column in np.flatnonzero((values > thresholds).any(axis=0)).tolist():
        held = sustained(values[:, column] / thresholds[column], gap, least)
        rung = 0
        while ranges := runs(held > 2 ** (rung / RUNGS)):
            for start, stop in ranges:
                level = float(held[start:stop].max())
                found.append(
                    Level(
                        kind=kind, joint=names[column], start=start, stop=stop, rung=rung, level=level,
                        severity=level * thresholds[column],
                    )
                )  # fmt: skip
            rung += 1
    return found
