"""The canonical skeleton: exact on made bodies of any rest pose, sound on real recordings of every set."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats import read_clips
from motionlake.formats.deepmimic import READER
from motionlake.formats.write.bvh import write_bvh
from motionlake.motion import canonicalise as canonical
from motionlake.motion import rest
from motionlake.motion.canonicalise import CanonicalMotion, canonicalise, to_source_clip, turn_to_y_up
from motionlake.motion.clip import ChannelKind, Hierarchy, SolvedMotion, SourceClip
from motionlake.motion.kinematics import forward_kinematics, local_rotations, solve, world_rotations
from motionlake.motion.rigs import Rest, identify, load_rigs
from motionlake.motion.rotations import (
    IDENTITY,
    angle,
    conjugate,
    from_axis_angle,
    from_matrix,
    multiply,
    rotate,
    swing,
)
from motionlake.motion.skeleton import BONES, INDEX, JOINTS, PARENTS, facing
from motionlake.motion.units import CMU, UNITS
from scipy.spatial.transform import Rotation

from tests.rig_samples import SETS, sample
from tests.samples import deepmimic_frames, deepmimic_text

RIGS = load_rigs()
# Ankle to head joint in metres; a Kinect puts the head joint high.
PLAUSIBLE = (1.2, 1.8)
# Bones that a source with more joints than the canonical ones bends inside of.
COLLAPSED = {"cmu_asf": {"spine", "neck"}, "cmu_bvh": {"spine", "neck"}}


def made_offsets() -> Float64Array:
    """[21, 3] a body of 1.5 m from ankle to head, bones along the canonical directions."""
    offsets = np.zeros((len(JOINTS), 3))
    for name, (child, direction) in BONES.items():
        offsets[INDEX[child]] = np.array(direction) * (0.1 if name == "neck" or "clavicle" in name else 0.35)
    offsets[INDEX["spine"]] = [0, 0.1, 0]
    offsets[INDEX["neck"]] = [0, 0.2, 0]
    for side, sign in (("left", 1), ("right", -1)):
        offsets[INDEX[f"{side}_hip"]] = [0.1 * sign, -0.05, 0]
        offsets[INDEX[f"{side}_clavicle"]] = [0.04 * sign, 0.18, 0.01]
    return offsets


def quaternions(rotation: Rotation) -> Float64Array:
    return np.asarray(rotation.as_quat(scalar_first=True))


def made_motion(seed: int, frames: int = 5, scale: float = 0.5) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Root [F, 3], global rotations [F, 21, 4], positions [F, 21, 3]: any pose, near to standing."""
    generator = np.random.default_rng(seed)
    turns = Rotation.from_rotvec(generator.normal(scale=scale, size=(frames * len(JOINTS), 3)))
    local = quaternions(turns).reshape(frames, len(JOINTS), 4)
    root = generator.normal(size=(frames, 3))
    return root, world_rotations(local), forward_kinematics(root, local, made_offsets())


def clip_of(world: Float64Array, positions: Float64Array) -> tuple[SourceClip, SolvedMotion]:
    """A clip of the canonical joint names with this forward kinematics; its channels are never looked at."""
    hierarchy = Hierarchy(
        JOINTS, PARENTS, np.zeros((len(JOINTS), 3)), ((),) * len(JOINTS), ChannelKind.EULER,
        np.tile(IDENTITY, (len(JOINTS), 1)),
    )  # fmt: skip
    return SourceClip(hierarchy, np.zeros((len(world), 0)), 30.0), SolvedMotion(positions, world, world)


def assert_same_rotations(motion: CanonicalMotion, world: Float64Array) -> None:
    assert angle(world_rotations(motion.rotations), world).max() < 1e-4


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_rotations_do_not_depend_on_the_orientations_a_rig_rests_in(seed: int) -> None:
    """A source whose every joint has its own rest orientation, told to the map, gives the same motion."""
    _, world, positions = made_motion(seed)
    resting = quaternions(Rotation.random(len(JOINTS), random_state=seed))
    rig = replace(
        RIGS["canonical"],
        rest=Rest.ORIENTATIONS,
        rest_orientations={name: tuple(q) for name, q in zip(JOINTS, resting, strict=True)},
    )
    motion = canonicalise(*clip_of(multiply(world, resting), positions * 100), rig)
    assert_same_rotations(motion, world)
    np.testing.assert_allclose(motion.positions, positions, atol=1e-9)
    np.testing.assert_allclose(motion.rest_offsets, made_offsets(), atol=1e-9)
    assert motion.fk_error < 1e-9


