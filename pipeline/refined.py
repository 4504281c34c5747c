"""The least of many values that take long to work out, of which lower bounds are known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeVar

import numpy as np
from motionlake.arrays import Int64Array
from numpy.typing import NDArray

Values = TypeVar("Values", bound=NDArray[Any])
AHEAD: Final = 2  # times as many values as are asked for are worked out first
SLACK: Final = 1e-5  # share of a value by which rounding may make a bound greater


def refined(bounds: Values, count: int, exact: Callable[[Int64Array], Values]) -> Values:
    """[n] exact values in the place of bounds, wherever a value may be among the least, so many; else the bounds.

    So the least values and their places are what they would be if all had been worked out.

    Args:
        bounds: [n] no greater than the values; infinite where there is none.
        count: how many of the least are asked for.
        exact: gives the values at some places.
    """
    found, first = bounds.copy(), min(AHEAD * count, len(bounds) - 1)
    rows = np.sort(np.argpartition(bounds, first)[: first + 1]) if len(bounds) else np.zeros(0, dtype=np.int64)
    rows = rows[np.isfinite(bounds[rows])]
    if not len(rows):
        return found
    found[rows] = exact(rows)
    if 0 < count < len(rows):
        limit = np.partition(found[rows], count - 1)[count - 1]
        more = np.flatnonzero(bounds <= limit + abs(limit) * SLACK)
        more = more[~np.isin(more, rows)]
        if len(more):
            found[more] = exact(more)
    return found
