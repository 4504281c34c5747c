"""Rigs that solve themselves: known maps hidden, with the names of files and with numbers for names."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats import read_clips
from motionlake.motion.auto_rig import LIMBS, NOTE, auto_rig, match_rig, notes_of, rig_of
from motionlake.motion.canonicalise import canonicalise
from motionlake.motion.clip import ChannelKind, Hierarchy, SolvedMotion, SourceClip
from motionlake.motion.kinematics import solve
from motionlake.motion.rig_evidence import KINDS
from motionlake.motion.rig_solver import solve_rig
from motionlake.motion.rigs import identify, load_rigs
from motionlake.motion.rigs_config import RigsConfig
from motionlake.motion.skeleton import JOINTS, chained

from tests.hidden_maps import found_again, judged_ways, places, without
from tests.lakes import motionlake
from tests.rig_bodies import RIGS as BODIES
from tests.rig_bodies import walker
from tests.rig_samples import SETS, sample
from tests.samples import KINECT_1, KINECT_1_PARENTS, npz_bytes, swinging_body


def test_every_rig_is_hidden_from_the_solver_once() -> None:
    made = {names.rig or name for name, names in BODIES.items()}
    assert made | {each.rig for each in SETS.values()} == load_rigs().keys()


@pytest.mark.recordings
@pytest.mark.parametrize("name", SETS)
def test_hidden_maps_are_found_again(recordings: Path, name: str) -> None:
    """With names 95 % of joints and all limbs; with numbers 90 % of limbs, for Kinect's feet may not tell the sides."""
    clips = [clip for path in sample(recordings, name) for clip in read_clips(path)]
    assert {identify(clip.hierarchy.joints, load_rigs()).name for clip in clips} == {SETS[name].rig}
    named, unnamed = ([found_again(clip, each) for clip in clips] for each in (True, False))
    assert np.mean([right for joints, _ in named for right in joints]) >= 0.95
    assert all(right for _, limbs in named for right in limbs)
    assert np.mean([right for _, limbs in unnamed for right in limbs]) >= 0.9


@pytest.mark.parametrize("name", BODIES)
def test_hidden_maps_of_rigs_without_recordings_are_found_again(name: str) -> None:
    clip = walker(name)
    assert identify(clip.hierarchy.joints, load_rigs()).name == (BODIES[name].rig or name)
    joints, limbs = found_again(clip, named=True)
    assert np.mean(joints) >= 0.95
    assert all(limbs)
    _, unnamed = found_again(clip, named=False)
    assert np.mean(unnamed) >= 0.9


@pytest.mark.recordings
@pytest.mark.parametrize("name", ["bandai1", "utd_mhad", "cmu_bvh"])
def test_joints_are_where_the_known_map_has_them(recordings: Path, name: str) -> None:
    clip = read_clips(sample(recordings, name)[0])[0]
    motion = solve(clip)
    rig = auto_rig(clip.hierarchy, motion)
    assert rig.name.startswith("auto:")
    assert rig.name == auto_rig(clip.hierarchy, motion).name
    by_itself = canonicalise(clip, motion, rig)
    known = canonicalise(clip, motion, identify(clip.hierarchy.joints, load_rigs()))
    apart = np.linalg.norm(by_itself.positions - known.positions, axis=-1)
    measured = [joint for joint in range(apart.shape[1]) if apart[:, joint].max() < 1e-3]
    assert len(measured) >= len(places(clip))


# Joint, parent, offset: y up, z to where the body faces, x to its left.
Tree = list[tuple[str, int, tuple[float, float, float]]]


def tree(bones: Tree) -> Hierarchy:
    offsets = np.array([offset for _, _, offset in bones], dtype=np.float64)
    parents = tuple(parent for _, parent, _ in bones)
    axes = np.tile([1.0, 0, 0, 0], (len(bones), 1))
    channels = (("Xrotation", "Yrotation", "Zrotation"),) * len(bones)
    return Hierarchy(tuple(name for name, _, _ in bones), parents, offsets, channels, ChannelKind.EULER, axes)


