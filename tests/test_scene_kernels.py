"""Kernels of scenes and of rotation vectors, each against a naive version."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from motionlake.arrays import Float64Array
from motionlake.formats.parse.placings import Placing, Placings
from motionlake.formats.parse.scene import Worlds, against_rest, worlds
from motionlake.formats.parse.scene_trees import JointTree
from motionlake.motion.rotations import conjugate, from_vectors, multiply, rotate, to_matrix
from scipy.spatial.transform import Rotation

FRAMES = 3
TREES = st.integers(2, 7).flatmap(lambda count: st.tuples(*(st.integers(0, joint) for joint in range(count - 1))))


def turns(rng: np.random.Generator, *shape: int) -> Float64Array:
    count = int(np.prod(shape))
    return np.asarray(Rotation.random(count, rng).as_quat(scalar_first=True).reshape(*shape, 4))


@given(TREES, st.integers(0, 99))
def test_joints_are_chained_as_one_after_the_other(above: tuple[int, ...], seed: int) -> None:
    rng = np.random.default_rng(seed)
    parents, nodes = (-1, *above), len(above) + 1
    placings = [Placing(rng.normal(size=(FRAMES, 3)), turns(rng, FRAMES)) for _ in range(nodes)]
    found = worlds(JointTree(tuple(range(nodes)), parents, 0), Placings.of(placings), FRAMES)
    positions, rotations = [placings[0].translation], [placings[0].rotation]
    for placing, parent in zip(placings[1:], above, strict=True):
        positions.append(positions[parent] + rotate(rotations[parent], placing.translation))
        rotations.append(multiply(rotations[parent], placing.rotation))
    np.testing.assert_allclose(found.positions, np.stack(positions, axis=1), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.rotations, np.stack(rotations, axis=1), rtol=0, atol=1e-12)


@given(TREES, st.integers(0, 99))
def test_turns_against_the_rest_are_as_the_parent_sees_them(above: tuple[int, ...], seed: int) -> None:
    rng = np.random.default_rng(seed)
    parents, joints = (-1, *above), len(above) + 1
    moved, rest = Worlds(rng.normal(size=(FRAMES, joints, 3)), turns(rng, FRAMES, joints)), turns(rng, joints)
    channels, seen = against_rest(parents, moved, rest)
    local = channels[:, 3:].reshape(FRAMES, joints, 4)
    np.testing.assert_array_equal(channels[:, :3], moved.positions[:, 0])
    turned = [multiply(moved.rotations[:, joint], conjugate(rest[joint])) for joint in range(joints)]
    np.testing.assert_allclose(local[:, 0], turned[0], rtol=0, atol=1e-12)
    for joint, parent in enumerate(above, start=1):
        back = conjugate(turned[parent])
        np.testing.assert_allclose(local[:, joint], multiply(back, turned[joint]), rtol=0, atol=1e-12)
        apart = moved.positions[:, joint] - moved.positions[:, parent]
        np.testing.assert_allclose(seen[:, joint], rotate(back, apart), rtol=0, atol=1e-12)


@given(st.integers(0, 99), st.sampled_from([0.0, 1e-12, 1e-4, 0.999e-3, 1.001e-3, 0.5, 3.2, 9.0]))
def test_rotation_vectors_turn_as_scipy_says(seed: int, size: float) -> None:
    vectors = np.random.default_rng(seed).normal(size=(4, 3))
    vectors *= size / np.linalg.norm(vectors, axis=1, keepdims=True)
    expected = Rotation.from_rotvec(vectors).as_quat(scalar_first=True)
    np.testing.assert_allclose(
        rotate(from_vectors(vectors), vectors + 1), rotate(expected, vectors + 1), rtol=0, atol=1e-12
    )


@given(st.integers(0, 2**32), st.sampled_from([0.0, 1e-9, 0.5, 3.0]), st.booleans())
def test_matrices_are_told_apart_into_what_they_were_made_of(seed: int, angle: float, sized: bool) -> None:
    rng = np.random.default_rng(seed)
    axes = rng.normal(size=(4, 3))
    half = angle / 2
    quaternions = np.column_stack(
        [np.full(4, np.cos(half)), np.sin(half) * axes / np.linalg.norm(axes, axis=1, keepdims=True)]
    )
    sizes = rng.uniform(0.5, 2, (4, 3)) if sized else np.ones((4, 3))
    made = np.tile(np.eye(4), (4, 1, 1))
    made[:, :3, :3], made[:, :3, 3] = to_matrix(quaternions) * sizes[:, None, :], rng.normal(size=(4, 3))
    found = Placing.of_matrices(made)
    np.testing.assert_allclose(to_matrix(found.rotation) * found.scale[:, None, :], made[:, :3, :3], atol=1e-12)
    np.testing.assert_array_equal(found.translation, made[:, :3, 3])
