"""How far the windows of clips are from a piece, as the codes of stage "windows" tell.

Codes differ from vectors by rounding alone, so the clips that are nearest by codes hold those that are nearest: some
more than are asked for are compared by the vectors themselves.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.kernels import njit
from motionlake.stages.windows import WINDOWS, WindowFile
from numpy.typing import NDArray

_QUERY_CODE: Final = 8191  # a sum of 512 products stays below 2^31


class CodedPiece(NamedTuple):
    """The descriptor of a piece in integers [512], the scale that turns them into it, and its squared length."""

    code: NDArray[np.int16]
    scale: float
    square: float

    @staticmethod
    def of(descriptor: Float32Array) -> CodedPiece:
        scale = float(np.abs(descriptor).max(initial=0.0)) / _QUERY_CODE or 1.0
        square = float(np.square(descriptor.astype(np.float64)).sum())
        return CodedPiece(np.rint(descriptor / scale).astype(np.int16), scale, square)

    def apart(self, held: WindowFile) -> Float64Array:
        """[n] squared distances of the windows of a part."""
        return nearness(held.codes, held.scales, held.squares, self.code, self.scale) + self.square


def overlapping(held: WindowFile, run: slice, without: Mapping[str, Any]) -> NDArray[np.bool_]:
    """[n] which windows of a clip overlap the frames [first, last) of a piece."""
    starts, stops = held.bounds()
    return np.asarray((starts[run] < without["last"]) & (stops[run] > without["first"]))


def codes_of_files(rows: Iterable[Mapping[str, Any]]) -> dict[str, str]:
    """By frames part the codes of its windows, of rows of `window_files`; those of newer vectors are not made yet."""
    return {row["part"]: row["codes"] for row in rows if row["codes_key"] == WINDOWS.key_of(row["key"], ())}


@njit(cache=True, nogil=True)
def nearness(
    codes: NDArray[np.int8], scales: Float32Array, squares: Float32Array, query: NDArray[np.int16], scale: float
) -> Float64Array:
    """[n] squared distances of vectors from a query, as their codes [n, d] tell, less its squared length."""
    found = np.empty(len(codes))
    for row in range(len(codes)):
        total = np.int32(0)
        for i in range(len(query)):
            total = np.int32(total + np.int32(np.int32(codes[row, i]) * np.int32(query[i])))
        found[row] = squares[row] - 2.0 * scale * scales[row] * total
    return found
