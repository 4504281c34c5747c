"""HumanML3D's 263 numbers a frame: from a motion of the 22 body joints of SMPL, and back.

Guo et al., "Generating Diverse and Natural 3D Human Motions from Text", CVPR 2022, section 3, in the form that the
published program gives them (docs/humanml3d.md). A row holds, in this order,

- half the angle by which the heading turns to the next frame (radians), and the pelvis' way to it along x and z as seen
  from there (metres);
- the height of the pelvis over the floor;
- 21 joints x 3: places relative to the point below the pelvis, seen in the frame's heading;
- 21 joints x 6: the first two columns of the turn from the bone before to the bone that ends in the joint;
- 22 joints x 3: the way to the next frame, seen in the frame's heading;
- whether left ankle, left toe, right ankle and right toe stand.

A bone's turn is one that brings the direction the bone has in a rest body with hanging arms (`REST_BONES`) to where it
is. The published program takes the smallest, which knows nothing of the turn about the bone itself. Where `bones` are
given to `features` that turn is in, and every other number is the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray
from motionlake.motion.rotations import (
    MIN_LENGTH,
    conjugate,
    from_matrix,
    multiply,
    of_length_one,
    rotate,
    swing,
    to_matrix,
)
from motionlake.motion.smpl import BODY_JOINTS, INDEX, OFFSETS, PARENTS

FPS: Final = 20.0
FEATURES: Final = 263
# A joint stands where the square of its way from one frame to the next (metres) is below this.
STANDS: Final = 0.002
SMOOTHING_FRAMES: Final = 20.0
_FEET: Final = [INDEX[name] for name in ("left_ankle", "left_foot", "right_ankle", "right_foot")]
# [22, 3] the direction of the bone that ends in each joint, in the rest body that turns of bones are counted from.
REST_BONES: Final[Float64Array] = np.array(
    [[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, -1, 0], [0, 1, 0], [0, -1, 0], [0, -1, 0], [0, 1, 0],
     [0, 0, 1], [0, 0, 1], [0, 1, 0], [1, 0, 0], [-1, 0, 0], [0, 0, 1], *[[0, -1, 0]] * 6], float,
)  # fmt: skip
# Bones that no other bone comes before, though their parents may have one: their turns are counted from the heading.
_FIRST: Final = tuple(INDEX[name] for name in ("left_hip", "right_hip", "spine1", "left_collar", "right_collar"))
PLACES: Final = slice(4, 4 + 3 * (BODY_JOINTS - 1))
TURNS: Final = slice(PLACES.stop, PLACES.stop + 6 * (BODY_JOINTS - 1))
WAYS: Final = slice(TURNS.stop, TURNS.stop + 3 * BODY_JOINTS)
STANDING: Final = slice(WAYS.stop, FEATURES)
GROUPS: Final = (slice(0, 1), slice(1, 3), slice(3, 4), PLACES, TURNS, WAYS, STANDING)  # of one kind of number each
# Numbers of two columns of a turn that are as far as this from length 1, on average, are no turns.
COLUMN_SLACK: Final = 0.25


@dataclass(frozen=True)
class Recovered:
    """What features [F, 263] tell.

    Attributes:
        positions: [F + 1, 22, 3] joints, metres, y up; the last frame is where the ways of the one before lead.
        bones: [F, 22, 4] global turns of the bones that end in the joints; the pelvis' is the heading's.
    """

    positions: Float64Array
    bones: Float64Array


def placed(positions: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Joints [F, 22, 3] (metres, y up) put on the floor, beginning over the origin and facing +z; and that turn [4]."""
    left = _across(positions[:1], "hip") + _across(positions[:1], "shoulder")
    turn = swing(_forward(left)[0], np.array([0.0, 0.0, 1.0]))
    turned = rotate(turn, positions)
    return turned - np.array([turned[0, 0, 0], turned[..., 1].min(), turned[0, 0, 2]]), turn


