"""How far the windows of clips are from a piece, as the codes of stage "windows" tell.

Codes differ from vectors by rounding alone, so the clips that are nearest by codes hold those that are nearest: some
more than are asked for are compared by the vectors themselves.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.kernels import njit
from motionlake.lake.integrity import sound_files
from motionlake.lake.layout import Lake
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

    def apart(self, held: WindowFile, rows: slice = slice(None)) -> Float64Array:
        """[n] squared distances of some windows of a part."""
        codes, scales, squares = held.codes[rows], held.scales[rows], held.squares[rows]
        return nearness(codes, scales, squares, self.code, self.scale) + self.square

    def apart_of_run(self, held: WindowFile, run: slice, without: Mapping[str, Any] | None) -> Float64Array:
        """[n] the same of the windows of a clip; infinite where they overlap frames [first, last) that are none."""
        found = self.apart(held, run)
        if without is not None:
            found[overlapping(held, run, without)] = np.inf
        return found


def overlapping(held: WindowFile, run: slice, without: Mapping[str, Any]) -> NDArray[np.bool_]:
    """[n] which windows of a clip overlap the frames [first, last) of a piece."""
    starts, stops = held.bounds()
    return np.asarray((starts[run] < without["last"]) & (stops[run] > without["first"]))


def codes_of_files(rows: Iterable[Mapping[str, Any]]) -> dict[str, str]:
    """By frames part the codes of its windows, of rows of `window_files`; those of newer vectors are not made yet."""
    return {row["part"]: row["codes"] for row in rows if row["codes_key"] == WINDOWS.key_of(row["key"], ())}


def nearest_of_parts(
    lake: Lake, files: Mapping[str, str], parts: Mapping[str, str], descriptor: Float32Array, count: int,
    without: Mapping[str, Any], pool: Executor,
) -> dict[str, str]:  # fmt: skip
    """The clips nearest to a descriptor, with the part of each; beside them are those of which there are no codes.

    Args:
        lake: the lake.
        files: codes by frames part.
        parts: of some clips.
        descriptor: [512] of a piece.
        count: clips.
        without: as `holding_among`.
        pool: reads parts side by side.

    Raises:
        DamagedError: a file is not as it was written.
    """
    held: dict[str, list[str]] = {}
    for clip, part in parts.items():
        if part in files:
            held.setdefault(part, []).append(clip)
    piece = CodedPiece.of(descriptor)
    paths = sound_files(lake, [files[part] for part in held])

    def compare(path: Path, clips: Sequence[str]) -> list[tuple[float, str]]:
        return _distances(piece, WindowFile.open(path), clips, without)

    found = sorted(pair for pairs in pool.map(compare, paths, held.values()) for pair in pairs)
    kept = [clip for distance, clip in found[:count] if np.isfinite(distance)]
    return {clip: part for clip, part in parts.items() if part not in files} | {clip: parts[clip] for clip in kept}


def _distances(
    piece: CodedPiece, held: WindowFile, clips: Iterable[str], without: Mapping[str, Any]
) -> list[tuple[float, str]]:
    """(squared distance of the nearest window, clip) of some clips of a part."""
    runs = ((clip, held.runs[clip]) for clip in clips if clip in held.runs)
    return [
        (float(piece.apart_of_run(held, run, without if clip == without["clip"] else None).min()), clip)
        for clip, run in runs
    ]


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