def body(*, spines: int, clavicles: bool, toes: bool, buttocks: bool, fingers: int) -> tuple[Hierarchy, dict[str, int]]:
    """A person in a T-pose with more joints or fewer, the knees a little bent, and what its joints are."""
    bones: Tree = [("j0", -1, (0, 0.9, 0))]
    truth = {"hips": 0}

    def add(parent: int, offset: tuple[float, float, float], part: str | None = None) -> int:
        bones.append((f"j{len(bones)}", parent, offset))
        if part:
            truth[part] = len(bones) - 1
        return len(bones) - 1

    for side, x in (("right", -1), ("left", 1)):
        start = add(0, (0.03 * x, -0.02, 0)) if buttocks else 0
        hip = add(start, (0.07 * x, -0.05, 0), f"{side}_hip")
        knee = add(hip, (0, -0.4, 0.03), f"{side}_knee")
        ankle = add(knee, (0, -0.38, -0.03), f"{side}_ankle")
        if toes:
            add(ankle, (0, -0.05, 0.13), f"{side}_toe")
    last = 0
    for i in range(spines):
        last = add(last, (0, 0.4 / spines, 0), "spine" if i == 0 and spines > 1 else None)
    truth["chest"] = last
    neck = add(last, (0, 0.12, 0), "neck")
    head = add(neck, (0, 0.1, 0.01), "head")
    for x in (-1, 1) if fingers else ():
        add(head, (0.03 * x, 0.05, 0.08))
    for side, x in (("right", -1), ("left", 1)):
        start = add(last, (0.03 * x, 0.08, 0), f"{side}_clavicle") if clavicles else last
        shoulder = add(start, (0.14 * x, 0.02 if clavicles else 0.1, 0), f"{side}_shoulder")
        elbow = add(shoulder, (0.28 * x, 0, 0), f"{side}_elbow")
        wrist = add(elbow, (0.25 * x, 0, 0), f"{side}_wrist")
        for finger in range(fingers):
            place = add(wrist, (0.08 * x, 0, 0.02 * finger))
            for _ in range(2):
                place = add(place, (0.03 * x, 0, 0))
    return tree(bones), truth


@pytest.mark.parametrize("spines", [1, 2, 3, 7])
@pytest.mark.parametrize("clavicles", [True, False])
@pytest.mark.parametrize("toes", [True, False])
@pytest.mark.parametrize("buttocks", [True, False])
@pytest.mark.parametrize("fingers", [0, 5])
def test_bodies_of_more_joints_and_fewer(
    spines: int, clavicles: bool, toes: bool, buttocks: bool, fingers: int
) -> None:
    hierarchy, truth = body(spines=spines, clavicles=clavicles, toes=toes, buttocks=buttocks, fingers=fingers)
    assert solve_rig(hierarchy, [None] * len(hierarchy.joints)) == truth


def test_an_end_site_stands_for_a_wrist_and_a_sole_for_no_toe() -> None:
    """Forearms that end in an end site, and feet whose end site goes straight on from the shin."""
    hierarchy, truth = body(spines=2, clavicles=True, toes=False, buttocks=False, fingers=0)
    short, _, kept = without(hierarchy, still(hierarchy), {truth["left_wrist"], truth["right_wrist"]})
    ends = [(truth[f"{side}_elbow"], (0.25 * x, 0.0, 0.0)) for side, x in (("right", -1.0), ("left", 1.0))]
    soles = [(truth[f"{side}_ankle"], (0.0, -0.08, 0.0)) for side in ("right", "left")]
    short = replace(short, end_sites=tuple((kept.index(joint), at) for joint, at in (*ends, *soles)))
    places_of_joints = chained(short.offsets, short.parents)[None].repeat(3, axis=0)
    identity = np.tile([1.0, 0.0, 0.0, 0.0], (3, len(kept), 1))
    rig = auto_rig(short, SolvedMotion(places_of_joints, identity, identity))
    elbow = short.joints[kept.index(truth["left_elbow"])]
    assert rig.joints["left_elbow"] == elbow
    assert rig.filled["left_wrist"].end_site == elbow
    assert rig.filled["left_toe"].offset is not None