@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    yaw=st.floats(-180, 180),
    up=st.sampled_from(["x", "y", "z", "-x", "-y", "-z"]),
)
def test_rotations_do_not_depend_on_where_the_zero_pose_faces_nor_on_the_up_axis(
    seed: int, yaw: float, up: str
) -> None:
    """A T-pose that faces anywhere, in a file of any up axis, gives the same motion, heading included."""
    _, world, positions = made_motion(seed)
    yaw = 90 * round(yaw / 90) if abs(yaw - 90 * round(yaw / 90)) < 20 else yaw
    to_file = {
        "y": np.eye(3), "z": [[1, 0, 0], [0, 0, -1], [0, 1, 0]], "x": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
        "-y": [[1, 0, 0], [0, -1, 0], [0, 0, -1]], "-z": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        "-x": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
    }[up]  # fmt: skip
    turn = quaternions(Rotation.from_matrix(to_file))
    zero_pose = multiply(turn, from_axis_angle(np.array([0.0, 1.0, 0.0]), yaw))
    # The canonical rest pose, turned by `zero_pose`, is what the file calls zero.
    source = multiply(multiply(turn, world), conjugate(zero_pose))
    rig = replace(RIGS["canonical"], rest=Rest.ZERO)
    motion = canonicalise(*clip_of(source, rotate(turn, positions) * 100), rig, up=up)
    assert_same_rotations(motion, world)
    np.testing.assert_allclose(motion.positions, positions, atol=1e-9)


def test_arms_that_hang_in_the_zero_pose_hang_in_the_canonical_one_and_heading_stays() -> None:
    """DeepMimic's zero pose: faces +x, arms down."""
    clip = next(iter(deepmimic_zero()))
    motion = canonicalise(clip, solve(clip), RIGS["deepmimic"])
    np.testing.assert_allclose(facing(motion.positions), np.pi / 2, atol=1e-9)
    down = from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array([-90.0, 90.0]))
    for side, q in zip(("left", "right"), down, strict=True):
        assert angle(motion.rotations[0, INDEX[f"{side}_shoulder"]], q) < 1e-4
        assert angle(motion.rotations[0, INDEX[f"{side}_elbow"]], IDENTITY) < 1e-4
    assert motion.filled == ("spine", "head", "left_clavicle", "right_clavicle", "left_toe", "right_toe")
    assert motion.fk_error < 1e-9
    np.testing.assert_allclose(motion.positions[:, INDEX["spine"], 1] - motion.root[:, 1], 0.236151 / 2)


def deepmimic_zero() -> list[SourceClip]:
    frames = deepmimic_frames(3)
    frames[:, 16:] = 0.0
    frames[:, [16, 21, 25, 30, 35, 39]] = 1.0
    return READER.read(deepmimic_text(frames).encode(), Path("zero.txt"))


def test_a_zero_pose_that_is_no_human_is_told_and_rotations_come_from_positions() -> None:
    _, world, positions = made_motion(3)
    tangled = quaternions(Rotation.random(len(JOINTS), random_state=1))
    rig = replace(RIGS["canonical"], rest=Rest.ZERO)
    motion = canonicalise(*clip_of(multiply(world, tangled), positions * 100), rig)
    assert not motion.twist
    assert "zero pose is no standing human" in " ".join(motion.notes)
    assert_bones_point_along_rotations(motion, set())


def test_the_unit_is_the_option_then_the_file_then_the_rig_and_a_giant_is_refused() -> None:
    _, world, positions = made_motion(4)
    clip, motion = clip_of(world, positions * 100)
    rig = RIGS["canonical"]
    assert canonicalise(clip, motion, rig).metres_per_unit == 0.01
    assert canonicalise(replace(clip, metres_per_unit=0.011), motion, rig).metres_per_unit == 0.011
    assert canonicalise(replace(clip, metres_per_unit=1.0), motion, rig, metres_per_unit=0.012).metres_per_unit == 0.012
    with pytest.raises(ClipError, match=r"^body height 1\d\d\.?\d* m with unit 1 m: say --unit$"):
        canonicalise(clip, motion, rig, metres_per_unit=1.0)


