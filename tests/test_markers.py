"""Markers to joints, and TRC files: against pandas, numbers worked out by hand, and damaged files."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pandas
import pytest
from motionlake.errors import ClipError
from motionlake.formats.registry import read_clips
from motionlake.motion.canonicalise import canonicalise
from motionlake.motion.kinematics import solve
from motionlake.motion.marker_sets import (
    ARMS,
    HEAD,
    JOINT_CENTRE_PARENTS,
    JOINT_CENTRES,
    fitting_sets,
    hip_centres,
    marker_sets,
)
from motionlake.motion.rigs import identify, load_rigs
from motionlake.motion.rotations import from_axis_angle, rotate
from motionlake.motion.skeleton import INDEX

from tests.samples import plug_in_gait_markers, swinging_body, trc_text

HEADLESS_SETS = {"body_25", "hbm", "opencap", "rajagopal", "skeletal_landmarks", "skeletal_landmarks_lateral"}
LEGS_SETS = {"joint_centres_legs", "plug_in_gait_centres_legs"}
NAMES, PLACES = plug_in_gait_markers(swinging_body(40))


def written(folder: Path, text: str) -> Path:
    path = folder / "walk.trc"
    path.write_text(text)
    return path


def test_every_set_says_which_joints_it_makes() -> None:
    assert len(JOINT_CENTRES) == len(JOINT_CENTRE_PARENTS)
    assert set(load_rigs()["markers"].joints.values()) == set(JOINT_CENTRES)
    hips = {"left_hip_centre", "right_hip_centre"}
    for marker_set in marker_sets():
        made = set(marker_set.joints) | {"hip_centre"} | (hips if marker_set.pelvis else set())
        assert made | set(marker_set.unmarked) == set(JOINT_CENTRES)
        assert made.isdisjoint(marker_set.unmarked)
        lacks = (
            {HEAD, *ARMS, "left_shoulder_centre", "right_shoulder_centre"} if marker_set.name in LEGS_SETS else {HEAD}
        )
        assert set(marker_set.unmarked) == (lacks if marker_set.name in HEADLESS_SETS | LEGS_SETS else set())
        if marker_set.chest is not None:
            assert {*marker_set.chest.back, *marker_set.chest.front} == set(marker_set.joints["neck_centre"])
        assert len(set(marker_set.required)) == len(marker_set.required)
        assert fitting_sets([name.lower() for name in marker_set.required])[0] is marker_set


def test_hips_are_where_harrington_puts_them() -> None:
    # A pelvis 240 mm wide and 180 mm deep: 53.1 mm behind, 82.9 mm below and 86.5 mm beside the middle of its front.
    turn, shift = from_axis_angle(np.array([0.48, 0.8, -0.36]), 130.0), np.array([1.0, 2.0, 3.0])

    def turned(x: float, y: float, z: float) -> np.ndarray:
        return np.asarray(rotate(turn, np.array([[x, y, z]])) + shift)

    left, right = hip_centres(turned(0, 0, -0.12), turned(0, 0, 0.12), turned(-0.18, 0, 0))
    np.testing.assert_allclose(left, turned(-0.0531, -0.0829, -0.0865), atol=1e-9)
    np.testing.assert_allclose(right, turned(-0.0531, -0.0829, 0.0865), atol=1e-9)


def test_joints_are_means_of_what_pandas_reads(tmp_path: Path) -> None:
    text = trc_text(NAMES, PLACES)
    table = pandas.read_csv(io.StringIO(text), sep="\t", skiprows=5, header=None).to_numpy()[:, 2:]
    seen = dict(zip(NAMES, table.reshape(40, -1, 3).transpose(1, 0, 2) / 1000.0, strict=True))
    (clip,) = read_clips(written(tmp_path, text))
    joints = dict(zip(JOINT_CENTRES, solve(clip).positions.transpose(1, 0, 2), strict=True))
    assert clip.fps == 100.0
    assert "joints from markers: plug_in_gait" in clip.notes
    np.testing.assert_allclose(joints["left_wrist_centre"], (seen["LWRA"] + seen["LWRB"]) / 2, atol=1e-9)
    np.testing.assert_allclose(joints["right_knee_centre"], seen["RKNE"], atol=1e-9)
    np.testing.assert_allclose(joints["neck_centre"], (seen["C7"] + seen["CLAV"]) / 2, atol=1e-9)


def test_joints_stand_near_those_the_markers_were_put_on(tmp_path: Path) -> None:
    (clip,) = read_clips(written(tmp_path, trc_text(NAMES, PLACES)))
    motion = canonicalise(clip, solve(clip), load_rigs()["markers"])
    body = swinging_body(40)
    for joint, place in (("left_wrist", 6), ("right_elbow", 9), ("left_knee", 13), ("right_ankle", 18), ("hips", 0)):
        off = np.linalg.norm(motion.positions[:, INDEX[joint]] - body[:, place], axis=1)
        assert off.max() < 0.08, joint
    assert not motion.twist


def test_gaps_are_filled_and_counted(tmp_path: Path) -> None:
    holed = PLACES.copy()
    holed[10:14, NAMES.index("LKNE")] = np.nan
    holed[12:18, NAMES.index("RANK")] = 0.0
    (clip,) = read_clips(written(tmp_path, trc_text(NAMES, holed)))
    assert clip.repaired == 8
    assert "8 of 40 frames had missing joints, interpolated" in clip.notes
    (whole,) = read_clips(written(tmp_path, trc_text(NAMES, PLACES)))
    np.testing.assert_allclose(clip.channels, whole.channels, atol=1e-4)
    holed[:30, NAMES.index("LKNE")] = np.nan
    with pytest.raises(ClipError, match="LKNE is seen in 10 of 40 frames"):
        read_clips(written(tmp_path, trc_text(NAMES, holed)))


def test_two_subjects_become_two_clips(tmp_path: Path) -> None:
    both = np.concatenate([PLACES, PLACES + np.array([1.0, 0.0, 0.0])], axis=1)
    names = [f"{who}:{name}" for who in ("anna", "bert") for name in NAMES]
    one, two = read_clips(written(tmp_path, trc_text(names, both)))
    assert (one.body, two.body) == ("1", "2")
    assert "subject bert" in two.notes
    step = solve(two).positions - solve(one).positions
    np.testing.assert_allclose(step, np.broadcast_to([1.0, 0.0, 0.0], step.shape), atol=1e-4)


def test_a_file_of_no_set_names_the_nearest_and_what_lacks(tmp_path: Path) -> None:
    kept = [index for index, name in enumerate(NAMES) if name not in {"LTOE", "RPSI"}]
    text = trc_text([NAMES[index] for index in kept], PLACES[:, kept])
    with pytest.raises(ClipError, match="nearest, plug_in_gait, lacks RPSI, LTOE"):
        read_clips(written(tmp_path, text))


def keypoints(*without: str) -> tuple[list[str], np.ndarray]:
    """Keypoints of HALPE_26 on a body that swings its arms and legs, by Pose2Sim's names, metres."""
    body = swinging_body(20)
    joints = {"Neck": 2, "Head": 3, "LShoulder": 4, "LElbow": 5, "LWrist": 6, "RShoulder": 8, "RElbow": 9,
              "RWrist": 10, "LHip": 12, "LKnee": 13, "LAnkle": 14, "LBigToe": 15, "RHip": 16, "RKnee": 17,
              "RAnkle": 18, "RBigToe": 19}  # fmt: skip
    kept = {name: joint for name, joint in joints.items() if name not in without}
    return list(kept), body[:, list(kept.values())]


