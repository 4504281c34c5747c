"""Rig maps: what is shipped is whole, what is recorded is recognised, what is unknown is explained."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from motionlake.errors import ClipError, UserError
from motionlake.formats import read_clips
from motionlake.motion.auto_rig import first_map
from motionlake.motion.clip import ChannelKind, Hierarchy
from motionlake.motion.kinematics import solve
from motionlake.motion.rest import bind
from motionlake.motion.rigs import RigMap, bare_names, identify, load_rigs, parse_rig
from motionlake.motion.skeleton import INDEX, JOINTS, PARENTS
from motionlake.motion.starter import guess_joints, starter_map

from tests.rig_samples import SETS, sample

RIGS = load_rigs()


@pytest.mark.parametrize("rig", RIGS.values(), ids=RIGS.keys())
def test_a_shipped_rig_recognises_its_own_joints_under_any_namespace(rig: RigMap) -> None:
    names = (*rig.joints.values(), *rig.known)
    assert identify(names, RIGS) is rig
    assert identify([f"mixamorig:{name}" for name in names], RIGS) is rig
    assert identify([f"Character1_{name}" for name in names], RIGS) is rig


@pytest.mark.recordings
@pytest.mark.parametrize("name", SETS)
def test_recordings_are_recognised(recordings: Path, name: str) -> None:
    for path in sample(recordings, name):
        for clip in read_clips(path):
            assert identify(clip.hierarchy.joints, RIGS).name == SETS[name].rig


def test_an_unknown_rig_is_told_with_the_closest_and_its_missing_joints() -> None:
    names = ["foot_tip" if name == "lfoot" else name for name in RIGS["cmu_asf"].joints.values()]
    with pytest.raises(
        ClipError, match=r"closest known one is cmu_asf, but the file lacks its joints lfoot; .*motionlake rig"
    ):
        identify(names, RIGS)


def test_a_named_rig_is_taken_where_it_fits() -> None:
    names = tuple(RIGS["smpl"].joints.values())
    assert identify(names, RIGS, "smpl").name == "smpl"
    assert identify(names, RIGS, "bandai").name == "smpl"
    with pytest.raises(ClipError, match=r"^rig bandai does not fit: the file has no joint Hips, Spine"):
        identify(names[:9], RIGS, "bandai")
    with pytest.raises(UserError, match=r"--rig nobody: no such rig; there are bandai"):
        identify(names, RIGS, "nobody")


def test_a_user_map_is_added_and_one_of_the_same_name_replaces(tmp_path: Path) -> None:
    text = (Path(__file__).parents[1] / "pipeline/motion/rigs/smpl.toml").read_text()
    (tmp_path / "mine.toml").write_text(text.replace('hips = "pelvis"', 'hips = "basin"'))
    rigs = load_rigs(tmp_path)
    assert rigs.keys() == RIGS.keys()
    assert rigs["smpl"].joints["hips"] == "basin"
    assert load_rigs(tmp_path / "absent") == RIGS


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('hips = "pelvis"', "", "canonical joint hips"),
        ('neck = "neck"', 'nekk = "neck"', "canonical joint neck"),
        ('neck = "neck"', 'neck = "neck"\nnekk = "n"', "'nekk' is no canonical joint"),
        ('neck = "neck"', 'neck = "head"', "'head' stands for two"),
        ('up = "y"', 'up = "north"', "'north'"),
        ("metres_per_unit = 1.0", "metres_per_unit = -1.0", "not positive"),
        ("metres_per_unit = 1.0", "", "no key 'metres_per_unit'"),
        ('rest = "zero"', 'rest = "sitting"', "sitting"),
        ('rest = "zero"', "rest = zero", "Invalid value"),
        ('rest = "zero"', "rest = 'zero'\nrests = 1", "unknown key 'rests'"),
    ],
)
def test_a_faulty_map_is_told_in_one_line(old: str, new: str, told: str) -> None:
    text = (Path(__file__).parents[1] / "pipeline/motion/rigs/smpl.toml").read_text()
    assert old in text
    with pytest.raises(UserError, match=r"rig map mine\.toml: ") as caught:
        parse_rig(text.replace(old, new, 1), "mine.toml")
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_namespaces_are_stripped_but_not_sides() -> None:
    assert bare_names(["mixamorig:Hips", "mixamorig:LeftArm"]) == ["hips", "leftarm"]
    assert bare_names(["Model_Hips", "Model_Left_Arm"]) == ["hips", "left_arm"]
    assert bare_names(["left_hip", "right_hip", "hips"]) == ["left_hip", "right_hip", "hips"]
    assert bare_names(["joint_Root", "Hips", "Spine"]) == ["joint_root", "hips", "spine"]


@pytest.mark.recordings
@pytest.mark.parametrize("name", SETS)
def test_starter_maps_of_recordings_load_and_find_the_limbs(recordings: Path, name: str) -> None:
    clip = read_clips(sample(recordings, name)[0])[0]
    hierarchy = clip.hierarchy
    starter = parse_rig(first_map(hierarchy, solve(clip)), "starter")
    assert identify(hierarchy.joints, {"my_rig": starter}) is starter
    known = identify(hierarchy.joints, RIGS)
    same = [joint for joint, source in known.joints.items() if starter.joints.get(joint) == source]
    assert len(same) >= 16
    assert {"hips", "left_shoulder", "right_elbow", "left_hip", "right_knee", "left_ankle"} <= set(same)


@pytest.mark.parametrize("spelt", ["CC_{}", "Model:{}", "{}", "a_{}_b", "x|CC_{}"])
def test_a_starter_map_is_of_its_own_file(spelt: str) -> None:
    offsets = np.zeros((len(JOINTS), 3))
    hierarchy = Hierarchy(
        tuple(spelt.format(joint) for joint in JOINTS), PARENTS, offsets, ((),) * len(JOINTS), ChannelKind.POSITIONS,
        np.tile(np.array([1.0, 0, 0, 0]), (len(JOINTS), 1)),
    )  # fmt: skip
    starter = parse_rig(starter_map(hierarchy, guess_joints(hierarchy)), "starter")
    assert identify(hierarchy.joints, {"my_rig": starter}) is starter
    assert bind(starter, hierarchy).source == {INDEX[joint]: INDEX[joint] for joint in JOINTS}


def test_a_starter_map_of_nonsense_still_loads() -> None:
    """Names that say nothing: everything but the root is filled, for a person to mend."""
    parents = PARENTS
    hierarchy = Hierarchy(
        tuple(f"J{i}" for i in range(len(JOINTS))),
        parents,
        np.zeros((len(JOINTS), 3)),
        ((),) * len(JOINTS),
        ChannelKind.POSITIONS,
        np.tile(np.array([1.0, 0, 0, 0]), (len(JOINTS), 1)),
    )
    starter = parse_rig(starter_map(hierarchy, guess_joints(hierarchy)), "starter")
    assert starter.joints == {"hips": "J0"}
    assert set(starter.filled) == set(JOINTS) - {"hips"}
    named = Hierarchy(JOINTS, parents, hierarchy.offsets, hierarchy.channels, hierarchy.kind, hierarchy.axes)
    assert guess_joints(named) == INDEX
