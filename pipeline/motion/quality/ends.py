"""T-poses at the ends of clips, and seams: where a body jumps, or a motion starts again as it was."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.motion.calibration import LONGEST, jumps, run_of, tposes
from motionlake.motion.quality.faults import Fault, Found, Recording
from motionlake.motion.quality_config import QualityConfig
from motionlake.motion.runs import runs

AGAIN: Final = 0.25  # seconds that must come again, and that lie between
GRAIN: Final = 4096  # of quaternions that are the same


def check_ends(recording: Recording, config: QualityConfig) -> Found:
    """Measures `tpose_start` and `tpose_end` (seconds) and `loop_seam` (metres, the largest jump of the body)."""
    tpose = tposes(recording.positions, config.tpose_degrees)
    most = recording.frames(LONGEST)
    found, seconds = [], {}
    for kind, mask in (("tpose_start", tpose), ("tpose_end", tpose[::-1])):
        first = run_of(mask, most)
        seconds[kind] = first / recording.fps
        if first:
            start = 0 if kind == "tpose_start" else len(mask) - first
            found.append(Fault(kind=kind, start=start, stop=start + first, severity=seconds[kind]))
    edges = [fault.stop if fault.kind == "tpose_start" else fault.start for fault in found]
    seams = [s for s in (*_jumps(recording, config), *_again(recording)) if s.start + 1 not in edges]
    return Found({**seconds, "loop_seam": max((s.severity for s in seams), default=0.0)}, [*found, *seams])


def _jumps(recording: Recording, config: QualityConfig) -> list[Fault]:
    """The last frame before a jump and the first after it."""
    return [
        Fault(kind="seam", start=jump.start, stop=min(jump.stop + 1, len(recording)), severity=jump.metres)
        for jump in jumps(recording.positions, config.seam)
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