def test_fingers_part_at_the_wrist_where_a_joint_of_the_palm_lies_in_it() -> None:
    """Between the wrist and a finger a joint in the place of the wrist, as Perception Neuron's hands have it."""
    hierarchy, truth = body(spines=2, clavicles=True, toes=True, buttocks=False, fingers=0)
    bones = list(zip(hierarchy.joints, hierarchy.parents, map(tuple, hierarchy.offsets), strict=True))
    for side, x in (("left", 1), ("right", -1)):
        wrist = truth[f"{side}_wrist"]
        bones += [(f"{side}{wrist}", wrist, (0.08 * x, 0.0, 0.02)), (f"{side}p", wrist, (0.001 * x, 0.0, 0.004))]
        palm = len(bones) - 1
        bones += [(f"{side}1", palm, (0.09 * x, 0.0, 0.0)), (f"{side}2", palm, (0.03 * x, 0.0, 0.02))]
    found = solve_rig(tree(bones), [None] * len(bones))
    assert {part: found[part] for part in truth} == truth


def test_a_known_rig_whose_feet_end_is_not_that_of_feet_that_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """Names as Perception Neuron has them, and a joint of another name after each foot."""
    known = BODIES["perception_neuron"]
    monkeypatch.setitem(BODIES, "goes on", replace(known, leg=(*known.leg, "ForeFoot")))
    clip = walker("goes on")
    motion = solve(clip)
    found = rig_of(clip, motion, load_rigs())
    assert found.name.startswith("auto:")
    assert (found.joints["left_toe"], found.joints["right_toe"]) == ("LeftForeFoot", "RightForeFoot")
    with pytest.raises(ClipError, match="LeftFoot has no end site"):
        canonicalise(clip, motion, rig_of(clip, motion, load_rigs(), "perception_neuron"))


def test_end_sites_tell_where_a_body_without_toes_faces() -> None:
    """Straight legs, stretched a little too far, and no names: the feet's end sites outweigh the knees."""
    hierarchy, truth = body(spines=2, clavicles=True, toes=False, buttocks=False, fingers=0)
    offsets = hierarchy.offsets.copy()
    for side in ("left", "right"):
        offsets[truth[f"{side}_knee"], 2], offsets[truth[f"{side}_ankle"], 2] = -0.01, 0.01
    ends = tuple((truth[f"{side}_ankle"], (0.0, -0.05, 0.15)) for side in ("left", "right"))
    feet = replace(hierarchy, offsets=offsets, end_sites=ends)
    at = still(feet).positions
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (*at.shape[:2], 1))
    match = match_rig(feet, SolvedMotion(at, turns, turns))
    assert match.joints == truth
    assert match.evidence["left_hip"]["motion"] > 0.9
    assert match_rig(feet, still(feet)).joints["left_hip"] == truth["right_hip"]


def test_most_names_of_a_limb_say_its_side() -> None:
    hierarchy, truth = body(spines=2, clavicles=True, toes=True, buttocks=False, fingers=0)
    names = list(hierarchy.joints)
    for joint, place in truth.items():
        if "_" in joint:
            names[place] = joint
    names[truth["left_knee"]] = "right_shin"  # one name that is wrong, in the place that pairs limbs
    named = replace(hierarchy, joints=tuple(names))
    match = match_rig(named, still(named))
    assert match.joints == truth
    assert match.evidence["left_hip"]["side"] == 0.5
    assert match.evidence["left_elbow"]["side"] == 1.0


