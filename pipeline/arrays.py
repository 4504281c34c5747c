"""Names of the array types, and of the functions that a long computation reports its progress to."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

BoolArray = NDArray[np.bool_]
Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
FloatArray = NDArray[np.floating]  # of any precision
Int32Array = NDArray[np.int32]
Int64Array = NDArray[np.int64]
IntArray = NDArray[np.integer]  # of any size
UInt8Array = NDArray[np.uint8]
UInt32Array = NDArray[np.uint32]

Progress = Callable[[int, int, float], None]  # (steps or epochs done, in all, mean loss or nan)
StepProgress = Callable[[str, int, int], None]  # (what is being done, done, in all)
