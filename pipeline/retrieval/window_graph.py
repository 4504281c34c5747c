"""How near windows of clips are to a query along the graph of their likeness, made for the moment of one search.

A movement looks different from one moment to the next: its windows are near one another in a chain, not all near the
query. The graph is that of `diffusion`, over the nearest windows in place of clips; what starts at the windows nearest
to the query passes on along it.
"""

from __future__ import annotations

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.diffusion import JOINED, RESTART

_LEAST = 1e-12  # of distances that others are divided by
_STEPS = 300  # of the solution
_ERROR = 1e-5


def along_windows(apart: Float64Array, near: Float64Array) -> Float64Array:
    """[m] how near windows are along their graph, from 0 to 1, the nearest at 1.

    A window is joined to the ten nearest of the others, and to those that are so joined to it, by exp(-d^2 / (s t)),
    where s and t are the distances of both from their tenth. The ten nearest to the query start with how near they are.

    Args:
        apart: [m, m] distances between them; infinite between windows that share frames, which are not joined.
        near: [m] of each, above 0.
    """
    from scipy.sparse import csr_array, diags_array, eye_array
    from scipy.sparse.linalg import cg

    count = len(near)
    joined = min(JOINED, count - 1)
    if joined < 1:
        return np.ones(count)
    free = apart + np.where(np.eye(count, dtype=np.bool_), np.inf, 0.0)
    others = np.argpartition(free, joined - 1, axis=1)[:, :joined]
    distances = np.take_along_axis(free, others, axis=1)
    scales = np.maximum(np.where(np.isfinite(distances), distances, 0.0).max(axis=1), _LEAST)
    weights = np.exp(-(distances / scales[:, None]) * (distances / scales[others]))
    edges = csr_array((weights.ravel(), others.ravel(), np.arange(0, count * joined + 1, joined)), (count, count))
    edges = edges.maximum(edges.T)
    degrees = edges.sum(axis=1)
    root = diags_array(1 / np.sqrt(np.where(degrees > 0, degrees, 1.0)))
    start = np.where(near >= np.sort(near)[-joined], near, 0.0)
    spread, _ = cg(eye_array(count) - (1 - RESTART) * (root @ edges @ root), start, rtol=_ERROR, maxiter=_STEPS)
    return np.asarray(np.clip(spread / spread.max(), 0.0, 1.0))