def test_the_up_axis_is_the_option_then_the_file_then_the_rig() -> None:
    _, world, positions = made_motion(4)
    clip, motion = clip_of(world, positions * 100)
    rig = RIGS["canonical"]
    as_is = canonicalise(clip, motion, rig)
    assert as_is.up == "y"
    onto_z = from_axis_angle(np.array([1.0, 0.0, 0.0]), 90.0)
    turned = SolvedMotion(rotate(onto_z, motion.positions), *[multiply(onto_z, world)] * 2)
    for told in (
        canonicalise(replace(clip, up="z"), turned, rig),
        canonicalise(replace(clip, up="-x"), turned, rig, up="z"),
        canonicalise(clip, turned, replace(rig, up="z")),
    ):
        assert told.up == "z"
        np.testing.assert_allclose(told.positions, as_is.positions, atol=1e-9)
    with pytest.raises(ClipError, match="up axis 'w' is not one of"):
        canonicalise(replace(clip, up="w"), motion, rig)


@pytest.mark.parametrize("axis", ["z", "-z", "-y"])
def test_zero_pose_and_motion_together_tell_the_up_axis(axis: str) -> None:
    rig = replace(RIGS["canonical"], rest=Rest.ZERO)
    _, world, positions = made_motion(4, scale=0.1)
    as_is = canonicalise(*clip_of(world, positions * 100), rig)
    turn = conjugate(turn_to_y_up(axis))
    # The zero pose is turned as the motion is: positions turn, and with them every joint's rotation is turned on both
    # sides.
    turned = SolvedMotion(rotate(turn, positions * 100), *[multiply(multiply(turn, world), conjugate(turn))] * 2)
    clip, _ = clip_of(world, positions)
    told = canonicalise(clip, turned, rig)
    assert told.up == axis
    assert f"up is {axis}, by the body" in told.notes
    np.testing.assert_allclose(told.positions, as_is.positions, atol=1e-9)
    assert_same_rotations(told, world_rotations(as_is.rotations))
    assert canonicalise(clip, turned, rig, up="y").up == "y"
    assert canonicalise(replace(clip, up="y"), turned, rig).up == "y"
    # Who lies in the motion and stands in the zero pose lies, and a root that lifts a zero pose that lies says nothing.
    on_the_ground = rotate(turn, positions * 100)
    on_the_ground[..., 1] -= on_the_ground[..., 1].min()
    for lying in (
        SolvedMotion(on_the_ground, *[multiply(turn, world)] * 2),
        SolvedMotion(positions * 100, *[multiply(world, conjugate(turn))] * 2),
    ):
        motion = canonicalise(clip, lying, rig)
        assert motion.up == "y"
        assert not any("by the body" in note for note in motion.notes if "unit" not in note)


@pytest.mark.parametrize("axis", ["z", "-z"])
def test_a_body_on_its_feet_tells_the_up_axis_where_it_would_lie_below_the_ground(axis: str) -> None:
    """The zero pose stands along y and the root turns it: as many a file is written by programs whose up is z."""
    rig = replace(RIGS["canonical"], rest=Rest.ZERO)
    _, world, positions = made_motion(4, scale=0.02)
    positions = positions - positions[:, :1] * (1.0, 0.0, 1.0)
    positions[..., 1] -= positions[..., 1].min(axis=1, keepdims=True)
    clip, _ = clip_of(world, positions)
    turn = conjugate(turn_to_y_up(axis))

    def told(moved: tuple[float, float, float]) -> str:
        """The up axis of a file whose body stands along `axis`, moved in its frames by shares of a metre."""
        at = rotate(turn, positions) + np.array(moved)
        return canonicalise(clip, SolvedMotion(at * 100, *[multiply(turn, world)] * 2), rig).up

    sign = -1.0 if axis == "-z" else 1.0
    assert told((0.0, -0.1, 0.0)) == axis
    assert told((0.0, 3.0, 0.0)) == axis  # above the ground, were y up
    assert told((0.0, -0.1, sign * 1.0)) == "y"  # its feet stand on nothing
    lowest = float(rotate(turn, positions)[..., 1].min())
    assert told((0.0, -lowest, 0.0)) == "y"  # it may lie on the ground


