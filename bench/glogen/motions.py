"""What the baselines of synthesis read: motions with their classes, and what of a motion is given and wanted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array
from numpy.typing import NDArray

Bones = tuple[tuple[int, int], ...]
Pasts = Sequence[Float32Array] | Float32Array
STOPS_A_WINDOW: Final = 8  # one window in an epoch for so many places that it can have


@dataclass(frozen=True)
class Motions:
    """n motions: body-relative joints, root at the origin, facing removed.

    Attributes:
        poses: of each [T, D] float32, D = 3 J: at 20 sparse poses (an array [n, 20, D] will do) or at a frame rate.
        classes: [n] int64 from 0.
        class_count: C, the length of the class prior; 0 leaves it out.
        groups: [n] who performs each, or the clip it is from: what validation holds out together.
        bones: pairs of joints (0 to J - 1) whose distance is a bone's length.
    """

    poses: Pasts
    classes: NDArray[np.int64]
    class_count: int
    groups: tuple[str, ...] = ()
    bones: Bones = ()

    def of(self, rows: NDArray[np.integer]) -> Motions:
        """Some of them."""
        groups = tuple(self.groups[i] for i in rows) if self.groups else ()
        return Motions([self.poses[i] for i in rows], self.classes[rows], self.class_count, groups, self.bones)


@dataclass(frozen=True)
class Task:
    """What is given and what is wanted.

    Attributes:
        past: P poses that a network is given; fewer are padded in front with the first of them.
        horizon: H poses wanted.
        least: poses that a motion to train on has at least before those wanted.
    """

    past: int
    horizon: int
    least: int


SPARSE_TASK: Final = Task(past=5, horizon=15, least=5)
"""5 of 20 sparse poses are given, 15 wanted (Tables 4.1 and 4.2)."""
DENSE_TASK: Final = Task(past=25, horizon=20, least=5)
"""Frames at 30 fps; 20 of them are 667 ms, beyond the 640 ms of Table 4.3."""


@dataclass(frozen=True)
class Windows:
    """Pieces of motions [n, P + H, D], with their classes [n]."""

    poses: Float32Array
    classes: NDArray[np.int64]


def padded(past: Float32Array, length: int) -> Float32Array:
    """The last `length` poses of a past [p, D]; the first is repeated where there are fewer."""
    kept = past[-length:]
    return np.concatenate([np.repeat(kept[:1], length - len(kept), axis=0), kept])


def pasts_of(pasts: Pasts, task: Task) -> Float32Array:
    """[m, P, D] of pasts [p, D] of any lengths (or of one, as an array [m, p, D]).

    Raises:
        ValueError: a past without poses.
    """
    if any(not len(past) for past in pasts):
        raise ValueError("a past without poses says nothing")
    return np.stack([padded(np.asarray(past, np.float32), task.past) for past in pasts])


def windows_of(data: Motions, task: Task, rng: np.random.Generator) -> Windows:
    """Windows drawn at random, at least one of a motion; so many an epoch has, in either task.

    Where the past of a window begins before the motion does, it is padded, as at prediction.

    Raises:
        ValueError: no motion, or one that is too short for the task.
    """
    poses, classes = [], []
    for motion, label in zip(data.poses, data.classes.tolist(), strict=True):
        last = len(motion) - task.horizon
        if last < task.least:
            raise ValueError(f"a motion of {len(motion)} poses is too short: {task.least + task.horizon} are needed")
        for stop in rng.integers(task.least, last + 1, max(1, (last + 1 - task.least) // STOPS_A_WINDOW)):
            past = padded(motion[:stop], task.past)
            poses.append(np.concatenate([past, motion[stop : stop + task.horizon]]))
            classes.append(label)
    if not poses:
        raise ValueError("no motions to train on")
    return Windows(np.stack(poses).astype(np.float32), np.array(classes, np.int64))


def joint_error(found: Float32Array, truth: Float32Array) -> float:
    """Mean Euclidean distance of joints between poses [..., 3 J] (mean per-joint error of section 4.3.3)."""
    apart = (np.asarray(found, np.float64) - truth).reshape(*found.shape[:-1], -1, 3)
    return float(np.linalg.norm(apart, axis=-1).mean())


def pose_error(found: Float32Array, truth: Float32Array) -> float:
    """Mean Euclidean distance between pose vectors [..., D] (section 4.3.3)."""
    return float(np.linalg.norm(np.asarray(found, np.float64) - truth, axis=-1).mean())


def hold_out(data: Motions, group: str | None = None) -> tuple[Motions, Motions]:
    """Motions to train on, and those of one group, held out (by default the last by name).

    Raises:
        ValueError: no such group, or no other.
    """
    known = sorted(set(data.groups))
    chosen = known[-1] if group is None and known else group
    if chosen not in known or len(known) < 2:
        raise ValueError(f"group {chosen!r} cannot be held out of {', '.join(known) or 'none'}")
    held = np.array([name == chosen for name in data.groups])
    return data.of(np.flatnonzero(~held)), data.of(np.flatnonzero(held))