def test_a_body_whose_head_has_no_marker_goes_in(tmp_path: Path) -> None:
    rigs = load_rigs()
    (whole,) = read_clips(written(tmp_path, trc_text(*keypoints())))
    (clip,) = read_clips(written(tmp_path, trc_text(*keypoints("Head"))))
    assert "no marker on the head: it goes on where the trunk points" in clip.notes
    assert "joints from markers: body_25" in clip.notes
    assert "joints from markers: pose2sim" in whole.notes
    assert identify(clip.hierarchy.joints, rigs).name == "markers"
    motion = canonicalise(clip, solve(clip), rigs["markers"])
    measured = canonicalise(whole, solve(whole), rigs["markers"])
    others = [joint for joint in range(21) if joint != INDEX["head"]]
    np.testing.assert_allclose(motion.positions[:, others], measured.positions[:, others], atol=1e-9)
    assert "head" in motion.filled
    assert "head" not in measured.filled
    off = np.linalg.norm(motion.positions[:, INDEX["head"]] - measured.positions[:, INDEX["head"]], axis=1)
    assert off.max() < 0.1
    assert motion.body_height == pytest.approx(measured.body_height, rel=0.06)


def test_a_head_that_is_there_comes_before_more_markers() -> None:
    added = next(one for one in marker_sets() if one.name == "opencap").required
    names, _ = keypoints()
    assert fitting_sets([*names, *added])[0].name == "pose2sim"
    assert fitting_sets([*(name for name in names if name != "Head"), *added])[0].name == "opencap"