@pytest.mark.parametrize("axis", ["z", "-z", "-y"])
def test_the_zero_pose_tells_the_up_axis_of_a_body_that_lies_flat(axis: str) -> None:
    rig = replace(RIGS["canonical"], rest=Rest.ZERO)
    _, world, positions = made_motion(4, scale=0.02)
    clip, _ = clip_of(world, positions)
    turn = conjugate(turn_to_y_up(axis))

    def told(lies: Float64Array) -> str:
        """The up axis of a file whose zero pose stands along `axis`, and whose body lies so."""
        rotations = multiply(multiply(lies, world), conjugate(turn))
        return canonicalise(clip, SolvedMotion(rotate(lies, positions * 100), *[rotations] * 2), rig).up

    on_its_back = from_axis_angle(np.full(3, 3**-0.5), -120.0)  # long along x, its front along y
    assert told(multiply(turn, on_its_back)) == axis
    if axis != "-y":  # a root that turns the zero pose onto y: who lies there says nothing
        assert told(on_its_back) == "y"
    on_one_side = from_axis_angle(np.array([0.0, 0.0, 1.0]), 90.0)
    assert told(multiply(turn, on_one_side)) == "y"


@pytest.mark.parametrize("unit", [*UNITS.values(), CMU])
@pytest.mark.parametrize("said", [None, 1e-4, 50.0])
def test_a_unit_that_nobody_says_or_that_makes_no_person_is_found_by_body_height(
    unit: float, said: float | None
) -> None:
    _, world, positions = made_motion(4)
    rig = replace(RIGS["canonical"], metres_per_unit=said)
    clip, motion = clip_of(world, positions / unit)
    found = canonicalise(clip, motion, rig)
    assert found.metres_per_unit == unit
    assert f"unit {unit:g} m, by body height" in found.notes
    np.testing.assert_allclose(found.positions, positions, atol=1e-9)
    with pytest.raises(ClipError, match=r"body height .* say --unit"):
        canonicalise(clip, motion, rig, metres_per_unit=unit / 1000)


@pytest.mark.parametrize(("supposed", "metres", "kept"), [(0.01, 0.7, True), (0.01, 0.58, False), (0.056, 2.4, False)])
def test_a_unit_that_joint_names_suggest_is_kept_where_a_person_is_as_tall(
    supposed: float, metres: float, kept: bool
) -> None:
    _, world, positions = made_motion(4)
    clip, motion = clip_of(world, positions)
    height = canonicalise(clip, motion, RIGS["canonical"], metres_per_unit=1.0).body_height
    clip, motion = clip_of(world, positions * (metres / supposed / height))
    rig = replace(RIGS["canonical"], metres_per_unit=supposed)
    found = canonicalise(clip, motion, rig)
    assert found.metres_per_unit == (supposed if kept else 0.0254)
    assert any("by body height" in note for note in found.notes) != kept
    # What the file says, or the user, is believed of bodies that are no person's.
    for believed in (
        canonicalise(replace(clip, metres_per_unit=supposed), motion, rig),
        canonicalise(clip, motion, rig, metres_per_unit=supposed),
    ):
        assert believed.metres_per_unit == supposed
        assert believed.body_height == pytest.approx(metres)


def test_a_body_of_no_size_has_no_unit() -> None:
    _, world, positions = made_motion(4)
    clip, motion = clip_of(world, positions * 1e-5)
    with pytest.raises(ClipError, match="unit is unknown"):
        canonicalise(clip, motion, replace(RIGS["canonical"], metres_per_unit=None))


@pytest.mark.recordings
@pytest.mark.parametrize("name", SETS)
def test_units_of_recordings_are_found_by_body_height(recordings: Path, name: str) -> None:
    for path in sample(recordings, name):
        clip = read_clips(path)[0]
        rig = identify(clip.hierarchy.joints, RIGS)
        motion = solve(clip)
        known = canonicalise(clip, motion, rig).metres_per_unit
        unsaid = replace(rig, metres_per_unit=None)
        assert canonicalise(replace(clip, metres_per_unit=None), motion, unsaid).metres_per_unit == pytest.approx(known)


