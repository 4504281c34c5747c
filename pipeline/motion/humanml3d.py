"""HumanML3D's 263 numbers a frame: from a motion of the 22 body joints of SMPL, and back.

Guo et al., "Generating Diverse and Natural 3D Human Motions from Text", CVPR 2022, section 3, in the form that its
published program gives them. A row holds, in this order,

- half the angle by which the heading turns to the next frame (radians), and the pelvis' way to it along x and z as seen
  from there (metres);
- the height of the pelvis over the floor;
- 21 joints x 3: places relative to the point below the pelvis, seen in the frame's heading;
- 21 joints x 6: the first two columns of the turn from the bone before to the bone that ends in the joint;
- 22 joints x 3: the way to the next frame, seen in the frame's heading;
- whether left ankle, left toe, right ankle and right toe stand.

A bone's turn is the one that brings the direction the bone has in a rest body with hanging arms (`REST_BONES`) to where
it is. The published program takes the smallest such turn, which knows nothing of the turn about the bone itself. Where
`bones` are given to `features`, that turn is in, and every other number is the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.rotations import IDENTITY, conjugate, from_matrix, multiply, rotate, swing, to_matrix
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
# Bones that no other bone comes before, though their parents have one: their turns are counted from the heading.
_FIRST: Final = tuple(INDEX[name] for name in ("left_hip", "right_hip", "spine1", "left_collar", "right_collar"))
_PLACES: Final = slice(4, 4 + 3 * (BODY_JOINTS - 1))
_TURNS: Final = slice(_PLACES.stop, _PLACES.stop + 6 * (BODY_JOINTS - 1))
# From SMPL's T-pose to the rest body: [22, 4] turns that bring the rest body's bones to SMPL's.
TO_T_POSE: Final[Float64Array] = swing(REST_BONES, OFFSETS[:BODY_JOINTS])


@dataclass(frozen=True)
class Recovered:
    """What features tell.

    Attributes:
        positions: [F, 22, 3] joints, metres, y up.
        bones: [F, 22, 4] global turns of the bones that end in the joints; the pelvis' is the heading's.
    """

    positions: Float64Array
    bones: Float64Array


def placed(positions: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array]:
    """How a motion is put on the floor, to begin above the origin, facing +z.

    Args:
        positions: [F, 22, 3] joints, metres, y up.

    Returns:
        The positions so placed, and the turn [4] and then the shift [3] that place them.
    """
    left = _across(positions[:1], "hip") + _across(positions[:1], "shoulder")
    turn = swing(_forward(left)[0], np.array([0.0, 0.0, 1.0]))
    turned = rotate(turn, positions)
    shift = -np.array([turned[0, 0, 0], turned[..., 1].min(), turned[0, 0, 2]])
    return turned + shift, turn, shift


def features(positions: Float64Array, bones: Float64Array | None = None) -> Float64Array:
    """[F - 1, 263] features of joints [F, 22, 3] at 20 frames a second that `placed` has placed.

    `bones` [F, 22, 4] are the global turns of the bones, by default the smallest that explain the positions. Where the
    heading turns past the back of the first frame's, the published program takes that one step with the wrong sign;
    here it has the right one.
    """
    heading = _headings(positions)
    bones = _smallest_turns(positions) if bones is None else bones
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
    """The motion that features [F, 263] tell of: heading and way are added up from the first frame."""
    half_angles = np.concatenate([[0.0], np.cumsum(rows[:-1, 0])])
    nothing = np.zeros(len(rows))
    heading = np.stack([np.cos(half_angles), nothing, np.sin(half_angles), nothing], axis=-1)
    back = conjugate(heading)
    ways = np.stack([rows[:-1, 1], nothing[1:], rows[:-1, 2]], axis=-1)
    root = np.zeros((len(rows), 3))
    root[1:] = np.cumsum(rotate(back[1:], ways), axis=0)
    seen = rows[:, _PLACES].reshape(len(rows), BODY_JOINTS - 1, 3)
    positions = np.concatenate([np.zeros((len(rows), 1, 3)), rotate(back[:, None], seen)], axis=1)
    positions += root[:, None]
    positions[:, 0, 1] = rows[:, 3]
    turns = _from_columns(rows[:, _TURNS].reshape(len(rows), BODY_JOINTS - 1, 6))
    bones = np.concatenate([heading[:, None], turns], axis=1)
    for joint in range(1, BODY_JOINTS):
        before = np.ascontiguousarray(bones[:, 0 if joint in _FIRST else PARENTS[joint]])
        bones[:, joint] = multiply(before, np.ascontiguousarray(bones[:, joint]))
    return Recovered(positions, bones)


def _from_the_bone_before(bones: Float64Array, heading: Float64Array) -> Float64Array:
    """[F, 22, 4] turns of bones relative to the bone before, or to the heading [F, 4]."""
    before = np.stack(
        [heading if joint == 0 or joint in _FIRST else bones[:, PARENTS[joint]] for joint in range(BODY_JOINTS)], axis=1
    )
    return multiply(conjugate(before), bones)


def _smallest_turns(positions: Float64Array) -> Float64Array:
    return swing(REST_BONES, positions - positions[:, [max(parent, 0) for parent in PARENTS[:BODY_JOINTS]]])


def _headings(positions: Float64Array) -> Float64Array:
    """[F, 4] turns about +y that bring where the body faces to +z; of the first frame, none.

    As in the published program the line across the hips counts against the one across the shoulders.
    """
    from scipy.ndimage import gaussian_filter1d

    forward = _forward(_across(positions, "shoulder") - _across(positions, "hip"))
    smooth = gaussian_filter1d(forward, SMOOTHING_FRAMES, axis=0, mode="nearest")
    headings = swing(smooth, np.array([0.0, 0.0, 1.0]))
    headings[0] = IDENTITY
    return headings


def _across(positions: Float64Array, joint: str) -> Float64Array:
    """[F, 3] from the right to the left one of a pair of joints."""
    return positions[:, INDEX[f"left_{joint}"]] - positions[:, INDEX[f"right_{joint}"]]


def _forward(left: Float64Array) -> Float64Array:
    """[F, 3] where a body faces whose left is known [F, 3], as long as left is horizontal in a line of length 1."""
    length = np.linalg.norm(left, axis=-1, keepdims=True)
    return np.cross(left / np.where(length > 0, length, 1.0), np.array([0.0, 1.0, 0.0]))


def _from_columns(columns: Float64Array) -> Float64Array:
    """[..., 4] turns whose matrices have two columns [..., 6], which need be neither upright on each other nor of length 1."""
    first, second = columns[..., :3], columns[..., 3:]
    first = _of_length_one(first)
    second = _of_length_one(second - np.sum(first * second, axis=-1, keepdims=True) * first)
    return from_matrix(np.stack([first, second, np.cross(first, second)], axis=-1))


def _of_length_one(vectors: Float64Array) -> Float64Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1.0))
