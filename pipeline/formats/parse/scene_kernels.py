"""Kernels of `scene`: apart from it, so that who only names a scene waits for no compiler."""

from __future__ import annotations

import math

import numpy as np
from motionlake.kernels import njit
from motionlake.motion.rotation_kernels import multiply_into, rotate_into


@njit(cache=True)
def chain(parents, translations, rotations, positions, turned):  # type: ignore[no-untyped-def]
    """Fill positions [F, N, 3] and turned [F, N, 4] in the scene of N nodes that are not scaled, parents first.

    Args:
        parents: [N]; -1 at the top.
        translations, rotations: [F, N, 3] and [F, N, 4] below the parents.
    """
    vector = np.empty(3)
    for f in range(positions.shape[0]):
        for n in range(positions.shape[1]):
            parent = parents[n]
            if parent < 0:
                for i in range(3):
                    positions[f, n, i] = translations[f, n, i]
                for i in range(4):
                    turned[f, n, i] = rotations[f, n, i]
                continue
            rotate_into(turned[f, parent], translations[f, n], vector)
            for i in range(3):
                positions[f, n, i] = positions[f, parent, i] + vector[i]
            multiply_into(turned[f, parent], rotations[f, n], turned[f, n])


@njit(cache=True)
def fill_against_rest(parents, positions, rotations, rest, local, seen):  # type: ignore[no-untyped-def]
    """Fill local [F, J, 4], each joint's turn against its rest as its parent's sees it, and seen [F, J, 3].

    Args:
        parents: [J]; -1 at joint 0.
        positions, rotations: [F, J, 3] and [F, J, 4] in the scene.
        rest: [J, 4] rotations of the rest pose.
        seen: receives where each joint is, as its parent's turn against its rest sees it.
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
            length = math.sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2] + turn[3] * turn[3])
            for i in range(4):
                turn[i] = turn[i] / length if length > 0.0 else math.nan
        for j in range(joints):
            parent = parents[j]
            if parent < 0:
                for i in range(4):
                    local[f, j, i] = turns[j, i]
                for i in range(3):
                    seen[f, j, i] = positions[f, j, i]
                continue
            inverse[0] = turns[parent, 0]
            for i in range(1, 4):
                inverse[i] = -turns[parent, i]
            multiply_into(inverse, turns[j], local[f, j])
            for i in range(3):
                vector[i] = positions[f, j, i] - positions[f, parent, i]
            rotate_into(inverse, vector, seen[f, j])
