"""How many symbols of a dictionary are in use: what every recipe is guarded by."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int32Array

IN_USE: Final = 0.75  # of the symbols, below which a person is warned


def use_of(symbols: Int32Array, m: int) -> dict[str, Any]:
    """How postures use a dictionary of m symbols.

    Args:
        symbols: [n] of postures, n >= 1.
        m: symbols there are.

    Returns:
        m; `occupied`, symbols that a posture has; `largest` share of one symbol; `perplexity` of the shares: as many
        symbols in equal use have as much entropy.
    """
    share = np.bincount(symbols, minlength=m) / len(symbols)
    used = share[share > 0]
    return {
        "m": m,
        "occupied": len(used),
        "largest": float(share.max()),
        "perplexity": float(np.exp(-np.sum(used * np.log(used)))),
    }


def scatter(postures: Float32Array, symbols: Int32Array, m: int) -> float:
    """The share of the variance of postures [n, D] that lies within their symbols [n]."""
    whole = float(np.square(postures - postures.mean(axis=0, dtype=np.float64)).sum())
    means = mean_postures(postures, symbols, m)[0]
    return float(np.square(postures - means[symbols]).sum()) / (whole or 1.0)


def mean_postures(postures: Float32Array, symbols: Int32Array, m: int) -> tuple[Float64Array, Int32Array]:
    """[m, D] the mean of the postures of each symbol, 0 where there is none, and [m] how many there are."""
    sums = np.zeros((m, postures.shape[1]))
    np.add.at(sums, symbols, postures)
    counts = np.bincount(symbols, minlength=m).astype(np.int32)
    return sums / np.maximum(counts, 1)[:, None], counts


def line(metrics: Mapping[str, Any]) -> str:
    """What `use_of` found, for people; below `IN_USE` of the symbols it is a warning."""
    counted = f"{metrics['occupied']} of {metrics['m']} symbols in use"
    if metrics["occupied"] >= IN_USE * metrics["m"]:
        return counted
    return f"only {counted}: postures that differ share one; try a smaller m, or another dictionary"
