"""From recorded clips to the database of motion matching."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.matching.database import MotionDatabase
from motionlake.matching.features import features
from motionlake.matching.flights import longest_flights
from motionlake.matching.hubs import costs_of_beginning
from motionlake.matching.recordings import (
    FPS,
    SHORTEST,
    MatchingClip,
    RootedMotion,
    clearance,
    rooted,
    sound_ranges,
    steps_of,
)
from motionlake.motion.flips import without_flips
from motionlake.motion.ground import ground_of, levelled
from motionlake.motion.limbs import even_limbs
from motionlake.motion.skeleton import FEET, body_length

MOST_FRAMES: Final = 200_000  # at 30 a second; of more, pieces are drawn
QUANTILES: Final = (0.05, 0.5, 0.95)  # of the speeds of a class that metrics tell, metres a second


def build_database(clips: Sequence[MatchingClip], seed: int = 0, most: int = MOST_FRAMES) -> MotionDatabase:
    """The database of recorded clips.

    Args:
        clips: of known class.
        seed: draws pieces where there are more than `most` frames.
        most: frames.

    Raises:
        ValueError: no clip has frames enough.
    """
    found = [piece for clip in clips for piece in _pieces(clip)]
    order = np.random.default_rng(seed).permutation(len(found))
    total = np.cumsum([len(found[i].motion) for i in order])
    kept = [found[i] for i in sorted(order[: max(1, int(np.searchsorted(total, most, side="right")))].tolist())]
    if not kept:
        raise ValueError(f"no motion lasts {SHORTEST / FPS:g} s without a calibration pose")
    classes = sorted({piece.label for piece in kept})
    stops = np.cumsum([len(piece.motion) for piece in kept])
    rows = np.array(
        [
            (stop - len(piece.motion), stop, classes.index(piece.label), piece.start)
            for piece, stop in zip(kept, stops, strict=True)
        ]
    )
    motions = [piece.motion for piece in kept]
    size = float(np.mean([piece.size for piece in kept]))
    steps = [steps_of(motion) for motion in motions]
    database = MotionDatabase(
        classes, [piece.clip for piece in kept], rows.astype(np.int64), np.array([piece.fps for piece in kept]),
        np.zeros(len(kept)),
        _joined([m.rotations for m in motions]), _joined([m.hips for m in motions]),
        _joined([s[:, :2] for s in steps]), _joined([s[:, 2] for s in steps]),
        np.concatenate([m.stands for m in motions]), _joined([m.aloft for m in motions]),
        np.array([np.max([_flown(p.motion) for p in kept if p.label == name], axis=0) for name in classes]),
        _joined([features(m) for m in motions]),
        {"frames": int(stops[-1]), "pieces": len(kept), "classes": len(classes), "clips": len({p.clip for p in kept})},
    )  # fmt: skip
    speeds = {
        name: [round(float(size * v), 3) for v in np.quantile(database.speeds(i), QUANTILES)]
        if database.usual_speed(i)
        else None
        for i, name in enumerate(classes)
    }
    aside = {name: round(database.aside(i), 3) for i, name in enumerate(classes)}
    metrics = {**database.metrics, "speeds": speeds, "aside": aside}
    return replace(database, begins=costs_of_beginning(database), metrics=metrics)


@dataclass(frozen=True)
class _Piece:
    clip: str
    start: int
    label: str
    fps: float
    size: float
    motion: RootedMotion


def _pieces(clip: MatchingClip) -> list[_Piece]:
    """The stretches of a clip between calibration poses and jumps, on level ground."""
    found: list[_Piece] = []
    body = even_limbs(clip.positions, clip.rest_offsets)
    ranges = sound_ranges(clip.positions, clip.rotations, clip.fps)
    ground = ground_of(clip.positions[ranges[0][0] : ranges[-1][1]])
    positions, rotations = levelled(clip.positions, clip.rotations, ground, clip.positions[0, 0])
    for start, stop in ranges:
        if (stop - start - 1) / clip.fps * FPS + 1 < SHORTEST:
            continue
        motion = rooted(positions[start:stop], without_flips(rotations[start:stop]), body, clip.fps)
        found.append(_Piece(clip.clip, clip.start + start, clip.label, clip.fps, body_length(body), motion))
    return found


def _flown(motion: RootedMotion) -> Float64Array:
    return longest_flights(clearance(motion.joints[:, FEET]))


def _joined(rows: Sequence[Any]) -> Float32Array:
    return np.ascontiguousarray(np.concatenate(rows), dtype=np.float32)
