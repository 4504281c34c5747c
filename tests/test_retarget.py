"""Motion on another character: the same pose, feet where they should stand, no limb turned over."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats import read_clips
from motionlake.motion.auto_rig import rig_of
from motionlake.motion.canonicalise import CanonicalMotion, canonicalise, to_source_clip
from motionlake.motion.character import Character, character_of, leg_length, zero_clip
from motionlake.motion.clip import POSITION_CHANNELS, QUATERNION_CHANNELS, ChannelKind, Hierarchy, SourceClip
from motionlake.motion.kinematics import solve, world_rotations
from motionlake.motion.posing import resampled
from motionlake.motion.retarget import retarget, t_pose
from motionlake.motion.rigs import Rest, load_rigs
from motionlake.motion.rotations import IDENTITY, angle, multiply, rotate
from motionlake.motion.skeleton import INDEX
from motionlake.motion.standing import contacts

from tests.characters import HERO, hero_bvh
from tests.samples import KINECT_1, KINECT_1_PARENTS, npz_bytes, swinging_body

SIDES = ("left", "right")
LIMBS = [(f"{s}_{a}", f"{s}_{b}") for s in SIDES for a, b in (("shoulder", "elbow"), ("elbow", "wrist"))]
REAL = {"hdm05": "*/*.amc", "cmu_bvh": "*.bvh", "bandai1": "*.bvh", "cmu_dance": "**/*.bvh"}


@dataclass(frozen=True)
class Taken:
    """A clip file, its motion, and who made it."""

    clip: SourceClip
    motion: CanonicalMotion
    character: Character


def taken(path: Path) -> Taken:
    clip = read_clips(path)[0]
    rig = rig_of(clip, solve(clip), load_rigs())
    return Taken(clip, canonicalise(clip, solve(clip), rig), character_of(clip, rig))


@cache
def real(recordings: Path, name: str) -> Taken:
    """A short clip of a set."""
    paths = sorted((recordings / name / "clips").glob(REAL[name]), key=lambda p: (p.stat().st_size, p.name))
    return taken(paths[len(paths) // 3])


@pytest.fixture
def hero(tmp_path: Path) -> Character:
    (tmp_path / "hero.bvh").write_text(hero_bvh())
    return taken(tmp_path / "hero.bvh").character


@pytest.fixture
def made(tmp_path: Path) -> CanonicalMotion:
    """A made motion with arms that swing, of positions alone."""
    (tmp_path / "body.npz").write_bytes(npz_bytes(swinging_body(60), KINECT_1, KINECT_1_PARENTS, 30.0))
    clip = read_clips(tmp_path / "body.npz")[0]
    return canonicalise(clip, solve(clip), load_rigs()["kinect_v1"])


def on(character: Character, clip: SourceClip) -> CanonicalMotion:
    """What a clip on a character is on the canonical skeleton."""
    rig = load_rigs()[character.rig]
    return canonicalise(clip, solve(clip), rig, metres_per_unit=character.metres_per_unit)


def misplaced(motion: CanonicalMotion, made: CanonicalMotion, character: Character) -> Float64Array:
    """[n] metres by which ankles that stand are beside where they should be: the place in the clip, by the legs' ratio.

    What is the same for all frames upwards is the height of the character's ankles over the ground.
    """
    scale = leg_length(character.rest_offsets) / leg_length(motion.rest_offsets)
    stands = contacts(motion.positions, motion.fps, motion.body_height)
    away = [
        (made.positions[:, INDEX[f"{s}_ankle"]] - scale * motion.positions[:, INDEX[f"{s}_ankle"]])[stands[:, at]]
        for at, s in enumerate(SIDES)
    ]
    every = np.concatenate(away)
    every[:, 1] -= np.median(every[:, 1])
    return np.asarray(np.linalg.norm(every, axis=1))


def test_a_made_motion_on_a_character_with_other_bones(made: CanonicalMotion, hero: Character) -> None:
    clip = retarget(made, hero)
    again = on(hero, clip)
    assert clip.fps == made.fps
    assert clip.hierarchy.channels == hero.hierarchy.channels
    for start, end in LIMBS:
        before, after = (m.positions[:, INDEX[end]] - m.positions[:, INDEX[start]] for m in (made, again))
        cosines = (before * after).sum(1) / np.linalg.norm(before, axis=1) / np.linalg.norm(after, axis=1)
        assert cosines.min() > 0.999, (start, end)
    scale = leg_length(hero.rest_offsets) / leg_length(made.rest_offsets)
    for side in SIDES:
        ankle = INDEX[f"{side}_ankle"]
        away = again.positions[:, ankle] - scale * made.positions[:, ankle]
        assert np.abs(away - away[0]).max() < 1e-3


def test_joints_that_the_canonical_skeleton_lacks(made: CanonicalMotion, hero: Character) -> None:
    clip = retarget(made, hero)
    local = solve(clip).local
    assert local is not None
    names = clip.hierarchy.joints
    for still in ("Feather", "LeftHandIndex1", "RightHandIndex1"):
        assert angle(local[:, names.index(still)], IDENTITY).max() < 1e-6
    bend = [angle(local[:, names.index(name)], IDENTITY).max() for name in ("Spine1", "Spine2")]
    assert bend[0] < 90
    assert bend[1] < 90


def test_bones_keep_their_length(made: CanonicalMotion, hero: Character) -> None:
    positions = solve(retarget(made, hero)).positions
    for name, (parent, offset) in HERO.items():
        if parent:
            joint, above = (hero.hierarchy.joints.index(each) for each in (name, parent))
            lengths = np.linalg.norm(positions[:, joint] - positions[:, above], axis=1)
            np.testing.assert_allclose(lengths, np.linalg.norm(offset), atol=1e-6)


@pytest.mark.parametrize("up", ["y", "z"])
def test_the_character_s_axes_and_unit_hold(made: CanonicalMotion, hero: Character, up: str) -> None:
    turn = multiply(np.array([1.0, 0, 0, 0]), IDENTITY) if up == "y" else np.array([0.5**0.5, 0.5**0.5, 0, 0])
    # The same character in a file with z up, in metres: its zero pose stands along z there.
    tree = Hierarchy(
        hero.hierarchy.joints, hero.hierarchy.parents, rotate(turn, hero.hierarchy.offsets) / 100,
        ((*POSITION_CHANNELS, *QUATERNION_CHANNELS), *(QUATERNION_CHANNELS,) * (len(hero.hierarchy.joints) - 1)),
        ChannelKind.QUATERNION, np.tile(IDENTITY, (len(hero.hierarchy.joints), 1)),
    )  # fmt: skip
    other = character_of(zero_clip(tree), load_rigs()["mixamo"], up=up, metres_per_unit=1.0)
    one = solve(retarget(made, hero)).positions / 100
    two = solve(retarget(made, other)).positions
    np.testing.assert_allclose(rotate(turn, one), two, atol=1e-6)


def test_the_t_pose_of_a_character(hero: Character) -> None:
    posed = t_pose(hero, np.array([1.0, 0.5, 2.0]), 30.0)
    positions = solve(posed).positions[0] / 100
    place = {name: positions[joint] for joint, name in enumerate(posed.hierarchy.joints)}
    np.testing.assert_allclose(place["LeftHand"][1], place["LeftArm"][1], atol=1e-6)
    np.testing.assert_allclose(place["Hips"][[0, 2]], [1.0, 2.0], atol=1e-6)
    assert place["LeftToeBase"][1] == pytest.approx(0.5, abs=0.005)


def test_a_clip_of_positions_is_no_character(tmp_path: Path) -> None:
    (tmp_path / "body.npz").write_bytes(npz_bytes(swinging_body(60), KINECT_1, KINECT_1_PARENTS, 30.0))
    with pytest.raises(ClipError, match="holds positions only"):
        taken(tmp_path / "body.npz")


def test_a_canonical_clip_is_its_own_character(made: CanonicalMotion) -> None:
    clip = to_source_clip(made)
    own = character_of(clip, load_rigs()["canonical"])
    again = retarget(on(own, clip), own, own)
    np.testing.assert_allclose(solve(again).positions, solve(clip).positions, atol=1e-3 * made.body_height * 100)


def test_resampled_rotations_are_those_of_the_instants(made: CanonicalMotion) -> None:
    clip = to_source_clip(made)
    half = resampled(clip, 15.0)
    np.testing.assert_allclose(solve(half).positions, solve(clip).positions[::2], atol=1e-6)
    twice = resampled(clip, 60.0)
    assert len(twice.channels) == 2 * len(clip.channels) - 1
    np.testing.assert_allclose(solve(twice).positions[::2], solve(clip).positions, atol=1e-6)


@pytest.mark.recordings
@pytest.mark.parametrize("name", REAL)
def test_a_recording_keeps_its_poses_at_half_its_rate(recordings: Path, name: str) -> None:
    of = real(recordings, name)
    half = solve(resampled(of.clip, of.clip.fps / 2)).positions
    error = np.abs(half - solve(of.clip).positions[::2]) * of.character.metres_per_unit
    assert error.max() < 1e-6


@pytest.mark.recordings
@pytest.mark.parametrize("name", REAL)
def test_a_recording_on_its_own_character_is_itself(recordings: Path, name: str) -> None:
    of = real(recordings, name)
    again = solve(retarget(of.motion, of.character, of.character)).positions
    error = np.linalg.norm(again - solve(of.clip).positions, axis=-1) * of.character.metres_per_unit
    # Between two spine or neck joints others share the turn: they are not where the recording had them.
    assert error[:, list(of.character.source.values())].max() < 1e-3 * of.motion.body_height


@pytest.mark.recordings
@pytest.mark.parametrize("name", REAL)
@pytest.mark.parametrize("target", [*REAL, "hero"])
def test_feet_stand_and_no_limb_turns_over(recordings: Path, hero: Character, name: str, target: str) -> None:
    of = real(recordings, name)
    character = hero if target == "hero" else real(recordings, target).character
    clip = retarget(of.motion, character, of.character)
    again = on(character, clip)
    assert misplaced(of.motion, again, character).max() < 0.02
    before, after = world_rotations(of.motion.rotations), world_rotations(again.rotations)
    for joint in ("shoulder", "elbow", "wrist"):
        for side in SIDES:
            turned = angle(before[:, INDEX[f"{side}_{joint}"]], after[:, INDEX[f"{side}_{joint}"]])
            assert turned.max() < 1, joint
    for joint in ("hip", "knee"):
        for side in SIDES:
            turned = angle(before[:, INDEX[f"{side}_{joint}"]], after[:, INDEX[f"{side}_{joint}"]])
            assert turned.max() < 60, joint


@pytest.mark.recordings
@pytest.mark.parametrize("name", ["hdm05", "cmu_bvh", "bandai1"])
@pytest.mark.parametrize("target", ["hdm05", "cmu_bvh", "bandai1", "hero"])
def test_there_and_back(recordings: Path, hero: Character, name: str, target: str) -> None:
    of = real(recordings, name)
    character = hero if target == "hero" else real(recordings, target).character
    there = on(character, retarget(of.motion, character, of.character))
    back = solve(retarget(there, of.character, character)).positions
    error = np.linalg.norm(back - solve(of.clip).positions, axis=-1) * of.character.metres_per_unit
    assert error[:, list(of.character.source.values())].mean() < 2e-3 * of.motion.body_height


@pytest.mark.recordings
def test_a_character_whose_zero_pose_does_not_stand(recordings: Path) -> None:
    """Without the map's rest orientations the bones of bandai's zero pose all point one way: its first frame tells."""
    of, other = real(recordings, "hdm05"), real(recordings, "bandai1")
    rig = replace(load_rigs()["bandai"], rest=Rest.ZERO, rest_orientations={})
    character = character_of(other.clip, rig)
    made = solve(retarget(of.motion, character, of.character))
    again = canonicalise(other.clip, made, rig, metres_per_unit=character.metres_per_unit)
    assert misplaced(of.motion, again, character).max() < 0.02
    for start, end in LIMBS:
        before, after = (m.positions[:, INDEX[end]] - m.positions[:, INDEX[start]] for m in (of.motion, again))
        cosines = (before * after).sum(1) / np.linalg.norm(before, axis=1) / np.linalg.norm(after, axis=1)
        assert cosines.min() > 0.95, (start, end)
