"""Recorded motion between given poses: of the wanted classes, the frames that lead from each to the next.

A run of recorded frames is looked for that begins like one pose, ends like the next, and in between gets as far and
turns as much as they are apart; of the best for each pair those are taken whose joints go on where they meet (Viterbi).
`motion.keyframes` bends them onto the poses. Where no run is long enough, motion matching leads along the straight way
to the next pose first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array, Int64Array
from motionlake.matching.assembly import read_poses
from motionlake.matching.database import MotionDatabase
from motionlake.matching.recordings import FPS, about_y
from motionlake.motion.keyframes import KeyPoses, Stretch
from motionlake.motion.kinematics import forward_kinematics
from motionlake.motion.resampling import interpolated
from motionlake.motion.rotations import from_vectors, multiply, turn_about_y, turn_on_ground
from motionlake.motion.skeleton import body_length, facing, mirrored_positions

RATES: Final = (1.0, 0.9, 1.1, 0.8, 1.25)  # at which recorded frames are played, to keep time
KEPT: Final = 32  # runs of every pair of poses that are compared with those beside them
SHORTEST: Final = 3  # frames: over fewer, poses are interpolated
LONGEST: Final = 90  # frames of one run
# Up to so many frames poses are interpolated where no run is nearer to them, at both ends together, than they are to
# one another and half their way; over more, interpolated bodies seem to float from pose to pose.
MORPHED: Final = 15
HALF: Final = 0.5
LAST: Final = 0.2  # body lengths that a frame costs to begin with, after which little is recorded
# What counts how much, beside the mean distance of joints at both ends, body lengths.
WAY: Final = 0.5  # a body length by which a run gets elsewhere
TURN: Final = 0.2  # a radian by which it turns otherwise
PACE: Final = 0.1  # a rate other than the recorded one, times its logarithm
GOING: Final = 0.05  # a body length a second by which joints go otherwise where two runs meet
CHANCE: Final = 0.02  # body lengths: about how far costs are drawn apart at temperature 1


@dataclass(frozen=True)
class Run:
    """Recorded frames from `row` on, `frames` of them at a rate, that lead from a pose to the next."""

    row: int
    frames: float
    mirrored: bool


class Inbetweens:
    """The frames of some classes as they are looked at, by one body.

    Args:
        database: recorded frames.
        targets: classes that are taken from.
        rest_offsets: [21, 3] of the body.
    """

    def __init__(self, database: MotionDatabase, targets: Sequence[int], rest_offsets: Float64Array) -> None:
        self._data, self._size = database, body_length(rest_offsets)
        self._offsets = rest_offsets / self._size
        pieces = [i for i, piece in enumerate(database.pieces) if int(piece[2]) in targets]
        found = [self._read(i) for i in pieces]
        joints, place, heading, yaw, rows, left = (np.concatenate([one[i] for one in found]) for i in range(6))
        other = mirrored_positions(joints)
        flipped = place * np.array([-1.0, 1.0])
        self._joints = np.concatenate([joints, other])  # [n, 21, 3] from the ground under the hips, facing ahead
        self._place = np.concatenate([place, flipped])  # [n, 2] of the hips within a piece
        self._heading = np.concatenate([heading, -heading])
        self._yaw = np.concatenate([yaw, -yaw])  # of the root
        self._rows, self._left = np.tile(rows, 2), np.tile(left, 2)
        self._count = len(rows)
        self._going = self._velocities()

    def _read(self, piece: int) -> tuple[Float64Array | Int64Array, ...]:
        start, stop = (int(v) for v in self._data.pieces[piece, :2])
        rotations = self._data.rotations[start:stop].astype(float)
        joints = forward_kinematics(self._data.hips[start:stop].astype(float), rotations, self._offsets)
        yaw = np.concatenate([[0.0], np.cumsum(self._data.turns[start : stop - 1])]) / FPS
        steps = self._data.steps[start : stop - 1]
        ways = np.stack(turn_on_ground(steps[:, 0], steps[:, 1], yaw[:-1]), axis=1) / FPS
        root = np.concatenate([np.zeros((1, 2)), np.cumsum(ways, axis=0)])
        x, z = turn_on_ground(joints[:, 0, 0], joints[:, 0, 2], yaw)
        rows = np.arange(start, stop)
        return seen(joints), root + np.stack([x, z], axis=1), yaw + facing(joints), yaw, rows, stop - 1 - rows

    def _velocities(self) -> Float64Array:
        """[n, 21, 3] of joints seen from the body, body lengths a second, towards the next frame."""
        steps = np.diff(self._joints, axis=0, append=self._joints[-1:]) * FPS
        steps[self._left == 0] = steps[np.maximum(np.flatnonzero(self._left == 0) - 1, 0)]
        return steps

    def runs(self, keys: KeyPoses, rng: np.random.Generator, temperature: float = 0.0) -> list[Run | None]:
        """What leads from each pose to the next; None where nothing recorded is long enough, or no time is between."""
        layers = self._layers(keys, rng, temperature)
        return [None if one is None else self._run(*one) for one in self._cheapest(layers)]

    def likeness(self, keys: KeyPoses) -> float:
        """How far the best run from the first pose to the next is from leading there, body lengths."""
        return min((cost for _, _, cost in self._layers(keys, np.random.default_rng(0), 0.0)[0]), default=np.inf)

    def nearest(self, keys: KeyPoses) -> tuple[int, bool, float]:
        """The recorded frame most like the first pose, whether mirrored, and how the root heads there, radians."""
        world, apart = self._compared(keys)
        best = int((apart[0] + LAST * (self._left < LONGEST / 3)).argmin())
        heading = float(facing(world)[0]) - float(self._heading[best] - self._yaw[best])
        return int(self._rows[best]), best >= self._count, heading

    def _compared(self, keys: KeyPoses) -> tuple[Float64Array, list[Float64Array]]:
        """The poses in body lengths [K, 21, 3], and how far every frame [n] is from each."""
        world = forward_kinematics(keys.hips, keys.rotations, self._offsets * self._size) / self._size
        apart = [np.linalg.norm(self._joints - pose, axis=-1).mean(axis=-1) for pose in seen(world)]
        if keys.speeds is not None:
            for side in (0, -1):
                going = self._key_going(keys, side)
                apart[side] = apart[side] + GOING * np.linalg.norm(self._going - going, axis=-1).mean(axis=-1)
        return world, apart

    def _key_going(self, keys: KeyPoses, side: int) -> Float64Array:
        """[21, 3] how fast joints go in the first or the last pose, as `_velocities`."""
        assert keys.speeds is not None, "speeds are known"
        hips, turning = keys.speeds[side, 0] / FPS, keys.speeds[side, 1:] / FPS
        both = np.stack([keys.rotations[side], multiply(from_vectors(turning), keys.rotations[side])])
        joints = forward_kinematics(
            np.stack([keys.hips[side], keys.hips[side] + hips]), both, self._offsets * self._size
        )
        one, other = seen(joints / self._size)
        return np.asarray((other - one) * FPS)

    def _layers(
        self, keys: KeyPoses, rng: np.random.Generator, temperature: float
    ) -> list[list[tuple[int, float, float]]]:
        world, apart = self._compared(keys)
        heading, poses = facing(world), seen(world)
        times = np.asarray(keys.frames * (FPS / keys.fps), dtype=np.float64)
        return [
            self._candidates(i, times[i : i + 2], apart, poses, world[:, 0], heading, rng, temperature)
            for i in range(len(poses) - 1)
        ]

    def _candidates(
        self, index: int, frames: Float64Array, apart: Sequence[Float64Array], poses: Float64Array,
        hips: Float64Array, heading: Float64Array, rng: np.random.Generator, temperature: float,
    ) -> list[tuple[int, float, float]]:  # fmt: skip
        """Rows (here), frames and costs of the best runs between two poses."""
        gap = float(frames[1] - frames[0])
        if not SHORTEST <= gap <= LONGEST:
            return []
        way = hips[index + 1, [0, 2]] - hips[index, [0, 2]]
        turn = heading[index + 1] - heading[index]
        wanted = np.stack(turn_on_ground(way[0], way[1], -heading[index]))
        unlike = float(np.linalg.norm(poses[index + 1] - poses[index], axis=-1).mean() + HALF * np.hypot(*way))
        found: list[tuple[int, float, float]] = []
        for rate in RATES:
            frames_taken = gap * rate
            reach = round(frames_taken)
            begins = np.flatnonzero(self._left >= max(reach, SHORTEST))
            if not len(begins):
                continue
            ends = begins + reach
            gone = self._place[ends] - self._place[begins]
            x, z = turn_on_ground(gone[:, 0], gone[:, 1], -self._heading[begins])
            turned = np.angle(np.exp(1j * (self._heading[ends] - self._heading[begins] - turn)))
            costs = (
                apart[index][begins] + apart[index + 1][ends] + TURN * np.abs(turned) + PACE * abs(np.log(rate))
                + WAY * np.hypot(x - wanted[0], z - wanted[1])
            )  # fmt: skip
            if gap <= MORPHED and costs.min() > unlike:
                continue
            if temperature:
                costs = costs + temperature * CHANCE * rng.gumbel(size=len(costs))
            best = np.argpartition(costs, min(KEPT, len(costs) - 1))[:KEPT]
            found += [(int(begins[i]), frames_taken, float(costs[i])) for i in best]
        return sorted(found, key=lambda one: one[2])[:KEPT]

    def _cheapest(self, layers: Sequence[list[tuple[int, float, float]]]) -> list[tuple[int, float] | None]:
        """One of every layer, by their costs and by how joints go otherwise where they meet; None of an empty one."""
        costs: list[Float64Array] = []
        backs: list[Int64Array] = []
        for i, layer in enumerate(layers):
            own = np.array([cost for _, _, cost in layer])
            back = np.zeros(len(layer), dtype=np.int64)
            before = layers[i - 1] if i else []
            if layer and before:
                ends = self._going[[row + round(frames) for row, frames, _ in before]]
                starts = self._going[[row for row, _, _ in layer]]
                meeting = np.linalg.norm(starts[:, None] - ends[None], axis=-1).mean(axis=-1)
                through = costs[-1][None] + GOING * meeting
                back = through.argmin(axis=1)
                own = own + through.min(axis=1)
            elif layer and costs and len(costs[-1]):
                own = own + costs[-1].min()
            costs.append(own)
            backs.append(back)
        chosen: list[tuple[int, float] | None] = []
        at: int | None = None
        for i in range(len(layers) - 1, -1, -1):
            if not layers[i]:
                at = None
                chosen.append(None)
                continue
            at = int(costs[i].argmin()) if at is None else at
            row, frames, _ = layers[i][at]
            chosen.append((row, frames))
            at = int(backs[i][at]) if i and layers[i - 1] else None
        return chosen[::-1]

    def _run(self, row: int, frames: float) -> Run:
        return Run(int(self._rows[row]), frames, row >= self._count)

    def stretch(self, run: Run, keys: KeyPoses, index: int) -> tuple[Stretch, BoolArray]:
        """The frames of a run, put where the poses are; and [n + 1, 2] whether the feet stand."""
        count = int(keys.frames[index + 1] - keys.frames[index])
        off = np.linspace(0, run.frames, count + 1)
        first = int(np.searchsorted(self._rows[: self._count], run.row)) + run.mirrored * self._count
        own = slice(first, first + int(self._left[first]) + 1)
        off = np.minimum(off, self._left[first])
        poses = read_poses(self._data, run.row + off, run.mirrored)
        course = np.concatenate([self._place[own], self._yaw[own, None]], axis=1)
        x, z, yaw = interpolated(course, off).T
        rotations = poses.rotations.copy()
        rotations[:, 0] = multiply(about_y(yaw), rotations[:, 0])
        hips = np.stack([x, poses.hips[:, 1], z], axis=1) * self._size
        return _placed(Stretch(hips, rotations), keys, index, self._offsets), feet(poses.stands)


def feet(stands: BoolArray) -> BoolArray:
    """[T, 2] whether the left and the right foot stands, of joints of the feet [T, 4]."""
    return np.asarray(stands.reshape(len(stands), 2, 2).any(axis=2))


def _placed(stretch: Stretch, keys: KeyPoses, index: int, offsets: Float64Array) -> Stretch:
    """A stretch turned and moved so that both its ends are as near to the poses as one move brings them."""
    ends = [
        facing(forward_kinematics(np.zeros((2, 3)), rotations, offsets))
        for rotations in (stretch.rotations[[0, -1]], keys.rotations[index : index + 2])
    ]
    apart = np.exp(1j * (ends[1] - ends[0]))
    turn = float(np.angle(apart.sum()))
    rotations = stretch.rotations.copy()
    rotations[:, 0] = multiply(about_y(np.array(turn)), rotations[:, 0])
    hips = turn_about_y(stretch.hips, turn)
    moved = (keys.hips[index : index + 2] - hips[[0, -1]]).mean(axis=0) * np.array([1.0, 0.0, 1.0])
    return Stretch(hips + moved, rotations)


def seen(joints: Float64Array) -> Float64Array:
    """[T, 21, 3] joints from the ground under the hips, as bodies see them that face ahead."""
    from_hips = joints - joints[:, :1] * np.array([1.0, 0.0, 1.0])
    x, z = turn_on_ground(from_hips[..., 0], from_hips[..., 2], -facing(joints)[:, None])
    return np.stack([x, from_hips[..., 1], z], axis=-1)