@pytest.mark.parametrize(("joint", "distance"), [(0, 1001.0), (8, -1001.0), (20, 1e200), (3, np.inf)])
def test_a_joint_that_goes_absurdly_far_is_refused(joint: int, distance: float) -> None:
    _, world, positions = made_motion(6)
    positions += [3e6, 0, 0]
    clip, motion = clip_of(world, positions)
    assert canonicalise(clip, motion, RIGS["canonical"], metres_per_unit=1.0).root[0, 0] > 2e6
    far = positions.copy()
    far[2, joint, 2] = distance
    with pytest.raises(ClipError, match=rf"^frame 2: {JOINTS[joint]} is .* m from the first frame's hips"):
        canonicalise(clip, replace(motion, positions=far), RIGS["canonical"], metres_per_unit=1.0)


def test_a_body_across_the_up_axis_is_noted() -> None:
    _, world, positions = made_motion(5)
    clip, motion = clip_of(world, positions * 100)
    assert canonicalise(clip, motion, RIGS["canonical"]).notes == ()
    lying = canonicalise(clip, motion, RIGS["canonical"], up="z")
    assert "up is y and not z" in lying.notes[0]


@pytest.mark.parametrize(("crawls", "noted"), [(False, True), (True, False)])
def test_an_animal_by_a_persons_names_is_noted(crawls: bool, noted: bool) -> None:
    body = forward_kinematics(np.zeros((1, 3)), np.tile(IDENTITY, (1, len(JOINTS), 1)), made_offsets())[0]
    trunk = [joint for joint in JOINTS if not any(part in joint for part in ("knee", "ankle", "toe", "hip"))]
    laid = body.copy()
    laid[[INDEX[joint] for joint in trunk]] = body[[INDEX[joint] for joint in trunk]][:, [0, 2, 1]]
    for side in ("left", "right"):
        shoulder = laid[INDEX[f"{side}_shoulder"]]
        for joint, share in (("elbow", 0.5), ("wrist", 1.0)):
            laid[INDEX[f"{side}_{joint}"]] = [shoulder[0], share * body[INDEX[f"{side}_ankle"], 1], shoulder[2]]
        if crawls:
            knee = laid[INDEX[f"{side}_knee"]]
            laid[INDEX[f"{side}_ankle"]] = knee + np.array([0, 0.02, -0.35])
            laid[INDEX[f"{side}_wrist"], 1] = knee[1]
    positions = np.repeat(laid[None], 5, axis=0)
    clip, motion = clip_of(np.tile(IDENTITY, (5, len(JOINTS), 1)), positions)
    notes = canonicalise(clip, motion, replace(RIGS["canonical"], rest=Rest.ZERO), metres_per_unit=1.0).notes
    assert any("on all fours" in note for note in notes) == noted


@settings(max_examples=30, deadline=None)
@given(yaw=st.floats(-3, 3), pitch=st.floats(-1.2, 1.2))
def test_facing_is_the_yaw_of_the_body(yaw: float, pitch: float) -> None:
    turned = quaternions(Rotation.from_euler("YX", [yaw, pitch]))
    local = np.tile(IDENTITY, (4, len(JOINTS), 1))
    local[:, 0] = turned
    np.testing.assert_allclose(facing(forward_kinematics(np.zeros((4, 3)), local, made_offsets())), yaw, atol=1e-9)


def test_facing_of_a_body_on_its_side_is_that_of_the_nearest_frame() -> None:
    turns = Rotation.from_euler("YZ", [[1.0, 0.0], [1.0, np.pi / 2], [0.2, np.pi / 2], [0.5, 0.0]])
    local = np.tile(IDENTITY, (4, len(JOINTS), 1))
    local[:, 0] = quaternions(turns)
    positions = forward_kinematics(np.zeros((4, 3)), local, made_offsets())
    np.testing.assert_allclose(facing(positions), [1.0, 1.0, 0.5, 0.5], atol=1e-6)
    np.testing.assert_allclose(facing(positions[1:3]), 0.0)


@cache
def recorded(recordings: Path, name: str) -> list[CanonicalMotion]:
    motions = []
    for path in sample(recordings, name):
        for clip in read_clips(path):
            motions.append(canonicalise(clip, solve(clip), identify(clip.hierarchy.joints, RIGS)))
    return motions


def assert_bones_point_along_rotations(motion: CanonicalMotion, but: set[str]) -> None:
    """The invariant of the canonical skeleton: G_j * canonical direction = the bone's true direction."""
    world = world_rotations(motion.rotations)
    for name, (child, direction) in BONES.items():
        if name in but or name in motion.filled:
            continue
        bone = motion.positions[:, INDEX[child]] - motion.positions[:, INDEX[name]]
        expected = rotate(world[:, INDEX[name]], np.array(direction)) * np.linalg.norm(bone, axis=-1, keepdims=True)
        assert np.abs(bone - expected).max() < 1e-3, name


