"""Kernels of `scene`: apart from it, so that who only names a scene waits for no compiler."""

from __future__ import annotations

import math

import numpy as np
from motionlake.kernels import njit
from motionlake.motion.rotation_kernels import multiply_into, rotate_into


@njit(cache=True, inline="always")
def _set_length_one(turn):  # type: ignore[no-untyped-def]
    """Scale a quaternion; one without length becomes NaN."""
    length = math.sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2] + turn[3] * turn[3])
    for i in range(4):
        turn[i] = turn[i] / length if length > 0.0 else math.nan


@njit(cache=True)
def _fill_matrix(turn, matrix):  # type: ignore[no-untyped-def]
    """Fill matrix [3, 3] of a quaternion."""
    axis, column = np.zeros(3), np.empty(3)
    for c in range(3):
        axis[c] = 1.0
        rotate_into(turn, axis, column)
        axis[c] = 0.0
        for i in range(3):
            matrix[i, c] = column[i]


@njit(cache=True)
def chain(nodes, parents, root, translations, rotations, scales, scaled, positions, turned):  # type: ignore[no-untyped-def]
    """Fill positions [F, N - root, 3] and turned [F, N - root, 4] of nodes in the scene.

    Args:
        nodes: [N] columns of translations, rotations and scales; -1 where a node stands as its parent.
        parents: [N]; -1 at the top; parents come first.
        root: the place from which on nodes are wanted.
        translations, rotations, scales: [F, ., 3], [F, ., 4] and [F, ., 3] below the parents, F = 1 where they stay.
        scaled: [N] whether a node or one above it is scaled.
    """
    count = len(nodes)
    places, turns, linear = np.empty((count, 3)), np.empty((count, 4)), np.empty((count, 3, 3))
    vector, own, turn = np.empty(3), np.empty((3, 3)), np.empty(4)
    for f in range(positions.shape[0]):
        t, r, s = min(f, len(translations) - 1), min(f, len(rotations) - 1), min(f, len(scales) - 1)
        for n in range(count):
            node, parent = nodes[n], parents[n]
            for i in range(3):
                vector[i] = translations[t, node, i] if node >= 0 else 0.0
            for i in range(4):
                turn[i] = rotations[r, node, i] if node >= 0 else (1.0 if i == 0 else 0.0)
            _set_length_one(turn)
            if scaled[n]:
                _fill_matrix(turn, own)
                for i in range(3):
                    for k in range(3):
                        own[i, k] *= scales[s, node, k] if node >= 0 else 1.0
                if parent >= 0:
                    if not scaled[parent]:
                        _fill_matrix(turns[parent], linear[parent])
                    for i in range(3):
                        for k in range(3):
                            linear[n, i, k] = (
                                linear[parent, i, 0] * own[0, k]
                                + linear[parent, i, 1] * own[1, k]
                                + linear[parent, i, 2] * own[2, k]
                            )
                else:
                    linear[n] = own
            if parent < 0:
                places[n] = vector
                turns[n] = turn
            else:
                if scaled[parent]:
                    above = linear[parent]
                    for i in range(3):
                        places[n, i] = above[i, 0] * vector[0] + above[i, 1] * vector[1] + above[i, 2] * vector[2]
                else:
                    rotate_into(turns[parent], vector, places[n])
                for i in range(3):
                    places[n, i] += places[parent, i]
                multiply_into(turns[parent], turn, turns[n])
            if n >= root:
                positions[f, n - root] = places[n]
                turned[f, n - root] = turns[n]


@njit(cache=True)
def fill_against_rest(parents, positions, rotations, rest, channels, seen):  # type: ignore[no-untyped-def]
    """Fill channels [F, 3 + 4 J] from the fourth on, joints' turns against their rest as the parents', and seen.

    Args:
        parents: [J]; -1 at joint 0.
        positions, rotations: [F, J, 3] and [F, J, 4] in the scene.
        rest: [J, 4] rotations of the rest pose.
        seen: [F, J, 3] receives where each joint is, as its parent's turn against its rest sees it.
    """
    joints = positions.shape[1]
    turns = np.empty((joints, 4))
    inverse, vector = np.empty(4), np.empty(3)
    for f in range(positions.shape[0]):
        for j in range(joints):
            inverse[0] = rest[j, 0]
            for i in range(1, 4):
                inverse[i] = -rest[j, i]
            turn = turns[j]
            multiply_into(rotations[f, j], inverse, turn)
            _set_length_one(turn)
        for j in range(joints):
            parent = parents[j]
            if parent < 0:
                for i in range(4):
                    channels[f, 3 + i] = turns[j, i]
                for i in range(3):
                    seen[f, j, i] = positions[f, j, i]
                continue
            inverse[0] = turns[parent, 0]
            for i in range(1, 4):
                inverse[i] = -turns[parent, i]
            multiply_into(inverse, turns[j], channels[f, 3 + 4 * j : 7 + 4 * j])
            for i in range(3):
                vector[i] = positions[f, j, i] - positions[f, parent, i]
            rotate_into(inverse, vector, seen[f, j])
