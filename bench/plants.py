"""Faults planted in real recordings, each of a place and a severity drawn by seed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.kinematics import forward_kinematics
from motionlake.motion.quality import Recording
from motionlake.motion.quality.bones import stretched
from motionlake.motion.quality.faults import UPRIGHT
from motionlake.motion.quality.feet import Ground
from motionlake.motion.rotations import IDENTITY, conjugate, from_axis_angle, multiply, rotate
from motionlake.motion.skeleton import BONES, INDEX, PARENTS, chained, facing, mirrored_positions

LIMB_JOINTS: Final = tuple(
    f"{side}_{part}" for side in ("left", "right") for part in ("shoulder", "elbow", "hip", "knee")
)
EASE: Final = 0.1  # seconds
MOVES: Final = 3e-3  # of a quaternion's numbers, in the range where a joint is stopped


@dataclass(frozen=True)
class Subject:
    """A recording that faults are planted in; `rest_offsets` [21, 3] of its skeleton, metres."""

    name: str
    recording: Recording
    rest_offsets: Float64Array


@dataclass(frozen=True)
class Planted:
    """A recording with a fault in frames [start, stop)."""

    recording: Recording
    start: int
    stop: int


Plant = Callable[[Subject, np.random.Generator], Planted | None]


def _range(count: int, fps: float, low: float, high: float, random: np.random.Generator) -> tuple[int, int] | None:
    """Frames of `low` to `high` seconds that begin and end within a clip; None of one that is too short."""
    length = max(3, round(random.uniform(low, high) * fps))
    margin = max(2, round(0.1 * fps))
    if length + 2 * margin >= count:
        return None
    start = int(random.integers(margin, count - margin - length))
    return start, start + length


def _eased(count: int, start: int, stop: int, fps: float) -> Float64Array:
    """[F] 1 in a range, 0 outside, with smooth edges inside the range."""
    frames, edge = np.arange(count), max(1.0, EASE * fps)
    share = np.clip(np.minimum(frames - start + 1, stop - frames) / edge, 0, 1)
    eased: Float64Array = 0.5 - 0.5 * np.cos(np.pi * share)
    return eased


def _posed(subject: Subject, rotations: Float64Array) -> Recording:
    """The recording with other rotations: joints move as forward kinematics has it."""
    old = subject.recording
    moved = [forward_kinematics(old.positions[:, 0], each, subject.rest_offsets) for each in (rotations, old.rotations)]
    return replace(old, positions=old.positions + moved[0] - moved[1], rotations=rotations)


def slide(subject: Subject, random: np.random.Generator) -> Planted | None:
    old = subject.recording
    found = _range(len(old), old.fps, 1.0, 2.0, random)
    if found is None or old.lifted[slice(*found)].min() < 0.8:
        return None
    ground = Ground.of(old)
    if ground.above[slice(*found)].min(axis=1).max() > 0.03:
        return None  # in the air for a part of it
    start, stop = found
    speed, angle = random.uniform(0.25, 0.7), random.uniform(0, 2 * np.pi)
    way = np.clip(np.arange(len(old)) - start, 0, stop - start) * speed / old.fps
    shift = way[:, None] * np.array([np.cos(angle), 0, np.sin(angle)])
    return Planted(replace(old, positions=old.positions + shift[:, None]), start, stop)


def _raised(subject: Subject, random: np.random.Generator, low: float, high: float, sign: float) -> Planted | None:
    old = subject.recording
    found = _range(len(old), old.fps, 1.0, 2.5, random)
    standing = old.lifted > UPRIGHT
    if found is None or not standing[slice(*found)].all() or found[1] - found[0] > 0.4 * standing.sum():
        return None  # where most of a stand is sunk, the rest of it seems to float; who lies is soft
    if Ground.of(old).above[slice(*found)].min(axis=1).max() > 0.03:
        return None  # in the air for a part of it
    shift = sign * random.uniform(low, high) * _eased(len(old), *found, old.fps)
    return Planted(replace(old, positions=old.positions + shift[:, None, None] * np.array([0, 1, 0])), *found)


def penetration(subject: Subject, random: np.random.Generator) -> Planted | None:
    return _raised(subject, random, 0.08, 0.25, -1)


def floating(subject: Subject, random: np.random.Generator) -> Planted | None:
    return _raised(subject, random, 0.1, 0.3, 1)


def jitter(subject: Subject, random: np.random.Generator) -> Planted | None:
    old = subject.recording
    found = _range(len(old), old.fps, 0.8, 2.0, random)
    if found is None:
        return None
    noise = np.zeros(old.positions.shape)
    joint = int(random.integers(1, len(PARENTS)))
    chosen = [joint] if random.random() < 0.5 else list(range(len(PARENTS)))
    size = (found[1] - found[0], len(chosen), 3)
    noise[slice(*found), chosen] = random.normal(0, random.uniform(0.006, 0.015), size)
    return Planted(replace(old, positions=old.positions + noise), *found)


def spike(subject: Subject, random: np.random.Generator) -> Planted | None:
    old = subject.recording
    start = int(random.integers(4, max(5, len(old) - 8)))
    stop = start + int(random.integers(1, 3 if old.fps < 60 else 4))
    if stop + 4 > len(old):
        return None
    joint = INDEX[str(random.choice(LIMB_JOINTS))]
    axis = random.normal(size=3)
    bone = np.array(BONES[str(_name(joint))][1])
    axis -= (axis @ bone) * bone
    rotations = old.rotations.copy()
    turn = from_axis_angle(axis / np.linalg.norm(axis), random.uniform(45, 100))
    rotations[start:stop, joint] = multiply(rotations[start:stop, joint], turn)
    return Planted(_posed(subject, rotations), start, stop)


def _name(joint: int) -> str:
    return next(name for name, index in INDEX.items() if index == joint)


def flip(subject: Subject, random: np.random.Generator) -> Planted | None:
    """A limb turns about its own bone, so that no joint moves."""
    old = subject.recording
    found = _range(len(old), old.fps, 0.05, 0.5, random)
    if found is None or not old.twist:
        return None
    name = str(random.choice(LIMB_JOINTS))
    joint = INDEX[name]
    turn = from_axis_angle(np.array(BONES[name][1]), random.uniform(110, 180))
    rotations = old.rotations.copy()
    within = slice(*found)
    rotations[within, joint] = multiply(rotations[within, joint], turn)
    rotations[within, joint + 1] = multiply(conjugate(turn), rotations[within, joint + 1])
    return Planted(replace(old, rotations=rotations), *found)


def frozen(subject: Subject, random: np.random.Generator) -> Planted | None:
    """A joint, or the whole body, that moves else."""
    old = subject.recording
    found = _range(len(old), old.fps, 0.5, 1.5, random)
    if found is None:
        return None
    within = slice(*found)
    moving = np.ptp(old.rotations[within], axis=0).max(axis=1) > MOVES
    limbs = [INDEX[name] for name in LIMB_JOINTS]
    straight = np.any(stretched(old, limbs)[within], axis=0).tolist()  # solvers hold such hinges: no fault
    joints = [joint for joint, held in zip(limbs, straight, strict=True) if moving[joint] and not held]
    if not joints:
        return None
    rotations, positions = old.rotations.copy(), old.positions.copy()
    if random.random() < 0.3:
        rotations[within], positions[within] = rotations[found[0]], positions[found[0]]
        return Planted(replace(old, rotations=rotations, positions=positions), *found)
    joint = int(random.choice(joints))
    rotations[within, joint] = rotations[found[0], joint]
    return Planted(_posed(subject, rotations), *found)


def limb_drift(subject: Subject, random: np.random.Generator) -> Planted | None:
    old = subject.recording
    found = _range(len(old), old.fps, 0.5, 2.0, random)
    if found is None or found[1] - found[0] > len(old) / 3:
        return None
    joint = INDEX[str(random.choice(LIMB_JOINTS))] + 1
    bone = old.positions[:, joint] - old.positions[:, PARENTS[joint]]
    grown = random.choice([-1, 1]) * random.uniform(0.12, 0.35) * _eased(len(old), *found, old.fps)
    positions = old.positions.copy()
    for below in range(joint, len(PARENTS)):
        if below == joint or _hangs(below, joint):
            positions[:, below] += grown[:, None] * bone
    return Planted(replace(old, positions=positions), *found)


def _hangs(joint: int, above: int) -> bool:
    while joint > 0:
        joint = PARENTS[joint]
        if joint == above:
            return True
    return False


def _tpose(subject: Subject, random: np.random.Generator, at: int) -> tuple[Recording, int]:
    old = subject.recording
    count = int(random.integers(1, max(2, round(old.fps))))
    pose = chained(np.vstack([np.zeros((1, 3)), subject.rest_offsets[1:]]))
    pose = rotate(from_axis_angle(np.array([0.0, 1.0, 0.0]), np.degrees(facing(old.positions)[at])), pose)
    pose = pose + old.positions[at, 0]
    turns = np.tile(IDENTITY, (count, len(PARENTS), 1))
    first = at == 0
    positions, rotations = (
        np.concatenate([more, kept] if first else [kept, more])
        for more, kept in ((np.tile(pose, (count, 1, 1)), old.positions), (turns, old.rotations))
    )
    return replace(old, positions=positions, rotations=rotations), count


def tpose_start(subject: Subject, random: np.random.Generator) -> Planted | None:
    made, count = _tpose(subject, random, 0)
    return Planted(made, 0, count)


def tpose_end(subject: Subject, random: np.random.Generator) -> Planted | None:
    made, count = _tpose(subject, random, -1)
    return Planted(made, len(made) - count, len(made))


def fps(subject: Subject, random: np.random.Generator) -> Planted | None:
    old = subject.recording
    return Planted(replace(old, fps=old.fps * float(random.choice([0.25, 0.5, 2, 4]))), 0, len(old))


def unit(subject: Subject, random: np.random.Generator) -> Planted | None:
    old = subject.recording
    scale = float(random.choice([2.54, 1 / 2.54, 3.048, 1 / 3.048, 10, 0.1]))
    return Planted(replace(old, positions=old.positions * scale), 0, len(old))


def up(subject: Subject, random: np.random.Generator) -> Planted | None:
    old = subject.recording
    axis, angle = random.choice([0, 2]), random.choice([-90, 90, 180])
    turn = from_axis_angle(np.eye(3)[axis], float(angle))
    return Planted(replace(old, positions=rotate(turn, old.positions)), 0, len(old))


def swapped_sides(subject: Subject, random: np.random.Generator) -> Planted | None:
    """In all of the clip, or in a range of it."""
    old = subject.recording
    found = _range(len(old), old.fps, 1.0, 2.0, random)
    if random.random() < 0.5 or found is None:
        found = (0, len(old))
    positions = old.positions.copy()
    swapped = mirrored_positions(positions[slice(*found)]) * np.array([-1.0, 1.0, 1.0])  # not reflected, only exchanged
    positions[slice(*found)] = swapped
    return Planted(replace(old, positions=positions), *found)


def seam(subject: Subject, random: np.random.Generator) -> Planted | None:
    """A piece comes twice, or a piece was cut out."""
    old = subject.recording
    found = _range(len(old), old.fps, 0.7, 1.5, random)
    if found is None:
        return None
    start, stop = found
    frames = np.arange(len(old))
    if random.random() < 0.5:
        frames, place = np.concatenate([frames[:stop], frames[start:]]), stop
    else:
        frames, place = np.concatenate([frames[:start], frames[stop:]]), start
    made = replace(old, positions=old.positions[frames], rotations=old.rotations[frames])
    step = np.linalg.norm(made.positions[place] - made.positions[place - 1], axis=1).mean()
    if step < 0.03:
        return None  # the body hardly moves, so that nothing is seen
    return Planted(made, place - 1, place + 1)


PLANTS: Final[dict[str, Plant]] = {
    plant.__name__: plant
    for plant in (
        slide, penetration, floating, jitter, spike, flip, frozen, limb_drift, tpose_start, tpose_end, fps, unit, up,
        swapped_sides, seam,
    )
}  # fmt: skip