def features(positions: Float64Array, bones: Float64Array | None = None) -> Float64Array:
    """[F - 1, 263] features of joints [F, 22, 3] at 20 frames a second that `placed` has placed.

    `bones` [F, 22, 4] are the global turns of the bones, by default the smallest that explain the positions. Where the
    heading turns past -z, the published program takes that one step with the wrong sign; here it has the right one.
    """
    heading = _headings(positions)
    bones = smallest_turns(positions) if bones is None else bones
    steps = multiply(np.ascontiguousarray(heading[1:]), conjugate(heading[:-1]))
    half_angles = np.arcsin(np.clip(steps[:, 2] * np.where(steps[:, 0] < 0, -1.0, 1.0), -1.0, 1.0))
    moves = np.diff(positions, axis=0)
    ways = rotate(heading[1:], moves[:, 0])
    seen = rotate(heading[:, None], positions - positions[:, :1] * [1.0, 0.0, 1.0])
    turns = to_matrix(_from_the_bone_before(bones, heading))[:, 1:]
    columns = np.concatenate([turns[..., 0], turns[..., 1]], axis=-1)
    stands = np.sum(moves[:, _FEET] ** 2, axis=-1) < STANDS
    rows = len(moves)
    return np.hstack([
        half_angles[:, None],
        ways[:, [0, 2]],
        positions[:-1, 0, 1:2],
        seen[:-1, 1:].reshape(rows, -1),
        columns[:-1].reshape(rows, -1),
        rotate(heading[:-1, None], moves).reshape(rows, -1),
        stands,
    ])  # fmt: skip


def recovered(rows: Float64Array) -> Recovered:
    """The motion that features [F, 263] tell of: heading and way are added up from the first frame.

    Turns of bones are counted from a heading that the numbers do not hold (the first frame's): the one by which the
    bones point best where the joints are.
    """
    positions, heading = recovered_joints(rows)
    turns = _from_columns(rows[:, TURNS].reshape(len(rows), BODY_JOINTS - 1, 6))
    bones = np.concatenate([heading[:-1, None], turns], axis=1)
    for joint in range(1, BODY_JOINTS):
        before = np.ascontiguousarray(bones[:, 0 if joint in _FIRST else PARENTS[joint]])
        bones[:, joint] = multiply(before, np.ascontiguousarray(bones[:, joint]))
    return Recovered(positions, multiply(_turn_onto(bones, positions[:-1]), bones))


def recovered_joints(rows: FloatArray) -> tuple[Float64Array, Float64Array]:
    """Joints [F + 1, 22, 3] of features [F, 263], as `Recovered` has them, and the heading [F + 1, 4] of each frame."""
    first = rows[:, : PLACES.start].astype(np.float64)
    half_angles = np.concatenate([[0.0], np.cumsum(first[:, 0])])
    nothing = np.zeros(len(half_angles))
    heading = np.stack([np.cos(half_angles), nothing, np.sin(half_angles), nothing], axis=-1)
    back = conjugate(heading)
    ways = np.stack([first[:, 1], nothing[1:], first[:, 2]], axis=-1)
    root = np.concatenate([np.zeros((1, 3)), np.cumsum(rotate(back[1:], ways), axis=0)])
    places = rows[:, PLACES].astype(np.float64)
    positions = np.zeros((len(rows) + 1, BODY_JOINTS, 3))
    positions[:-1, 1:] = rotate(back[:-1, None], places.reshape(len(rows), BODY_JOINTS - 1, 3))
    positions[:-1] += root[:-1, None]
    positions[:-1, 0, 1] = first[:, 3]
    positions[-1] = positions[-2] + rotate(back[-2], rows[-1, WAYS].astype(np.float64).reshape(BODY_JOINTS, 3))
    return positions, heading


def are_turns(rows: FloatArray) -> bool:
    """Whether the numbers of turns in features [F, 263] are some: columns of matrices, of length 1."""
    squares = rows[:, TURNS] ** 2
    lengths = np.sqrt(squares[:, 0::3] + squares[:, 1::3] + squares[:, 2::3])
    return bool(np.mean(np.abs(lengths - 1)) < COLUMN_SLACK)