@pytest.mark.recordings
@pytest.mark.parametrize("name", SETS)
def test_recorded_bodies_are_sound(recordings: Path, name: str) -> None:
    rig = RIGS[SETS[name].rig]
    for motion in recorded(recordings, name):
        assert PLAUSIBLE[0] < motion.body_height < PLAUSIBLE[1]
        assert motion.twist == (rig.rest is not Rest.POSITIONS)
        assert np.isfinite(motion.rotations).all()
        assert (np.sum(motion.rotations[1:] * motion.rotations[:-1], axis=-1) >= 0).all()
        np.testing.assert_allclose(np.linalg.norm(motion.rotations, axis=-1), 1.0, atol=1e-9)
        np.testing.assert_array_equal(motion.positions[:, 0], motion.root)
        assert_bones_point_along_rotations(motion, COLLAPSED.get(rig.name, set()))


@pytest.mark.recordings
@pytest.mark.parametrize(
    ("name", "mean", "largest"),
    [
        ("cmu_dance", 1e-9, 1e-9), ("bandai1", 1e-9, 1e-9),  # rigid, joint for joint
        ("hdm05", 0.015, 0.06), ("cmu_86", 0.005, 0.06),
        ("cmu_exercises", 0.006, 0.06), ("cmu_bvh", 0.015, 0.15),
        ("utd_mhad", 0.06, 0.5),  # a Kinect's bones change their length
    ],
)  # fmt: skip
def test_rotations_and_offsets_give_the_recorded_positions(
    recordings: Path, name: str, mean: float, largest: float
) -> None:
    """Where a source has more spine and neck joints than the canonical body, some centimetres are lost."""
    motions = recorded(recordings, name)
    for motion in motions:
        again = forward_kinematics(motion.root, motion.rotations, motion.rest_offsets)
        errors = np.linalg.norm(again - motion.positions, axis=-1)
        assert motion.fk_error == pytest.approx(errors.max(), abs=1e-12)
        assert motion.fk_error_mean == pytest.approx(errors.mean(), abs=1e-12)
    assert max(motion.fk_error_mean for motion in motions) < mean
    assert max(motion.fk_error for motion in motions) < largest


@pytest.mark.recordings
@pytest.mark.parametrize("name", SETS)
def test_left_is_left_and_feet_point_forwards(recordings: Path, name: str) -> None:
    """Left hip and shoulder lie to the left of where the toes point; a swapped or mirrored rig fails."""
    forwards, lefts = [], []
    for motion in recorded(recordings, name):
        yaw = facing(motion.positions)
        ahead = np.stack([np.sin(yaw), np.zeros_like(yaw), np.cos(yaw)], axis=-1)
        left = np.stack([np.cos(yaw), np.zeros_like(yaw), -np.sin(yaw)], axis=-1)
        for side in ("left", "right"):
            foot = motion.positions[:, INDEX[f"{side}_toe"]] - motion.positions[:, INDEX[f"{side}_ankle"]]
            forwards.append(np.sum(foot * ahead, axis=-1))
        arms = motion.positions[:, INDEX["left_shoulder"]] - motion.positions[:, INDEX["right_shoulder"]]
        lefts.append(np.sum(arms * left, axis=-1))
    assert np.mean(np.concatenate(forwards) > 0) > 0.8
    assert np.mean(np.concatenate(lefts) > 0) > 0.98


HINGES = {
    "left_knee": (1, 0, 0), "right_knee": (1, 0, 0), "left_elbow": (0, -1, 0), "right_elbow": (0, 1, 0),
}  # fmt: skip


@pytest.mark.recordings
@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("joint", HINGES)
def test_knees_and_elbows_bend_about_the_same_axis_in_every_rig(recordings: Path, name: str, joint: str) -> None:
    """Flexion by more than 35 degrees: knees about +x, elbows straight forward from the T-pose."""
    q = np.concatenate([motion.rotations[:, INDEX[joint]] for motion in recorded(recordings, name)])
    vectors = np.asarray(Rotation.from_quat(q, scalar_first=True).as_rotvec())
    size = np.linalg.norm(vectors, axis=-1)
    bent = size > 0.6
    assert bent.any()
    axis = np.median(vectors[bent] / size[bent, None], axis=0)
    axis /= np.linalg.norm(axis)
    largest = 25 if SETS[name].rig == "kinect_v1" else 10
    assert np.rad2deg(np.arccos(axis @ np.array(HINGES[joint]))) < largest


