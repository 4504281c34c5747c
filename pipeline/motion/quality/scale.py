"""Frame rate, length unit and up axis, against how people step, fall and stand."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.quality.faults import Fault, Recording, runs, velocity
from motionlake.motion.quality.feet import GRAVITY, Ground
from motionlake.motion.quality_config import QualityConfig

# Metres a step over steps a minute, of a leg of 0.85 m: what people keep while they walk slowly or fast.
WALK_RATIO: Final = 0.0065
LEG: Final = 0.85
STEPS: Final = 3  # in a row, that differ little
STRIDE: Final = 0.25  # of a leg between the ankles, fore and aft, and travelled in a step
STRAIGHT: Final = 0.95  # distance over way of steps that go one way
EVEN: Final = 0.5  # by which steps of a walk differ
OFF: Final = 0.08  # metres above the ground of both feet in flight
LEAST: Final = 6  # frames of a flight
FASTEST: Final = 16.0  # metres a second of a joint beside the hips
UPRIGHT: Final = 45.0  # degrees


def check_scale(recording: Recording, config: QualityConfig) -> tuple[dict[str, float], list[Fault]]:
    """Measures `fps_doubt` (how many times too fast it plays; 1 where nothing tells), `unit_doubt` (the body's height
    over that of a person, 1 where it is a person's) and `up_doubt` (degrees from upright that the body comes to at
    best: the 10 % quantile, since who lies down has stood before)."""
    factor = time_factor(recording)
    found = []
    if max(factor, 1 / factor) > config.time_factor:
        found.append(_whole(recording, "fps", factor))
    height = recording.height
    if not config.shortest_body <= height <= config.tallest_body:
        found.append(_whole(recording, "unit", height))
    tilt = _tilt(recording)
    if tilt > UPRIGHT:
        found.append(_whole(recording, "up", tilt))
    fitting = min(max(height, config.shortest_body), config.tallest_body)
    return {"fps_doubt": factor, "unit_doubt": height / fitting, "up_doubt": tilt}, found


def _whole(recording: Recording, kind: str, severity: float) -> Fault:
    return Fault(kind=kind, start=0, stop=len(recording), severity=severity)


def _tilt(recording: Recording) -> float:
    body = recording.joint("head") - (recording.joint("left_ankle") + recording.joint("right_ankle")) / 2
    up = body[:, 1] / np.maximum(np.linalg.norm(body, axis=1), 1e-9)
    return float(np.degrees(np.quantile(np.arccos(np.clip(up, -1, 1)), 0.1)))


def time_factor(recording: Recording) -> float:
    """How many times too fast a clip plays, by its falls, its steps and its fastest joint; 1 where none tells."""
    found = falls(recording) or steps(recording)
    if found:
        return float(np.median(found))
    places = recording.positions - recording.positions[:, :1]
    speed = np.quantile(np.linalg.norm(velocity(places, recording.fps, 0.03), axis=2).max(axis=1), 0.99)
    return max(1.0, float(speed) / FASTEST)


def falls(recording: Recording) -> list[float]:
    """How many times too fast each flight goes, by the acceleration of the hips."""
    clear = Ground.of(recording).above.min(axis=1)
    factors = []
    for start, stop in runs(clear > OFF, 0, LEAST):
        height = recording.positions[start:stop, 0, 1]
        time = np.arange(stop - start) / recording.fps
        curve = np.polyfit(time, height, 2)
        miss = height - np.polyval(curve, time)
        if curve[0] < 0 and np.ptp(height) > 0.05 and np.std(miss) < 0.08 * np.ptp(height):
            factors.append(float(np.sqrt(-2 * curve[0] / GRAVITY)))
    return factors


def steps(recording: Recording) -> list[float]:
    """How many times too fast a walk goes, by the length of its steps and how many there are; nothing where none is."""
    left = recording.joint("left_hip") - recording.joint("right_hip")
    front = np.cross(left, [0.0, 1.0, 0.0])
    front /= np.maximum(np.linalg.norm(front, axis=1, keepdims=True), 1e-9)
    apart: Float64Array = ((recording.joint("left_ankle") - recording.joint("right_ankle")) * front).sum(axis=1)
    turns: list[int] = []
    wide = STRIDE * recording.leg
    for start, stop in sorted([*runs(apart > wide), *runs(apart < -wide)]):
        peak = start + int(np.abs(apart[start:stop]).argmax())
        if turns and apart[turns[-1]] * apart[peak] > 0:
            if abs(apart[peak]) > abs(apart[turns[-1]]):
                turns[-1] = peak
        else:
            turns.append(peak)
    root = recording.positions[:, 0][:, [0, 2]]
    best: list[float] = []
    for first in range(len(turns) - STEPS):
        at = np.array(turns[first : first + STEPS + 1])
        lengths, counts = np.linalg.norm(np.diff(root[at], axis=0), axis=1), np.diff(at)
        straight = np.linalg.norm(root[at[-1]] - root[at[0]]) > STRAIGHT * lengths.sum()
        even = np.ptp(counts) < EVEN * counts.mean() and np.ptp(lengths) < EVEN * lengths.mean()
        if straight and even and lengths.min() > 2 * STRIDE * recording.leg:
            cadence = 60 * recording.fps / counts.mean()
            best.append(float(WALK_RATIO * (recording.leg / LEG) * cadence / lengths.mean()))
    return [float(np.median(best))] if best else []
