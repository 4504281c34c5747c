"""`motionlake rig`: what it says of known, solved and rejected rigs, and the skeletons that it draws."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.formats.bvh import READER
from motionlake.formats.write.bvh import write_bvh
from motionlake.motion.auto_rig import LIMBS, first_map, match_rig
from motionlake.motion.clip import SourceClip
from motionlake.motion.kinematics import solve
from motionlake.motion.rest import bind
from motionlake.motion.rig_evidence import KINDS
from motionlake.motion.rig_joints import joints_of, rig_joints
from motionlake.motion.rigs import identify, load_rigs, parse_rig
from motionlake.motion.skeleton import INDEX, JOINTS
from motionlake.motion.starter import guess_joints
from motionlake.pictures.skeleton import DrawnSkeleton, _spaced, seen_from, skeleton_figure

from tests.hidden_maps import numbered
from tests.lakes import motionlake
from tests.rig_bodies import walker


def written(clip: SourceClip, path: Path) -> Path:
    write_bvh(clip, path)
    return path


def test_a_solved_rig_is_told_with_its_joints_and_how_sure_they_are(tmp_path: Path) -> None:
    found = motionlake("rig", written(numbered(walker("deepmimic")), tmp_path / "walk.bvh"), "--json").json
    assert found["rig"].startswith("auto:")
    joints = {joint["canonical"]: joint for joint in found["joints"]}
    assert set(joints) >= set(LIMBS)
    assert joints.keys() | set(found["filled"]) == set(JOINTS)
    assert all(joint["how"] == "solved" and 0 < joint["confidence"] <= 1 for joint in joints.values())
    assert set(joints["left_knee"]["evidence"]) == set(KINDS)
    assert (found["missing"], found["doubt"]) == ([], None)


def test_a_known_rig_is_told_with_its_joints(tmp_path: Path) -> None:
    found = motionlake("rig", written(walker("unreal"), tmp_path / "walk.bvh"), "--json").json
    assert (found["rig"], found["sides"], found["doubt"]) == ("unreal", None, None)
    assert {joint["how"] for joint in found["joints"]} == {"map"}
    assert "upperarm_twist_01_l" in found["unmatched"]


def test_a_rejected_rig_is_told_and_drawn(tmp_path: Path) -> None:
    table = "HIERARCHY\nROOT Table\n{\nOFFSET 0 70 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
    for i, (x, z) in enumerate([(-50, -30), (50, -30), (-50, 30), (50, 30)]):
        table += f"JOINT Leg{i}\n{{\nOFFSET {x} 0 {z}\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
        table += "End Site\n{\nOFFSET 0 -70 0\n}\n}\n"
    file, drawn = tmp_path / "table.bvh", tmp_path / "table.png"
    still = "MOTION\nFrames: 2\nFrame Time: 0.1\n" + 2 * ("0 " * 15 + "\n")
    file.write_text(table + "}\n" + still, encoding="utf-8")
    run = motionlake("rig", file, "--json", "--picture", drawn)
    assert run.json["rig"] is None
    assert run.json["doubt"] == "no joint is clearly the hips"
    assert run.json["unmatched"] == ["Table", "Leg0", "Leg1", "Leg2", "Leg3"]
    assert run.json["missing"] == list(JOINTS)
    assert drawn.read_bytes().startswith(b"\x89PNG")
    refused = motionlake("ingest", file, "--lake", tmp_path / "lake")
    assert "no joint is clearly the hips; `motionlake rig FILE --picture skeleton.png` draws it" in refused.err


@pytest.mark.parametrize("suffix", [".png", ".html"])
def test_a_picture_is_written(tmp_path: Path, suffix: str) -> None:
    drawn = tmp_path / f"skeleton{suffix}"
    run = motionlake("rig", written(walker("rokoko"), tmp_path / "walk.bvh"), "--picture", drawn)
    assert (run.status, run.out.startswith("rokoko")) == (0, True)
    content = drawn.read_bytes()
    assert content.startswith(b"\x89PNG" if suffix == ".png" else b"<!DOCTYPE html>")
    if suffix == ".html":
        assert b"<td>LeftThigh</td><td>left_hip</td>" in content


def test_mistakes_about_pictures_are_said_in_a_line(tmp_path: Path) -> None:
    file = written(walker("unity"), tmp_path / "walk.bvh")
    for words in ((file, "--picture", tmp_path / "skeleton.gif"), ("--picture", tmp_path / "skeleton.png")):
        run = motionlake("rig", *words)
        assert (run.status, run.err.count("\n")) == (2, 1)
        assert "--picture" in run.err


def test_every_joint_is_named_and_canonical_ones_have_the_colour_of_their_side() -> None:
    clip = walker("smplx")
    rig = load_rigs()["smplx"]
    names = clip.hierarchy.joints
    joints = rig_joints(names, rig)
    found = {joint.canonical: names.index(joint.joint) for joint in joints if joint.joint and joint.canonical}
    front, side, seen = seen_from(solve(clip).positions, found)
    assert seen == ("from the front", "from its left, facing right")
    # The left is on the viewer's right, the head above the feet, the toes ahead of the heels.
    assert front[found["left_hip"], 0] > front[found["right_hip"], 0]
    assert front[found["head"], 1] > front[found["left_ankle"], 1]
    assert side[found["left_toe"], 0] > side[found["left_ankle"], 0]
    figure = skeleton_figure(DrawnSkeleton(names, clip.hierarchy.parents, front, side, seen, joints), "title")
    texts = [text.get_text() for text in figure.texts]
    for joint in joints:
        if joint.joint is not None:
            words = f" = {joint.canonical.replace('_', ' ')}" if joint.canonical else ""
            assert f"{joint.joint}{words}" in texts


def test_an_animal_is_drawn_as_it_stands_from_the_side() -> None:
    clip = walker("unity")
    match = match_rig(clip.hierarchy, solve(clip))
    lying = solve(clip).positions[..., [0, 2, 1]] * [0.2, 1.0, 1.0]
    _, side, seen = seen_from(lying, match.joints, np.array([0.0, 1.0, 0.0]))
    assert seen == ("from its left, facing right", "from the front")
    assert len(side) == len(clip.hierarchy.joints)


@given(st.lists(st.floats(-5, 5), max_size=12))
def test_names_keep_their_order_and_a_row_of_room(wanted: list[float]) -> None:
    rows = _spaced(sorted(wanted), -3.0, 3.0)
    assert all(later - row > 0.16 for row, later in pairwise(rows))
    assert all(-3.0 <= row <= 3.0 for row in rows)


NAMES = st.lists(st.sampled_from(["Hand", "hand", "a:Hand", "b:Hand", "Hand.2", "L_Leg", "l_leg", "x", "CC_x"]))


@settings(max_examples=60, deadline=None)
@given(NAMES, st.randoms(use_true_random=False))
def test_a_printed_map_is_always_of_its_own_file(names: list[str], random: object) -> None:
    """Also where joints bear one name, or names that differ by case or namespace alone."""
    clip = walker("unity")
    assert hasattr(random, "randrange")
    joints = list(clip.hierarchy.joints)
    for name in names:
        joints[random.randrange(len(joints))] = name
    text = "HIERARCHY\n" + "".join(_tree(clip, joints, 0)) + "MOTION\nFrames: 2\nFrame Time: 0.1\n"
    row = " ".join(["0"] * 3 * len(joints)) + "\n"
    (read,) = READER.read((text + row + row).encode(), Path("x.bvh"))
    motion = solve(read)
    starter = parse_rig(first_map(read.hierarchy, motion), "starter")
    assert identify(read.hierarchy.joints, {"my_rig": starter}) is starter
    match = match_rig(read.hierarchy, motion)
    if match.joints:
        assert bind(starter, read.hierarchy).source == {INDEX[joint]: at for joint, at in match.joints.items()}
        told = joints_of(read.hierarchy.joints, match.joints, match)
        assert len({joint.joint for joint in told if joint.joint}) == len(joints)


def test_a_leg_that_the_other_hangs_from_is_the_hips() -> None:
    """By names alone: a joint stands for one joint of the skeleton."""
    clip = walker("unity")
    joints = ["x" if "left" in name.lower() and "leg" in name.lower() else name for name in clip.hierarchy.joints]
    assert joints != list(clip.hierarchy.joints)
    guesses = guess_joints(replace(clip.hierarchy, joints=("L_Leg", *joints[1:])))
    assert guesses["hips"] == 0
    assert "right_hip" in guesses
    assert len(set(guesses.values())) == len(guesses)


def _tree(clip: SourceClip, names: list[str], joint: int) -> list[str]:
    x, y, z = clip.hierarchy.offsets[joint]
    children = [child for child, parent in enumerate(clip.hierarchy.parents) if parent == joint]
    return [
        f"{'JOINT' if joint else 'ROOT'} {names[joint]}\n{{\nOFFSET {x} {y} {z}\n",
        "CHANNELS 3 Zrotation Xrotation Yrotation\n",
        *(line for child in children for line in _tree(clip, names, child)),
        "}\n",
    ]
