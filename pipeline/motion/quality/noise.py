"""Noise from frame to frame, joints that leave their path for a moment, and joints that flip."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array
from motionlake.motion.quality.faults import Fault, Found, Level, Recording, joint_name
from motionlake.motion.quality.levels import levels
from motionlake.motion.quality_config import QualityConfig
from motionlake.motion.runs import runs
from motionlake.motion.skeleton import INDEX, JOINTS, PARENTS

# Fourth differences of white noise of standard deviation 1 have sqrt(70), second ones sqrt(6); the median length of
# three such numbers is 1.538.
FOURTH: Final = 1.538 * 70**0.5
SECOND: Final = 1.538 * 6**0.5
ROUGH: Final = 1.7  # fourth differences over second ones; 3.4 of noise, less than 1 of motion below a sixth of the rate
WINDOW: Final = 0.4  # seconds
QUICK: Final = 3.0  # metres a square second
LONGEST: Final = 0.06  # seconds of a spike, to either side
FLICK: Final = 3.0  # times what others may: toes are light, and solvers bend them by few markers
FARTHEST: Final = 0.1  # metres that acceleration explains at most: over longer times it ebbs
SHARP: Final = 4.0  # times what the frames around show
ALIKE: Final = 0.9
AROUND: Final = 0.25  # seconds
_TOES: Final = [INDEX["left_toe"], INDEX["right_toe"]]


def check_noise(recording: Recording, config: QualityConfig) -> Found:
    """Measures `jitter` (metres, the worst joint's noise, median over time), `spikes` and `flips` (how many), of joints
    that the recording holds."""
    jitters, trembling, jitter = _jitters(recording, config)
    spikes, leaps, sudden = _spikes(recording, config)
    flips = _flips(recording, config, sudden)
    measures = {"jitter": jitter, "spikes": float(len(spikes)), "flips": float(len(flips))}
    return Found(measures, [*jitters, *spikes, *flips], [*trembling, *leaps])


def _jitters(recording: Recording, config: QualityConfig) -> tuple[list[Fault], list[Level], float]:
    if len(recording) < 8:
        return [], [], 0.0
    window = recording.frames(WINDOW, 5)
    least = recording.frames(config.jitter_seconds, 2)
    size = np.linalg.norm(np.diff(recording.positions, 4, axis=0), axis=2)
    bends = np.linalg.norm(np.diff(recording.positions, 2, axis=0)[1:-1], axis=2)
    fourth, second = (_running_median(each, window) for each in (size, bends))
    noise = np.pad(fourth / FOURTH, ((2, 2), (0, 0)), mode="edge") * recording.measured
    rough = np.pad(fourth > ROUGH * second, ((2, 2), (0, 0)), mode="edge")
    # Of a low rate, what is left of quick steps after four differences looks like noise.
    threshold = config.jitter + QUICK / recording.fps**2
    loud = (noise > threshold) & rough
    worst = np.where(rough, noise, 0.0).max(axis=1)
    found = []
    for start, stop in runs(np.any(loud, axis=1), window // 2, least):
        joint = int(noise[start:stop].mean(axis=0).argmax())
        severity = float(np.median(worst[start:stop]))
        found.append(Fault(kind="jitter", joint=joint_name(joint), start=start, stop=stop, severity=severity))
    trembling = levels("jitter", np.where(rough, noise, 0.0), [threshold] * noise.shape[1], JOINTS, window // 2, least)
    return found, trembling, float(np.median(worst))


def _running_median(values: Float64Array, window: int) -> Float64Array:
    """[F, ...] the median around each frame, taken four times a window."""
    if len(values) <= window:
        return np.broadcast_to(np.median(values, axis=0), values.shape)
    hop = max(1, window // 4)
    medians = np.median(np.lib.stride_tricks.sliding_window_view(values, window, axis=0)[::hop], axis=-1)
    nearest = np.clip(np.round((np.arange(len(values)) - window / 2) / hop), 0, len(medians) - 1)
    around: Float64Array = medians[nearest.astype(np.int64)]
    return around


def _spikes(recording: Recording, config: QualityConfig) -> tuple[list[Fault], list[Level], BoolArray]:
    """The faults, how far above the threshold, and [F] where there is one."""
    frames = len(recording)
    places = recording.positions.copy()
    places[:, 1:] -= places[:, :1]
    reach = max(1, int(LONGEST * recording.fps))
    away, beyond = np.zeros(places.shape[:2]), np.zeros(places.shape[:2])
    allowed = np.full(places.shape[1], config.spike)
    allowed[_TOES] *= FLICK
    for step in range(1, reach + 1):
        if frames <= 2 * step:
            break
        apart = np.linalg.norm(places[step:-step] - (places[2 * step :] + places[: -2 * step]) / 2, axis=2)
        explained = min(config.acceleration * (step / recording.fps) ** 2 / 2, FARTHEST)
        sharp = apart > SHARP * _usual(apart, recording)
        excess = np.where(sharp & (apart > allowed + explained) & recording.measured, apart, 0.0)
        away[step:-step] = np.maximum(away[step:-step], excess)
        beyond[step:-step] = np.maximum(beyond[step:-step], np.where(excess > 0, apart - explained, 0.0))
    sudden: BoolArray = np.any(away > 0, axis=1)
    found = []
    for start, stop in runs(sudden, reach):
        moved = away[start:stop].max(axis=0)
        joint = _highest(moved)
        found.append(Fault(kind="spike", joint=joint_name(joint), start=start, stop=stop, severity=float(moved.max())))
    return found, levels("spike", beyond, allowed.tolist(), JOINTS, reach, 1), sudden


def _usual(apart: Float64Array, recording: Recording) -> Float64Array:
    """[F, 21] what is usual around each frame of [F, 21]: the square of the mean root."""
    from scipy.ndimage import uniform_filter1d

    wide = recording.frames(AROUND, 4)
    root = np.sqrt(apart)  # so that the spike itself hardly counts
    usual: Float64Array = np.square(uniform_filter1d(root, 2 * wide + 1, axis=0, mode="nearest"))
    return usual


def _highest(moved: Float64Array) -> int:
    """The joint at which it starts: of those that moved far, the one nearest to the root."""
    far = moved > 0.3 * moved.max()
    return next(joint for joint in range(len(moved)) if far[joint] and not (PARENTS[joint] > 0 and far[PARENTS[joint]]))


def _flips(recording: Recording, config: QualityConfig, sudden: BoolArray) -> list[Fault]:
    if not recording.twist or len(recording) < 3:
        return []
    dots = np.abs((recording.rotations[1:] * recording.rotations[:-1]).sum(axis=2))
    turned = np.degrees(2 * np.arccos(np.clip(dots, 0, 1))) * recording.measured
    before, after = np.roll(turned, 2, axis=0), np.roll(turned, -2, axis=0)
    before[:2], after[-2:] = turned[2:4].min(initial=0), turned[-4:-2].min(initial=0)
    flipped = (turned > config.flip) & (turned > SHARP * np.minimum(before, after))
    flipped &= ~(sudden[1:] | sudden[:-1])[:, None]
    found = []
    for start, stop in runs(np.any(flipped, axis=1), 1):
        most = turned[start:stop].max(axis=0)
        joint = int(np.argmax(most > ALIKE * most.max()))  # the joint below turns back as far
        severity = float(most[joint])
        found.append(Fault(kind="flip", joint=joint_name(joint), start=start, stop=stop + 1, severity=severity))
    return found
