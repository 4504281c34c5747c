"""Feet that stand while clips are blended: made bodies on any axis, and a foot that goes too far."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from motionlake.arrays import BoolArray, Float64Array
from motionlake.deep_motifs.motion_graph.blend import STAY, Placement, RigPoses, Steps, assemble, poses_of, steps, y_up
from motionlake.deep_motifs.motion_graph.graph import WalkPiece
from motionlake.deep_motifs.motion_graph.planting import FAR, Legs, of_walk, planted, standing
from motionlake.formats import read_clips
from motionlake.motion.kinematics import solve
from motionlake.motion.rotations import angle, from_axis_angle, multiply, rotate

from tests.samples import deepmimic_frames, deepmimic_text

TURNS = {"y": ("x", 0.0), "-y": ("x", 180.0), "z": ("x", 90.0), "-z": ("x", -90.0), "x": ("z", -90.0)}
UNIT = 0.5  # metres
PIECES = [WalkPiece(0, 0, 40, 0), WalkPiece(0, 0, 40, 30, 10, 0)]


def still(up: str) -> RigPoses:
    """A DeepMimic humanoid that stands with bent knees and moves its arms, on some axis."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "made.txt"
        file.write_text(deepmimic_text(deepmimic_frames(40)))
        poses = poses_of(read_clips(file)[0], "y", 1.0)
    rotations, legs = poses.rotations.copy(), Legs.of(poses.hierarchy)
    assert legs is not None
    for hip, knee, ankle, _ in legs.sides:
        for joint, degrees in ((hip, -30.0), (knee, 60.0), (ankle, -30.0)):
            rotations[:, joint] = from_axis_angle(np.array([0.0, 0.0, 1.0]), -degrees)
    rotations[:, 0] = rotations[0, 0]
    axis, degrees = TURNS[up]
    turn = from_axis_angle(np.eye(3)["xyz".index(axis)], degrees)
    rotations[:, 0] = multiply(turn, np.ascontiguousarray(rotations[:, 0]))
    root = np.repeat(rotate(turn, poses.root)[:1], len(poses), axis=0)
    return RigPoses(poses.hierarchy, root, poses.shifts, rotations, poses.fps, UNIT, up)


def level(up: str, metres: float) -> Placement:
    """A shift along the ground."""
    shift = np.roll(np.eye(3)["xyz".index(up[-1])], 1) * metres / UNIT
    return Placement(0.0, (float(shift[0]), float(shift[1]), float(shift[2])))


def blended(up: str, metres: float) -> tuple[RigPoses, Legs, Callable[[int], BoolArray]]:
    """Two clips of a standing body, the second one somewhere else, one after the other."""
    poses = still(up)
    legs = Legs.of(poses.hierarchy)
    assert legs is not None
    made = assemble(PIECES, [STAY, level(up, metres)], lambda clip: poses)
    return made, legs, lambda clip: standing(poses, legs)


def limits(poses: RigPoses, most: float) -> Steps:
    return Steps(np.full(len(poses.hierarchy.joints), most), np.full(len(poses.hierarchy.joints), 100 * most))


def wandering(places: Float64Array) -> float:
    return float(np.linalg.norm(places - places[:1], axis=-1).max())


@pytest.mark.parametrize("up", list(TURNS))
def test_feet_that_stand_stay_in_place(up: str) -> None:
    made, legs, stands = blended(up, 0.06)
    assert stands(0).all()
    assert (of_walk(PIECES, stands)).all()
    before = y_up(made)
    assert all(wandering(before[:, leg[2]]) > 0.05 for leg in legs.sides)
    held = planted(made, PIECES, stands, legs, limits(made, 1.0))
    after = y_up(held)
    assert all(wandering(after[:, leg[2]]) < 1e-6 for leg in legs.sides)
    others = [i for i in range(before.shape[1]) if not any(i in leg for leg in legs.sides)]
    np.testing.assert_allclose(after[:, others], before[:, others], atol=1e-9)
    for hip, knee, ankle, _ in legs.sides:
        for a, b in ((hip, knee), (knee, ankle)):
            lengths = [np.linalg.norm(each[:, a] - each[:, b], axis=-1) for each in (before, after)]
            np.testing.assert_allclose(lengths[1], lengths[0], atol=1e-9)
        worlds = [solve(poses.clip()).world for poses in (made, held)]
        assert worlds[0] is not None
        assert worlds[1] is not None
        np.testing.assert_allclose(angle(worlds[0][:, ankle], worlds[1][:, ankle]), 0.0, atol=1e-4)


def test_a_foot_that_would_go_too_far_stays_as_it_is() -> None:
    made, legs, stands = blended("y", 2.5 * FAR)
    assert planted(made, PIECES, stands, legs, limits(made, 1.0)) is made


def test_no_foot_is_held_where_its_leg_would_jump() -> None:
    made, legs, stands = blended("y", 0.06)
    least = steps(made)
    tight = Steps(least.metres, np.zeros_like(least.degrees))
    assert planted(made, PIECES, stands, legs, tight) is made


def test_stands_that_no_blend_touches_stay_as_they_are() -> None:
    made, legs, _ = blended("y", 0.0)
    alone = [WalkPiece(0, 0, len(made), 0)]
    assert planted(made, alone, lambda clip: np.ones((len(made), 2), dtype=bool), legs, limits(made, 1.0)) is made


def test_legs_are_those_of_a_rig_that_is_known() -> None:
    tree = still("y").hierarchy
    found = Legs.of(tree)
    assert found is not None
    names = [[tree.joints[joint] for joint in leg] for leg in found.sides]
    assert names == [[f"{side}_{part}" for part in ("hip", "knee", "ankle", "ankle")] for side in ("left", "right")]
    assert Legs.of(replace(tree, joints=tuple(f"joint{i}" for i in range(len(tree.joints))))) is None


def test_a_foot_in_the_air_does_not_stand() -> None:
    poses = still("y")
    legs = Legs.of(poses.hierarchy)
    assert legs is not None
    rotations = poses.rotations.copy()
    hip = legs.left[0]
    rotations[20:, hip] = from_axis_angle(np.array([0.0, 0.0, 1.0]), 80.0)
    found = standing(RigPoses(poses.hierarchy, poses.root, poses.shifts, rotations, poses.fps, UNIT, "y"), legs)
    assert found[:15, 0].all()
    assert not found[25:, 0].any()
    assert found[:, 1].all()
