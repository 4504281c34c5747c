"""Poses of a rig: those of a walk placed on the ground and blended, and how far joints move from frame to frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array, Int64Array
from motionlake.deep_motifs.motion_graph.graph import WalkPiece
from motionlake.errors import ClipError
from motionlake.motion.clip import POSITION_CHANNELS, QUATERNION_CHANNELS, ChannelKind, Hierarchy, SourceClip
from motionlake.motion.kinematics import solve
from motionlake.motion.resampling import samples
from motionlake.motion.rotations import IDENTITY, angle, from_axis_angle, multiply, rotate, slerp

_AXES: Final = "xyz"


@dataclass(frozen=True)
class RigPoses:
    """F poses of a rig of J joints, in its own axes and units.

    Attributes:
        hierarchy: the rig; its channels are positions, then a quaternion, for each joint.
        root: [F, 3].
        shifts: [F, m] the position channels of the other joints.
        rotations: [F, J, 4] relative to the parent.
        fps: frames a second.
        metres_per_unit: length unit.
        up: up axis of the rig: x, y, z, -x, -y or -z.
    """

    hierarchy: Hierarchy
    root: Float64Array
    shifts: Float64Array
    rotations: Float64Array
    fps: float
    metres_per_unit: float
    up: str

    def __len__(self) -> int:
        return len(self.root)

    def cut(self, start: int, stop: int) -> RigPoses:
        """Frames [start, stop)."""
        return self.at(slice(start, stop))

    def at(self, rows: slice | Int64Array) -> RigPoses:
        """Some of the poses."""
        return replace(self, root=self.root[rows], shifts=self.shifts[rows], rotations=self.rotations[rows])

    def clip(self) -> SourceClip:
        """As a clip whose channels are quaternions."""
        moving = _moving(self.hierarchy)
        channels = np.empty((len(self), len(moving)))
        channels[:, moving] = np.column_stack([self.root, self.shifts])
        channels[:, ~moving] = self.rotations.reshape(len(self), -1)
        return SourceClip(self.hierarchy, channels, self.fps, metres_per_unit=self.metres_per_unit)

    def positions(self) -> Float64Array:
        """[F, J, 3] joints in the world, metres."""
        return solve(self.clip()).positions * self.metres_per_unit


def can_pose(kind: str, root: Sequence[str]) -> bool:
    """Whether a rig of channels of some kind, `root` those of its root, has rotations and a position of the root."""
    return kind != ChannelKind.POSITIONS.value and tuple(root[:3]) == POSITION_CHANNELS


def poses_of(clip: SourceClip, up: str, metres_per_unit: float) -> RigPoses:
    """The poses of a clip.

    Raises:
        ClipError: the clip has positions instead of rotations, or its root has no position.
    """
    hierarchy, local = clip.hierarchy, solve(clip).local
    if not can_pose(hierarchy.kind.value, hierarchy.channels[0]) or local is None:
        raise ClipError("a rig without rotations, or without a position of the root, cannot be posed")
    positions = clip.channels[:, _moving(hierarchy)]
    plain = replace(
        hierarchy,
        channels=tuple(
            (*(n for n in joint if n in POSITION_CHANNELS), *QUATERNION_CHANNELS) for joint in hierarchy.channels
        ),
        kind=ChannelKind.QUATERNION,
        axes=np.tile(IDENTITY, (len(hierarchy.joints), 1)),
        fixed_axes=False,
    )
    return RigPoses(plain, positions[:, :3], positions[:, 3:], local, clip.fps, metres_per_unit, up)


def _moving(hierarchy: Hierarchy) -> BoolArray:
    """[C] which channels are positions; the root's come first."""
    return np.isin([name for joint in hierarchy.channels for name in joint], POSITION_CHANNELS)


def resampled(poses: RigPoses, fps: float) -> RigPoses:
    """The poses at the instants k / fps up to the last; the same where the rate is."""
    if poses.fps == fps:
        return poses
    below, above, weight = samples(len(poses), poses.fps, fps)
    return replace(mixture(poses.at(below), poses.at(above), weight), fps=fps)


@dataclass(frozen=True)
class Placement:
    """A turn about the vertical by `degrees`, then a shift along the ground, in the rig's axes and units."""

    degrees: float
    shift: tuple[float, float, float]

    def after(self, first: Placement, up: str) -> Placement:
        """One placement that does `first`, then this one."""
        moved = rotate(_turn(up, self.degrees), np.array(first.shift)) + np.array(self.shift)
        x, y, z = moved.tolist()
        return Placement((self.degrees + first.degrees + 180.0) % 360.0 - 180.0, (x, y, z))


STAY: Final = Placement(0.0, (0.0, 0.0, 0.0))


def placed(poses: RigPoses, placement: Placement) -> RigPoses:
    """The poses somewhere else on the ground."""
    if placement == STAY:
        return poses
    turn = _turn(poses.up, placement.degrees)
    rotations = poses.rotations.copy()
    rotations[:, 0] = multiply(turn, np.ascontiguousarray(poses.rotations[:, 0]))
    return replace(poses, root=rotate(turn, poses.root) + np.array(placement.shift), rotations=rotations)


