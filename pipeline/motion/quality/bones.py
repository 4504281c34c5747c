"""Joints that stop while the body moves, and limbs that change their length."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import BoolArray
from motionlake.motion.quality.faults import Fault, Found, Level, Recording, joint_name
from motionlake.motion.quality.levels import levels
from motionlake.motion.quality_config import QualityConfig
from motionlake.motion.runs import runs
from motionlake.motion.skeleton import INDEX, PARENTS

CHANGE: Final = 5e-5  # of a quaternion's numbers: less than a lake rounds them to
UNUSED: Final = 0.8  # share of a clip in which a joint that the rig does not measure stands still
LIMBS: Final = tuple(
    f"{side}_{part}" for side in ("left", "right") for part in ("elbow", "wrist", "knee", "ankle")
)  # each with the bone that ends there
TURNED: Final = tuple(f"{side}_{part}" for side in ("left", "right") for part in ("shoulder", "elbow", "hip", "knee"))
HINGES: Final = ("knee", "elbow")
STRAIGHT: Final = 0.985  # cosine between the bones of a hinge
STEADY: Final = 0.1  # seconds


def check_bones(recording: Recording, config: QualityConfig) -> Found:
    """Measures `frozen` (share of frames in which a joint that else moves stands still) and `limb_drift` (the largest
    relative deviation of a limb's length from its median, 99 % quantile over time)."""
    frozen, share = _frozen(recording, config)
    drifts, drifted, drift = _drifts(recording, config)
    return Found({"frozen": share, "limb_drift": drift}, [*frozen, *drifts], drifted)


def _frozen(recording: Recording, config: QualityConfig) -> tuple[list[Fault], float]:
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    window = recording.frames(config.frozen_seconds, 4)
    if len(recording) <= window:
        return [], 0.0
    joints = [INDEX[name] for name in TURNED if recording.measured[INDEX[name]]]
    turns = recording.rotations[:, joints]
    span = (maximum_filter1d(turns, window, axis=0) - minimum_filter1d(turns, window, axis=0)).max(axis=2)
    half = window // 2
    span[:half] = span[-half:] = np.inf  # windows that are not whole
    still = maximum_filter1d((span <= CHANGE).astype(np.uint8), window, axis=0, origin=-1 if window % 2 == 0 else 0) > 0
    used = still.mean(axis=0) < UNUSED
    body = still.all(axis=1)
    still &= ~stretched(recording, joints)
    found = [
        Fault(kind="frozen", start=start, stop=stop, severity=(stop - start) / recording.fps)
        for start, stop in runs(body)
    ]
    for column in np.flatnonzero(used):
        for start, stop in runs(still[:, column] & ~body, 0, window):
            name = joint_name(joints[column])
            seconds = (stop - start) / recording.fps
            found.append(Fault(kind="frozen", joint=name, start=start, stop=stop, severity=seconds))
    share = float((body | still[:, used].any(axis=1)).mean())
    return found, share


def stretched(recording: Recording, joints: list[int]) -> BoolArray:
    """[F, j] whether a knee or an elbow is straight: solvers hold hinges there where they would overstretch."""
    straight = np.zeros((len(recording), len(joints)), dtype=np.bool_)
    for column, joint in enumerate(joints):
        if joint_name(joint).split("_")[1] in HINGES:
            above = recording.positions[:, joint] - recording.positions[:, PARENTS[joint]]
            below = recording.positions[:, joint + 1] - recording.positions[:, joint]
            size = np.linalg.norm(above, axis=1) * np.linalg.norm(below, axis=1)
            straight[:, column] = (above * below).sum(axis=1) > STRAIGHT * np.maximum(size, 1e-9)
    return straight


def _drifts(recording: Recording, config: QualityConfig) -> tuple[list[Fault], list[Level], float]:
    from scipy.ndimage import uniform_filter1d

    limbs = [name for name in LIMBS if recording.measured[INDEX[name]]]
    if not limbs:
        return [], [], 0.0
    joints = [INDEX[name] for name in limbs]
    bones = recording.positions[:, joints] - recording.positions[:, [PARENTS[joint] for joint in joints]]
    lengths = np.linalg.norm(bones, axis=2)
    lengths = uniform_filter1d(lengths, recording.frames(STEADY), axis=0, mode="nearest")
    apart = np.abs(lengths / np.maximum(np.median(lengths, axis=0), 1e-3) - 1)
    least = recording.frames(STEADY)
    found = []
    for column, joint in enumerate(joints):
        for start, stop in runs(apart[:, column] > config.limb_drift, least, least):
            severity = float(apart[start:stop, column].max())
            found.append(Fault(kind="limb_drift", joint=joint_name(joint), start=start, stop=stop, severity=severity))
    drifted = levels("limb_drift", apart, [config.limb_drift] * len(limbs), limbs, least, least)
    return found, drifted, float(np.quantile(apart.max(axis=1), 0.99))
