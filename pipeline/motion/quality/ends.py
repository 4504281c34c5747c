"""T-poses at the ends of clips, and seams: where a body jumps, or a motion starts again as it was."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array
from motionlake.motion.quality.faults import Fault, Found, Recording, runs
from motionlake.motion.quality_config import QualityConfig

LONGEST: Final = 5.0  # seconds of a T-pose that belongs to an end
JUMP: Final = 3.0  # times the steps of the frames around
AROUND: Final = 3  # frames
AGAIN: Final = 0.25  # seconds that must come again, and that lie between
GRAIN: Final = 4096  # of quaternions that are the same


def check_ends(recording: Recording, config: QualityConfig) -> Found:
    """Measures `tpose_start` and `tpose_end` (seconds) and `loop_seam` (metres, the largest jump of the body)."""
    tpose = _tposes(recording, config)
    most = recording.frames(LONGEST)
    found, seconds = [], {}
    for kind, mask in (("tpose_start", tpose), ("tpose_end", tpose[::-1])):
        first = len(mask) if mask.all() else int(np.argmin(mask))
        first = first if first <= most else 0
        seconds[kind] = first / recording.fps
        if first:
            start = 0 if kind == "tpose_start" else len(mask) - first
            found.append(Fault(kind=kind, start=start, stop=start + first, severity=seconds[kind]))
    edges = [fault.stop if fault.kind == "tpose_start" else fault.start for fault in found]
    seams = [s for s in (*_jumps(recording, config), *_again(recording)) if s.start + 1 not in edges]
    return Found({**seconds, "loop_seam": max((s.severity for s in seams), default=0.0)}, [*found, *seams])


def _direction(recording: Recording, start: str, stop: str) -> Float64Array:
    bone = recording.joint(stop) - recording.joint(start)
    unit: Float64Array = bone / np.maximum(np.linalg.norm(bone, axis=1, keepdims=True), 1e-9)
    return unit


def _tposes(recording: Recording, config: QualityConfig) -> BoolArray:
    """[F] whether arms are stretched sideways and legs downwards."""
    near = np.cos(np.radians(config.tpose_degrees))
    left, down = _direction(recording, "right_shoulder", "left_shoulder"), _direction(recording, "neck", "hips")
    fits = np.ones(len(recording), dtype=np.bool_)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for bone in (("shoulder", "elbow"), ("elbow", "wrist")):
            arm = _direction(recording, *(f"{side}_{part}" for part in bone))
            fits &= (sign * arm * left).sum(axis=1) > near
        fits &= (_direction(recording, f"{side}_hip", f"{side}_ankle") * down).sum(axis=1) > near
    return fits


def _jumps(recording: Recording, config: QualityConfig) -> list[Fault]:
    """The last frame before a jump and the first after it."""
    if len(recording) < 2 * AROUND + 2:
        return []
    steps = np.linalg.norm(np.diff(recording.positions, axis=0), axis=2)
    padded = np.pad(steps, ((AROUND, AROUND), (0, 0)), mode="reflect")
    shifted = [padded[AROUND + by : AROUND + by + len(steps)] for by in range(-AROUND, AROUND + 1) if by]
    usual = np.max(shifted, axis=0)
    mean, around = steps.mean(axis=1), np.max([each.mean(axis=1) for each in shifted], axis=0)
    jumped = (mean > JUMP * around) & (mean - around > config.seam) & ((steps > 2 * usual).mean(axis=1) > 0.5)
    return [
        Fault(kind="seam", start=start, stop=min(stop + 1, len(recording)), severity=float(mean[start:stop].max()))
        for start, stop in runs(jumped, 1)
    ]


def _again(recording: Recording) -> list[Fault]:
    """Where a motion starts again exactly as it was: no body can."""
    least = recording.frames(AGAIN, 4)
    if len(recording) < 2 * least:
        return []
    rows = np.ascontiguousarray(
        np.round(recording.rotations[:, 1:].reshape(len(recording), -1) * GRAIN).astype(np.int16)
    )
    keys = rows.view(np.dtype((np.void, rows.shape[1] * 2))).ravel()
    _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    apart = np.arange(len(recording)) - first[inverse]
    moving = np.zeros(len(recording), dtype=np.bool_)
    moving[1:] = (rows[1:] != rows[:-1]).any(axis=1)
    repeated = (apart >= least) & moving
    found = []
    for start, _ in runs(repeated, 1, least):
        step = np.linalg.norm(recording.positions[start] - recording.positions[start - 1], axis=1).mean()
        found.append(Fault(kind="seam", start=start - 1, stop=start + 1, severity=float(step)))
    return found