@pytest.mark.parametrize("declared", [39, 41, 400])
def test_all_rows_that_are_there_go_in(tmp_path: Path, declared: int) -> None:
    text = trc_text(NAMES, PLACES)
    wrong = text.replace("\t40\t", f"\t{declared}\t")
    assert wrong != text
    (clip,) = read_clips(written(tmp_path, wrong))
    (right,) = read_clips(written(tmp_path, text))
    assert f"40 frames, though the file says {declared}" in clip.notes
    np.testing.assert_array_equal(clip.channels, right.channels)


@pytest.mark.parametrize("lost", [4, 800])
def test_a_file_that_lost_its_end_is_rejected(tmp_path: Path, lost: int) -> None:
    text = trc_text(NAMES, PLACES).rstrip()[:-lost]
    with pytest.raises(ClipError, match=r"cut short|the row has"):
        read_clips(written(tmp_path, text.replace("\t40\t", "\t41\t")))


def test_commas_of_a_spreadsheet_are_tabs(tmp_path: Path) -> None:
    text = trc_text(NAMES, PLACES)
    (clip,) = read_clips(written(tmp_path, text.replace("\t", ",")))
    (right,) = read_clips(written(tmp_path, text))
    np.testing.assert_array_equal(clip.channels, right.channels)
    assert clip.fps == right.fps


def test_points_of_no_body_are_told_as_such(tmp_path: Path) -> None:
    names = [f"Box:Marker{number}" for number in range(1, 6)]
    with pytest.raises(ClipError, match=r"fit no marker set: none has any of its 5 points \(Marker1, Marker2, M"):
        read_clips(written(tmp_path, trc_text(names, PLACES[:, :5])))


def test_damaged_files_are_read_or_rejected(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    good = trc_text(NAMES, PLACES[:12]).encode()
    path = tmp_path / "walk.trc"
    reasons = []
    for _ in range(200):
        data = bytearray(good)
        start = int(rng.integers(len(data)))
        length = int(rng.integers(1, 200))
        kind = rng.integers(3)
        if kind == 0:
            del data[start : start + length]
        elif kind == 1:
            data[start : start + length] = rng.integers(0, 256, length, np.uint8).tobytes()
        else:
            data[start:start] = rng.choice([b"9" * 3000, b"1e999", b"\t", b"\n", b"-", b"nan"])
        path.write_bytes(bytes(data))
        try:
            read_clips(path)
        except ClipError as error:
            reasons.append(str(error))
    assert len(reasons) > 50
    assert not any("\n" in reason for reason in reasons)