@pytest.mark.recordings
def test_a_t_pose_of_an_asf_skeleton_is_the_canonical_one_but_for_its_hinges(recordings: Path) -> None:
    """The zero pose spreads the legs by 20 degrees and turns the elbows' hinges by 30."""
    clip = read_clips(recordings / "cmu_86/clips/86_01.amc")[0]
    still = replace(clip, channels=np.zeros_like(clip.channels[:2]))
    motion = canonicalise(still, solve(still), RIGS["cmu_asf"])
    turned = angle(motion.rotations[0], IDENTITY)
    assert turned[INDEX["left_hip"]] == pytest.approx(20, abs=0.01)
    assert turned[INDEX["right_shoulder"]] < 40
    for joint in ("hips", "chest", "left_knee", "right_knee", "left_elbow", "right_elbow"):
        assert turned[INDEX[joint]] < 5, joint
    assert abs(motion.rotations[0, INDEX["left_ankle"], 3]) < 0.01


@pytest.mark.recordings
@pytest.mark.parametrize("name", ["cmu_dance", "bandai1"])
def test_an_exported_motion_reads_back_the_same(recordings: Path, tmp_path: Path, name: str) -> None:
    motion = recorded(recordings, name)[0]
    write_bvh(to_source_clip(motion), tmp_path / "out.bvh")
    (clip,) = read_clips(tmp_path / "out.bvh")
    rig = identify(clip.hierarchy.joints, RIGS)
    assert rig.name == "canonical"
    again = canonicalise(clip, solve(clip), rig)
    assert np.abs(again.positions - motion.positions).max() < 1e-5 * motion.body_height
    assert angle(again.rotations, motion.rotations).max() < 1e-4
    assert again.fps == pytest.approx(motion.fps, rel=1e-4)
    assert again.body_height == pytest.approx(motion.body_height, rel=1e-5)


def test_local_and_world_rotations_are_inverse() -> None:
    _, world, _ = made_motion(6)
    assert angle(world_rotations(local_rotations(world)), world).max() < 1e-4


@pytest.mark.parametrize("name", ["hdm05", "cmu_bvh", "cmu_dance"])
def test_joints_turned_together_are_the_same_bits_as_one_by_one(recordings: Path, name: str) -> None:
    clip = read_clips(sample(recordings, name)[0])[0]
    motion, rng = solve(clip), np.random.default_rng(0)
    binding = rest.bind(identify(clip.hierarchy.joints, load_rigs()), clip.hierarchy)
    lacking = replace(binding, source={k: v for k, v in binding.source.items() if JOINTS[k] != "left_wrist"})
    in_rest = Rotation.random(len(JOINTS), rng=rng).as_quat(scalar_first=True)
    placed = rng.standard_normal((len(JOINTS), 3))
    assert motion.world is not None
    for bound in (binding, lacking):
        world, swings = np.empty((len(motion.world), len(JOINTS), 4)), np.tile(IDENTITY, (len(JOINTS), 1))
        for joint, parent in enumerate(PARENTS):
            world[:, joint] = world[:, parent]
            if joint in bound.source:
                own = np.ascontiguousarray(motion.world[:, bound.source[joint]])
                world[:, joint] = multiply(own, conjugate(in_rest[joint]))
        np.testing.assert_array_equal(canonical._world_rotations(bound, motion.world, in_rest), world)
        for bone, (child, direction) in BONES.items():
            if INDEX[bone] in bound.source:
                swings[INDEX[bone]] = swing(placed[INDEX[child]] - placed[INDEX[bone]], np.array(direction))
        for side in ("left", "right"):
            swings[INDEX[f"{side}_wrist"]] = swings[INDEX[f"{side}_elbow"]]
        np.testing.assert_array_equal(rest._swings(placed, bound), swings)
    axes = Rotation.random(rng=rng).as_matrix()
    for _ in range(2):
        np.testing.assert_array_equal(rest._from_axes(axes.tobytes()), from_matrix(axes))
