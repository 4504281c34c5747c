"""HumanML3D's features and their recovery written anew from the published definition: one frame, one joint at a time.

Rotations are SciPy's. Where the dataset's own program slips (the sign of the turn of the one frame in which the heading
passes -z) this takes the right value.
"""

from __future__ import annotations

import itertools

import numpy as np
from motionlake.arrays import Float64Array
from scipy.spatial.transform import Rotation

CHAINS = ([0, 2, 5, 8, 11], [0, 1, 4, 7, 10], [0, 3, 6, 9, 12, 15], [9, 14, 17, 19, 21], [9, 13, 16, 18, 20])
RIGHT_HIP, LEFT_HIP, RIGHT_SHOULDER, LEFT_SHOULDER = 2, 1, 17, 16
X, Y, Z = np.eye(3)
DIRECTIONS = {1: X, 2: -X, 3: Y, 4: -Y, 5: -Y, 6: Y, 7: -Y, 8: -Y, 9: Y, 10: Z, 11: Z, 12: Y, 13: X, 14: -X, 15: Z}
DIRECTIONS |= dict.fromkeys(range(16, 22), -Y)


def smallest(u: Float64Array, v: Float64Array) -> Rotation:
    """The smallest rotation from one direction to another."""
    axis = np.cross(u, v)
    length = np.linalg.norm(axis)
    if length < 1e-12:
        return Rotation.identity() if u @ v > 0 else Rotation.from_rotvec(np.pi * np.cross(u, np.roll(u, 1)))
    return Rotation.from_rotvec(axis / length * np.arctan2(length, u @ v))


def angle_about_y(turn: Rotation) -> float:
    """Radians of a turn about +y."""
    return float(np.arctan2(*(turn.apply(Z)[[0, 2]])))


def on_the_floor(positions: Float64Array) -> Float64Array:
    """Lowest joint at 0, the first pelvis above the origin, the first frame facing +z."""
    first = positions[0]
    right = first[RIGHT_HIP] - first[LEFT_HIP] + first[RIGHT_SHOULDER] - first[LEFT_SHOULDER]
    facing = np.cross(Y, right)
    turn = smallest(facing / np.linalg.norm(facing), Z)
    moved = positions - np.array([first[0, 0], positions[:, :, 1].min(), first[0, 2]])
    return np.array([turn.apply(frame) for frame in moved])


def headings(positions: Float64Array) -> list[Rotation]:
    """The turn that brings the smoothed facing of each frame to +z; hips are taken the wrong way round."""
    facing = []
    for frame in positions:
        across = frame[LEFT_HIP] - frame[RIGHT_HIP] + frame[RIGHT_SHOULDER] - frame[LEFT_SHOULDER]
        facing.append(np.cross(Y, across / np.linalg.norm(across)))
    reach = np.arange(-80, 81)
    weights = np.exp(-0.5 * (reach / 20.0) ** 2)
    weights /= weights.sum()
    found = []
    for at in range(len(facing)):
        around = [facing[min(max(at + int(by), 0), len(facing) - 1)] for by in reach]
        smooth = np.sum(weights[:, None] * np.array(around), axis=0)
        found.append(smallest(smooth / np.linalg.norm(smooth), Z))
    return found


def features(positions: Float64Array) -> Float64Array:
    """[F - 1, 263] of joints [F, 22, 3] at 20 frames a second, on the floor."""
    heading = headings(positions)
    rows = []
    for at in range(len(positions) - 1):
        now, then = positions[at], positions[at + 1]
        turn = angle_about_y(heading[at + 1] * heading[at].inv()) / 2
        way = heading[at + 1].apply(then[0] - now[0])
        row = [turn, way[0], way[2], now[0, 1]]
        for joint in range(1, 22):
            row += list(heading[at].apply(now[joint] - np.array([now[0, 0], 0.0, now[0, 2]])))
        local: dict[int, Float64Array] = {}
        for chain in CHAINS:
            before = heading[at]
            for parent, joint in itertools.pairwise(chain):
                bone = now[joint] - now[parent]
                own = smallest(DIRECTIONS[joint], bone / np.linalg.norm(bone))
                local[joint] = (before.inv() * own).as_matrix()
                before = own
        for joint in range(1, 22):
            row += [*local[joint][:, 0], *local[joint][:, 1]]
        for joint in range(22):
            row += list(heading[at].apply(then[joint] - now[joint]))
        for joint in (7, 10, 8, 11):
            row.append(float(((then[joint] - now[joint]) ** 2).sum() < 0.002))
        rows.append(row)
    return np.array(rows)


def recovered_joints(rows: Float64Array) -> Float64Array:
    """[F, 22, 3] joints of features [F, 263], by heading, way and places."""
    turned, place, found = 0.0, np.zeros(3), []
    for at, row in enumerate(rows):
        if at:
            turned += 2 * rows[at - 1, 0]
        back = Rotation.from_rotvec([0.0, -turned, 0.0])
        if at:
            place = place + back.apply([rows[at - 1, 1], 0.0, rows[at - 1, 2]])
        ground = np.array([place[0], 0.0, place[2]])
        joints = [ground + np.array([0.0, row[3], 0.0])]
        joints += [ground + back.apply(row[4 + 3 * joint : 7 + 3 * joint]) for joint in range(21)]
        found.append(joints)
    return np.array(found)


def joints_by_rotations(rows: Float64Array, lengths: Float64Array, facing: float) -> Float64Array:
    """[F, 22, 3] joints of features by the 6-D numbers alone: chains of bones of given lengths [22] from the pelvis.

    `facing`: radians about +y of the first frame's heading, which the numbers of rotations are counted from.
    """
    found = []
    heading = facing
    for at, row in enumerate(rows):
        if at:
            heading += 2 * rows[at - 1, 0]
        joints = np.zeros((22, 3))
        for chain in CHAINS:
            turn = Rotation.from_rotvec([0.0, heading, 0.0])
            for parent, joint in itertools.pairwise(chain):
                numbers = row[67 + 6 * (joint - 1) : 73 + 6 * (joint - 1)]
                columns = [numbers[:3], numbers[3:], np.cross(numbers[:3], numbers[3:])]
                turn = turn * Rotation.from_matrix(np.stack(columns, axis=1))
                joints[joint] = joints[parent] + turn.apply(lengths[joint] * DIRECTIONS[joint])
        found.append(joints)
    return np.array(found)