def alignment(to: RigPoses, window: RigPoses) -> Placement:
    """Where to place `window` so that its joints come closest to those of `to`, frame by frame.

    Joints weigh as much as the bone that leads to them is long, the root as much as the mean.
    """
    weights = np.linalg.norm(to.hierarchy.offsets, axis=1)
    weights[0] = weights[1:].mean() if len(weights) > 1 else 1.0
    weights = weights / (weights.sum() * len(to))
    up, first, second = _frame(to.up)
    a, b = to.positions(), window.positions()
    a, b = (np.stack([p @ first, p @ second], axis=-1) for p in (a, b))
    middle_a, middle_b = (np.einsum("fjc,j->c", p, weights) for p in (a, b))
    a, b = a - middle_a, b - middle_b
    along = np.einsum("fjc,fjc,j->", a, b, weights)
    across = np.einsum("fj,fj,j->", a[..., 1], b[..., 0], weights) - np.einsum(
        "fj,fj,j->", a[..., 0], b[..., 1], weights
    )
    degrees = float(np.degrees(np.arctan2(across, along)))
    ground = middle_b[0] * first + middle_b[1] * second
    shift = middle_a[0] * first + middle_a[1] * second - rotate(_turn(to.up, degrees), ground)
    x, y, z = ((shift - (shift @ up) * up) / to.metres_per_unit).tolist()
    return Placement(degrees, (x, y, z))


def _frame(up: str) -> tuple[Float64Array, Float64Array, Float64Array]:
    """The up axis and two ground axes; a turn about the first leads from the second to the third."""
    axis = _AXES.index(up[-1])
    vectors = np.eye(3)
    sign = -1.0 if up.startswith("-") else 1.0
    return sign * vectors[axis], vectors[(axis + 1) % 3], sign * vectors[(axis + 2) % 3]


def y_up_axes(up: str) -> Float64Array:
    """[3, 3] the axes x, y and z of a world whose y is up, in that of a rig."""
    vertical, first, second = _frame(up)
    return np.stack([second, vertical, first])


def y_up(poses: RigPoses) -> Float64Array:
    """[F, J, 3] joints in the world, metres, y up."""
    return np.asarray(poses.positions() @ y_up_axes(poses.up).T)


def _turn(up: str, degrees: float) -> Float64Array:
    return from_axis_angle(_frame(up)[0], degrees)


def ease(count: int) -> Float64Array:
    """[count] weight of what is entered, from nearly 0 to 1, without a jump in speed (Kovar et al. 2002)."""
    t = np.arange(1, count + 1) / count
    return np.asarray(3 * t**2 - 2 * t**3)


def mixture(a: RigPoses, b: RigPoses, weight: Float64Array) -> RigPoses:
    """Poses between those of `a` (weight 0) and `b` (weight 1); `weight` [F]. Rotations go the shortest way."""
    line = weight[:, None]
    return replace(
        a,
        root=a.root + line * (b.root - a.root),
        shifts=a.shifts + line * (b.shifts - a.shifts),
        rotations=slerp(a.rotations, b.rotations, line),
    )


def placements(pieces: Sequence[WalkPiece], poses: Callable[[int], RigPoses]) -> list[Placement]:
    """Where each piece is placed on the ground: the first as recorded, others so that blended frames come closest."""
    found = [STAY]
    for before, piece in pairwise(pieces):
        leaving = poses(before.clip).cut(before.stop - piece.blend, before.stop)
        entering = poses(piece.clip).cut(piece.start, piece.start + piece.blend)
        found.append(found[-1].after(alignment(leaving, entering), leaving.up))
    return found


def assemble(pieces: Sequence[WalkPiece], places: Sequence[Placement], poses: Callable[[int], RigPoses]) -> RigPoses:
    """The motion of a walk: the pieces one after the other, blended where they overlap."""
    made = [placed(poses(p.clip).cut(p.start, p.stop), place) for p, place in zip(pieces, places, strict=True)]
    shared = [*(piece.blend for piece in pieces), 0]  # frames with the piece before
    parts: list[RigPoses] = []
    for i, own in enumerate(made):
        if i:
            before = made[i - 1]
            leaving = before.cut(len(before) - shared[i], len(before))
            parts.append(mixture(leaving, own.cut(0, shared[i]), ease(shared[i])))
        parts.append(own.cut(shared[i], len(own) - shared[i + 1]))
    root, shifts, rotations = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("root", "shifts", "rotations")
    )
    return replace(made[0], root=root, shifts=shifts, rotations=rotations)


@dataclass(frozen=True)
class Steps:
    """The largest step of each joint from one frame to the next: [J] metres in the world, [J] degrees to its parent."""

    metres: Float64Array
    degrees: Float64Array

    def with_(self, other: Steps) -> Steps:
        """The larger ones of both."""
        return Steps(np.maximum(self.metres, other.metres), np.maximum(self.degrees, other.degrees))

    def within(self, limits: Steps) -> bool:
        """Whether no joint steps farther, but for rounding."""
        return self.excess(limits) <= 1.0

    def excess(self, limits: Steps) -> float:
        """The largest share of its limit that a joint's step takes (10 micrometres and 0.001 degrees are no step)."""
        metres = (self.metres - 1e-5) / np.maximum(limits.metres, 1e-9)
        degrees = (self.degrees - 1e-3) / np.maximum(limits.degrees, 1e-9)
        return float(max(metres.max(), degrees.max()))


def steps(poses: RigPoses) -> Steps:
    """The largest steps within the poses; zero for a single one."""
    joints = len(poses.hierarchy.joints)
    if len(poses) < 2:
        return Steps(np.zeros(joints), np.zeros(joints))
    moved = np.linalg.norm(np.diff(poses.positions(), axis=0), axis=-1).max(axis=0)
    return Steps(moved, angle(poses.rotations[:-1], poses.rotations[1:]).max(axis=0))
