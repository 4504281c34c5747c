"""Quaternions and forward kinematics against SciPy's rotations and a plain recursion."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.motion import rotations as rot
from motionlake.motion.clip import ChannelKind, Hierarchy, SourceClip
from motionlake.motion.kinematics import continuous_signs, solve
from scipy.spatial.transform import Rotation

ORDERS = ["".join(p) for p in product("XYZ", repeat=3) if p[0] != p[1] != p[2]]
angles = arrays(float, (5, 3), elements=st.floats(-400, 400).map(lambda a: round(a, 3)))
vectors = arrays(float, (5, 3), elements=st.floats(-10, 10).map(lambda a: round(a, 3)))


def scipy_of(q: Float64Array) -> Rotation:
    return Rotation.from_quat(q, scalar_first=True)


def assert_same_rotation(q: Float64Array, expected: Rotation, atol: float = 1e-10) -> None:
    np.testing.assert_allclose(np.linalg.norm(q, axis=-1), 1, atol=1e-12)
    np.testing.assert_allclose((scipy_of(q).inv() * expected).magnitude(), 0, atol=atol)


@settings(max_examples=60, deadline=None)
@given(angles, angles, vectors, st.sampled_from(ORDERS), st.booleans())
def test_quaternions_agree_with_scipy(
    a: Float64Array, b: Float64Array, v: Float64Array, order: str, fixed: bool
) -> None:
    expected = Rotation.from_euler(order.lower() if fixed else order, a, degrees=True)
    other = Rotation.from_euler("ZYX", b, degrees=True)
    q, p = rot.from_euler(a, order, fixed), rot.from_euler(b, "ZYX")
    assert_same_rotation(q, expected)
    assert_same_rotation(rot.multiply(q, p), expected * other)
    assert_same_rotation(rot.conjugate(q), expected.inv())
    assert_same_rotation(rot.from_matrix(expected.as_matrix()), expected, 1e-7)
    np.testing.assert_allclose(rot.rotate(q, v), expected.apply(v), atol=1e-10)
    np.testing.assert_allclose(rot.to_matrix(q), expected.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(rot.angle(q, p), np.rad2deg((expected.inv() * other).magnitude()), atol=1e-5)


@settings(max_examples=120, deadline=None)
@given(angles, st.sampled_from(ORDERS))
@example(np.array([[10.0, 90, 20], [10, -90, 20], [10, 0, 20], [10, 180, 20], [0, 0, 0]]), "ZYX")
@example(np.array([[10.0, 90, 20], [10, -90, 20], [10, 0, 20], [10, 180, 20], [0, 0, 0]]), "XYX")
def test_euler_angles_of_any_order_give_the_rotation_back(a: Float64Array, order: str) -> None:
    expected = Rotation.from_euler(order, a, degrees=True)
    back = rot.to_euler(rot.from_euler(a, order), order)
    low, high = (0, 180) if order[0] == order[2] else (-90, 90)
    assert ((back[:, 1] >= low - 1e-9) & (back[:, 1] <= high + 1e-9)).all()
    assert (np.abs(back) <= 180 + 1e-9).all()
    difference = (Rotation.from_euler(order, back, degrees=True).inv() * expected).magnitude()
    np.testing.assert_allclose(difference, 0, atol=1e-6)


@settings(max_examples=60, deadline=None)
@given(vectors, vectors)
@example(np.eye(3)[[0, 1, 2, 0, 1]], -np.eye(3)[[0, 1, 2, 0, 1]])
@example(np.ones((5, 3)), -np.ones((5, 3)) * [1, 1, 1 + 1e-9])
def test_swing_turns_one_direction_into_the_other_the_short_way(u: Float64Array, v: Float64Array) -> None:
    keep = (np.linalg.norm(u, axis=1) > 0) & (np.linalg.norm(v, axis=1) > 0)
    u, v = rot.normalise(u[keep]), rot.normalise(v[keep])
    q = rot.swing(u, v)
    np.testing.assert_allclose(np.linalg.norm(q, axis=-1), 1, atol=1e-9)
    np.testing.assert_allclose(rot.rotate(q, u), v, atol=1e-7)
    shortest = 2 * np.arctan2(np.linalg.norm(u - v, axis=1), np.linalg.norm(u + v, axis=1))
    np.testing.assert_allclose(scipy_of(q).magnitude(), shortest, atol=1e-6)


def hierarchy(kind: ChannelKind, channels: list[tuple[str, ...]], axes: Float64Array, fixed: bool) -> Hierarchy:
    """A root, a chain of two below it and a branch."""
    offsets = np.array([[0.5, 1, 2], [0, 3, 0], [1, 0, 0.5], [-2, 1, 0]])
    return Hierarchy(("a", "b", "c", "d"), (-1, 0, 1, 0), offsets, tuple(channels), kind, axes, fixed)


def plain_kinematics(clip: SourceClip) -> tuple[Float64Array, Float64Array]:
    """Positions [F, J, 3] and world rotations as matrices [F, J, 3, 3], straight from the definition."""
    tree = clip.hierarchy
    positions, world = [], []
    for row in clip.channels:
        values = dict(zip(tree.channel_names, row, strict=True))
        at: list[Float64Array] = []
        turned: list[Rotation] = []
        for j, name in enumerate(tree.joints):
            turn = Rotation.identity()
            offset = tree.offsets[j].copy()
            for channel in tree.channels[j]:
                value = values[f"{name}.{channel}"]
                if channel.endswith("position"):
                    offset["XYZ".index(channel[0])] = value
                elif channel.endswith("rotation"):
                    step = Rotation.from_euler(channel[0].lower(), value, degrees=True)
                    turn = step * turn if tree.fixed_axes else turn * step
            if tree.kind is ChannelKind.QUATERNION:
                turn = scipy_of(np.array([values[f"{name}.{letter}quaternion"] for letter in "WXYZ"]))
            axis = scipy_of(tree.axes[j])
            turn = axis * turn * axis.inv()
            parent = tree.parents[j]
            at.append(offset if parent < 0 else at[parent] + turned[parent].apply(offset))
            turned.append(turn if parent < 0 else turned[parent] * turn)
        positions.append(at)
        world.append([turn.as_matrix() for turn in turned])
    return np.array(positions), np.array(world)


def assert_solved(clip: SourceClip) -> None:
    motion = solve(clip)
    assert motion.local is not None
    assert motion.world is not None
    positions, world = plain_kinematics(clip)
    np.testing.assert_allclose(motion.positions, positions, atol=1e-9)
    np.testing.assert_allclose(rot.to_matrix(motion.world), world, atol=1e-9)
    children, parents = [1, 2, 3], [0, 1, 0]
    product_ = rot.multiply(motion.world[:, parents], motion.local[:, children])
    np.testing.assert_allclose(rot.to_matrix(product_), world[:, children], atol=1e-9)
    for q in (motion.local, motion.world):
        assert (np.sum(q[1:] * q[:-1], -1) >= 0).all()


@settings(max_examples=40, deadline=None)
@given(
    arrays(float, (4, 13), elements=st.floats(-400, 400).map(lambda a: round(a, 2))),
    st.booleans(),
    st.booleans(),
    st.sampled_from(ORDERS),
)
def test_euler_channels_of_any_order(values: Float64Array, fixed: bool, axes: bool, order: str) -> None:
    turns = tuple(f"{letter}rotation" for letter in order)[: 3 if len(set(order)) == 3 else 2]
    layout = [
        ("Xposition", "Yposition", "Zposition", *turns),
        (*turns[:2], "Yposition"),
        (),
        (turns[0], "Xposition"),
    ]
    own = rot.from_euler(np.arange(12.0).reshape(4, 3) * 25, "XYZ") if axes else np.tile(rot.IDENTITY, (4, 1))
    tree = hierarchy(ChannelKind.EULER, layout, own, fixed)
    assert_solved(SourceClip(tree, values[:, : len(tree.channel_names)], 30))


@settings(max_examples=40, deadline=None)
@given(arrays(float, (4, 16), elements=st.floats(-3, 3).map(lambda a: round(a, 2))))
def test_quaternion_channels_need_not_be_of_length_one(values: Float64Array) -> None:
    names = tuple(f"{letter}quaternion" for letter in "WXYZ")
    tree = hierarchy(ChannelKind.QUATERNION, [names] * 4, np.tile(rot.IDENTITY, (4, 1)), False)
    clip = SourceClip(tree, values, 30)
    if (np.abs(values.reshape(-1, 4)).sum(1) == 0).any():
        with pytest.raises(ClipError, match="length zero"):
            solve(clip)
    else:
        assert_solved(clip)


def test_position_channels_are_the_positions() -> None:
    values = np.arange(24.0).reshape(2, 12)
    tree = hierarchy(ChannelKind.POSITIONS, [("x", "y", "z")] * 4, np.tile(rot.IDENTITY, (4, 1)), False)
    motion = solve(SourceClip(tree, values, 30))
    assert motion.positions.tolist() == values.reshape(2, 4, 3).tolist()
    assert motion.local is None
    assert motion.world is None


def test_channels_that_make_no_rotation_are_refused() -> None:
    identity = np.tile(rot.IDENTITY, (4, 1))
    for channels, reason in ((("Wquaternion",), "four channels"), (("Wrotation",), "unknown channel")):
        tree = hierarchy(ChannelKind.QUATERNION, [channels] * 4, identity, False)
        with pytest.raises(ClipError, match=reason):
            solve(SourceClip(tree, np.ones((2, 4)), 30))


def test_continuous_changes_signs_only() -> None:
    q = rot.from_euler(np.linspace(0, 1500, 200)[:, None, None] * np.array([[1.0], [-0.4]]), "Z")
    signs = np.where(np.random.default_rng(0).random((200, 2, 1)) < 0.5, -1.0, 1.0)
    result = continuous_signs(q * signs)
    assert (np.sum(result[1:] * result[:-1], -1) > 0).all()
    np.testing.assert_array_equal(np.abs(result), np.abs(q))
