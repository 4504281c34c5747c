"""Frame rate, length unit and up axis, against how people step, fall and stand."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.motion.quality.clock import evidence, judged
from motionlake.motion.quality.faults import Fault, Found, Recording
from motionlake.motion.quality_config import QualityConfig

UPRIGHT: Final = 45.0  # degrees


def check_scale(recording: Recording, config: QualityConfig) -> Found:
    """Measures `fps_doubt` (how many times too fast it plays; 1 where that is not known), `fps_known` (1 where enough
    tells whether the frame rate is right, else 0), `unit_doubt` (the body's height over that of a person, 1 where it is
    a person's) and `up_doubt` (degrees from upright that the body comes to at best: the 10 % quantile, since who lies
    down has stood before)."""
    rate = judged(evidence(recording))
    known = max(rate.odds, 1 / rate.odds) > config.fps_odds
    found = []
    if rate.odds > config.fps_odds:
        found.append(_whole(recording, "fps", rate.factor))
    height = recording.height
    if not config.shortest_body <= height <= config.tallest_body:
        found.append(_whole(recording, "unit", height))
    tilt = _tilt(recording)
    if tilt > UPRIGHT:
        found.append(_whole(recording, "up", tilt))
    fitting = min(max(height, config.shortest_body), config.tallest_body)
    measures = {
        "fps_doubt": rate.factor if known else 1.0, "fps_known": float(known), "unit_doubt": height / fitting,
        "up_doubt": tilt,
    }  # fmt: skip
    return Found(measures, found)


def _whole(recording: Recording, kind: str, severity: float) -> Fault:
    return Fault(kind=kind, start=0, stop=len(recording), severity=severity)


def _tilt(recording: Recording) -> float:
    body = recording.joint("head") - (recording.joint("left_ankle") + recording.joint("right_ankle")) / 2
    up = body[:, 1] / np.maximum(np.linalg.norm(body, axis=1), 1e-9)
    return float(np.degrees(np.quantile(np.arccos(np.clip(up, -1, 1)), 0.1)))