def bone_vectors(positions: Float64Array) -> Float64Array:
    """[F, 22, 3] from each joint's parent to it; zero at the pelvis."""
    return positions - positions[:, [max(parent, 0) for parent in PARENTS[:BODY_JOINTS]]]


def smallest_turns(positions: Float64Array) -> Float64Array:
    """[F, 22, 4] the smallest global turns of bones that explain joints [F, 22, 3]."""
    return swing(REST_BONES, bone_vectors(positions))


def bones_of_joints(world: Float64Array) -> Float64Array:
    """[F, 22, 4] the turns of bones of a body whose joints have global rotations [F, 22, 4] from the T-pose."""
    return multiply(world[:, [max(parent, 0) for parent in PARENTS[:BODY_JOINTS]]], _to_t_pose())


def joints_of_bones(bones: Float64Array) -> Float64Array:
    """[F, 22, 4] the global rotation of each bone's upper joint from the T-pose: the inverse of `bones_of_joints`."""
    return multiply(bones, conjugate(_to_t_pose()))


@cache
def _to_t_pose() -> Float64Array:
    """[22, 4] turns that bring the rest body's bones to those of SMPL's T-pose."""
    return swing(REST_BONES, OFFSETS[:BODY_JOINTS])


def _turn_onto(bones: Float64Array, positions: Float64Array) -> Float64Array:
    """The turn [4] about +y that lets turned bones [F, 22, 4] point best to where joints [F, 22, 3] are."""
    pointing, wanted = rotate(bones[:, 1:], REST_BONES[1:]), bone_vectors(positions)[:, 1:]
    along = np.sum(wanted[..., [0, 2]] * pointing[..., [0, 2]])
    across = np.sum(wanted[..., 0] * pointing[..., 2] - wanted[..., 2] * pointing[..., 0])
    half = np.arctan2(across, along) / 2
    return np.array([np.cos(half), 0.0, np.sin(half), 0.0])


def _from_the_bone_before(bones: Float64Array, heading: Float64Array) -> Float64Array:
    """[F, 22, 4] turns of bones relative to the bone before, or to the heading [F, 4]."""
    before = np.stack(
        [heading if joint == 0 or joint in _FIRST else bones[:, PARENTS[joint]] for joint in range(BODY_JOINTS)], axis=1
    )
    return multiply(conjugate(before), bones)


def _headings(positions: Float64Array) -> Float64Array:
    """[F, 4] turns about +y that bring where the body faces, smoothed in time, to +z.

    As in the published program the line across the hips counts against the one across the shoulders.
    """
    from scipy.ndimage import gaussian_filter1d

    forward = _forward(_across(positions, "shoulder") - _across(positions, "hip"))
    smooth = gaussian_filter1d(forward, SMOOTHING_FRAMES, axis=0, mode="nearest")
    return swing(smooth, np.array([0.0, 0.0, 1.0]))


def _across(positions: Float64Array, joint: str) -> Float64Array:
    """[F, 3] from the right to the left one of a pair of joints."""
    return positions[:, INDEX[f"left_{joint}"]] - positions[:, INDEX[f"right_{joint}"]]


def _forward(left: Float64Array) -> Float64Array:
    """[F, 3] where a body faces whose left is known [F, 3]; as long as left is horizontal in a line of length 1."""
    return np.cross(of_length_one(left), np.array([0.0, 1.0, 0.0]))


def _from_columns(columns: Float64Array) -> Float64Array:
    """[..., 4] turns whose matrices have two columns [..., 6]; none where these have no length or one direction.

    Columns that are not upright on each other, or not of length 1, as networks make them, are set right.
    """
    first = of_length_one(columns[..., :3])
    across = np.cross(first, columns[..., 3:])
    known = np.linalg.norm(across, axis=-1) > MIN_LENGTH
    third = of_length_one(across)
    matrices = np.stack([first, np.cross(third, first), third], axis=-1)
    return from_matrix(np.where(known[..., None, None], matrices, np.eye(3)))
