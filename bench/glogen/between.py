"""LocGen beside curves: frames between true sparse poses of clips that were left out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.glogen.generator import TrainedGenerator
from motionlake.glogen.inbetweening import dense_motions, interpolated_motion
from motionlake.glogen.sparse import HEIGHT, JOINT_COLUMNS, TrainingPiece
from motionlake.glogen.trajectories import FPS
from motionlake.motion.resampling import interpolated
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from bench.glogen.dense import asked_pieces
from bench.glogen.folds import Measures, Unit, generator_of, parted
from bench.glogen.material import frames_of


def straight(rows: Float64Array, times: Float64Array, at: Float64Array) -> Float64Array:
    """[T, 60] joints on straight lines between sparse poses [n, 65] (equation 4.3)."""
    return interpolated(rows[:, JOINT_COLUMNS], np.interp(at, times, np.arange(len(times))))


def cubic(rows: Float64Array, times: Float64Array, at: Float64Array) -> Float64Array:
    """[T, 60] on cubic splines."""
    joints: Float64Array = CubicSpline(times, rows[:, JOINT_COLUMNS])(at)
    return joints


def shaped(rows: Float64Array, times: Float64Array, at: Float64Array) -> Float64Array:
    """[T, 60] on cubics that do not overshoot, from which LocGen starts."""
    return interpolated_motion(rows, times, at)[:, JOINT_COLUMNS]


CURVES: Final[Mapping[str, Callable[[Float64Array, Float64Array, Float64Array], Float64Array]]] = {
    "straight lines": straight,
    "cubics": cubic,
    "cubics that do not overshoot": shaped,
}
ROWS: Final = ("LocGen", *CURVES)


def measure(unit: Unit) -> dict[str, Measures]:
    """{row: mean per-joint error of every piece, body lengths}."""
    generator = generator_of(unit)
    pieces = asked_pieces(parted(unit.set_name, unit.fold)[1])
    made = {"LocGen": [_by_locgen(generator, piece) for piece in pieces]}
    for name, curve in CURVES.items():
        made[name] = [curve(piece.sparse.rows, _times(piece), _asked(piece)) for piece in pieces]
    return {
        name: {"joint_error": [_error(f, piece) for f, piece in zip(frames, pieces, strict=True)]}
        for name, frames in made.items()
    }


def _times(piece: TrainingPiece) -> Float64Array:
    return piece.sparse.places / FPS


def _asked(piece: TrainingPiece) -> Float64Array:
    """Seconds of the frames after the first one, where the first sparse pose is."""
    return np.arange(1, len(piece.motion)) / FPS


def _by_locgen(generator: TrainedGenerator, piece: TrainingPiece) -> Float64Array:
    (motion,) = dense_motions(generator.locgen, [piece.sparse.rows], [_times(piece)], len(piece.motion) - 1)
    return motion.joints.reshape(-1, HEIGHT)


def _error(found: NDArray[np.floating], piece: TrainingPiece) -> float:
    apart = (found - frames_of(piece.motion)[1:]).reshape(len(found), -1, 3)
    return float(np.linalg.norm(apart, axis=2).mean())