def test_confidence_is_made_of_named_evidence() -> None:
    hierarchy, truth = body(spines=2, clavicles=True, toes=True, buttocks=False, fingers=0)
    sure = match_rig(hierarchy, still(hierarchy))
    assert not sure.doubt
    assert set(sure.evidence["left_knee"]) == set(KINDS)
    assert all(-1 <= value <= 1 for said in sure.evidence.values() for value in said.values())
    assert min(map(sure.confidence, sure.joints)) > 0.8
    # A name of another joint, and a bone that no person has, each make it less sure.
    knee = truth["left_knee"]
    misnamed = replace(hierarchy, joints=(*hierarchy.joints[:knee], "left_finger_2", *hierarchy.joints[knee + 1 :]))
    odd = match_rig(misnamed, still(misnamed))
    assert odd.evidence["left_knee"]["name"] == -1
    assert odd.confidence("left_knee") < sure.confidence("left_knee")
    offsets = hierarchy.offsets.copy()
    offsets[[truth["left_ankle"], truth["right_ankle"]]] *= 0.4
    short = replace(hierarchy, offsets=offsets)
    assert match_rig(short, still(short)).confidence("left_ankle") < sure.confidence("left_ankle")


def test_a_clip_is_rejected_below_the_confidence_asked_for_and_doubtful_sides_are_told() -> None:
    hierarchy, truth = body(spines=2, clavicles=True, toes=False, buttocks=False, fingers=0)
    offsets = hierarchy.offsets.copy()
    offsets[:, 2] = 0  # legs and arms are straight, and nothing points forward
    flat = replace(hierarchy, offsets=offsets)
    match = match_rig(flat, still(flat))
    assert not match.doubt
    assert match.sides == pytest.approx(0.5)
    assert notes_of(match) == (NOTE, "left and right are in doubt: 50% sure")
    refused = match_rig(flat, still(flat), RigsConfig(least_confidence=0.6))
    knee = flat.joints[truth["left_knee"]]
    assert f"in doubt are left hip ({flat.joints[truth['left_hip']]}, " in refused.doubt
    assert f"left knee ({knee}, " in refused.doubt
    clip = SourceClip(flat, np.zeros((3, 3 * len(flat.joints))), 30.0)
    assert rig_of(clip, still(flat), load_rigs()).name == auto_rig(flat, still(flat)).name


def test_confidence_tells_right_joints_from_wrong_ones() -> None:
    """Over all made bodies: what is sure is right, and what is unsure is often wrong."""
    bodies = [judged_ways(walker(name), seed) for seed, name in enumerate(BODIES)]
    for way, least in (("names", 0.99), ("numbers", 0.99), ("damaged names", 0.99), ("a joint missing", 0.93)):
        found = [each for ways in bodies for each in ways[way]]
        sure = [right for confidence, right in found if confidence >= 0.9]
        assert np.mean(sure) >= least, way
        assert len(sure) >= 0.5 * len(found), way
    missing = [each for ways in bodies for each in ways["a joint missing"]]
    assert np.mean([right for confidence, right in missing if confidence < 0.3]) < 0.5


def still(hierarchy: Hierarchy) -> SolvedMotion:
    places_of_joints: Float64Array = chained(hierarchy.offsets, hierarchy.parents)
    return SolvedMotion(places_of_joints[None].repeat(3, axis=0), None, None)


def test_what_is_no_person_is_refused() -> None:
    person, _ = body(spines=3, clavicles=True, toes=True, buttocks=False, fingers=0)
    auto_rig(person, still(person))
    snake = tree([(f"j{i}", i - 1, (0, 0.1, 0)) for i in range(5000)])
    with pytest.raises(ClipError, match="no joint is clearly the hips"):
        auto_rig(snake, still(snake))
    # An animal on four legs: the trunk lies, what the person has as arms stands.
    offsets = person.offsets.copy()
    for joint in range(1, len(person.joints)):
        if not any(offsets[joint, :1]) and offsets[joint, 1] > 0:
            offsets[joint] = offsets[joint][[0, 2, 1]]
    lying = replace(person, offsets=offsets)
    with pytest.raises(ClipError, match="never stands"):
        auto_rig(lying, still(lying))
    twins = replace(person, joints=("hips", *["joint"] * (len(person.joints) - 1)))
    with pytest.raises(ClipError, match="two joints are called joint"):
        auto_rig(twins, still(twins))
    spaced = replace(person, joints=tuple(f"Armature|Bone.{i:03}" for i in range(len(person.joints))))
    auto_rig(spaced, still(spaced))
    contrary = replace(person, joints=tuple(f"front_leg_{i}" for i in range(len(person.joints))))
    with pytest.raises(ClipError, match="is where the left shoulder should be"):
        auto_rig(contrary, still(contrary))


def test_known_maps_come_first_and_the_reason_says_both() -> None:
    person, _ = body(spines=3, clavicles=True, toes=True, buttocks=False, fingers=0)
    clip = SourceClip(person, np.zeros((3, 3 * len(person.joints))), 30.0)
    assert set(LIMBS) <= set(rig_of(clip, still(person), load_rigs()).joints)
    snake = tree([(f"j{i}", i - 1, (0, 0.1, 0)) for i in range(20)])
    with pytest.raises(ClipError, match=r"unknown rig: .* it was not solved by itself: no joint is clearly the hips"):
        rig_of(replace(clip, hierarchy=snake), still(snake), load_rigs())


def test_a_clip_of_an_unknown_rig_goes_in_and_is_told(tmp_path: Path) -> None:
    source, lake = tmp_path / "shots", tmp_path / "lake"
    source.mkdir()
    marks = ["_L" if name.endswith("Left") else "_R" if name.endswith("Right") else "" for name in KINECT_1]
    names = [f"n{i}{mark}" for i, mark in enumerate(marks)]
    (source / "take.npz").write_bytes(npz_bytes(swinging_body(40), names, KINECT_1_PARENTS, 30.0))
    assert motionlake("ingest", source, "--lake", lake).status == 0
    rows = motionlake("sql", "SELECT rig, notes FROM clips", "--json", "--lake", lake).json
    assert rows[0]["rig"].startswith("auto:")
    assert NOTE in rows[0]["notes"]
    starter = motionlake("rig", source / "take.npz").out
    assert 'left_knee = "n13_L"' in starter
    told = motionlake("sql", "FROM rig_joints ORDER BY ALL", "--json", "--lake", lake).json
    knee = next(row for row in told if row["canonical"] == "left_knee")
    assert (knee["joint"], knee["how"], set(knee["evidence"])) == ("n13_L", "solved", set(KINDS))
    assert knee["confidence"] > 0.8
    assert {row["canonical"] for row in told if row["canonical"]} == set(JOINTS)
    assert {row["joint"] for row in told if row["joint"]} == set(names)
    filled = motionlake("sql", "SELECT unnest(filled) AS joint FROM clips", "--json", "--lake", lake).json
    assert {row["canonical"] for row in told if row["how"] == "filled"} == {row["joint"] for row in filled}
    # Its map is nowhere but in its tree, which is solved again where frames come back from raw channels.
    (source / "take.npz").unlink()
    for part in lake.glob("frames/*/*.parquet"):
        part.unlink()
    repaired = motionlake("repair", "--json", "--lake", lake)
    assert repaired.status == 0, repaired.err
    assert motionlake("verify", "--deep", "--lake", lake).status == 0
    assert motionlake("sql", "FROM rig_joints ORDER BY ALL", "--json", "--lake", lake).json == told


def test_the_confidence_asked_for_is_a_setting_of_the_lake(tmp_path: Path) -> None:
    source, lake = tmp_path / "shots", tmp_path / "lake"
    source.mkdir()
    names = [f"n{i}" for i in range(len(KINECT_1))]
    (source / "take.npz").write_bytes(npz_bytes(swinging_body(40), names, KINECT_1_PARENTS, 30.0))
    lake.mkdir()
    config = lake / "config.toml"
    config.write_text("[rigs]\nleast_confidence = 0.999\n", encoding="utf-8")
    refused = motionlake("ingest", source, "--lake", lake)
    assert "it was not solved by itself: in doubt are hips (n0, " in refused.err
    assert "`motionlake rig FILE --picture skeleton.png` draws it" in refused.err
    config.write_text("", encoding="utf-8")
    taken = motionlake("ingest", source, "--lake", lake)
    assert "[rigs] in config.toml changed" in taken.err
    assert taken.status == 0
