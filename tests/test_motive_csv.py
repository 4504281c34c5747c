"""Exports of OptiTrack Motive, written on their own and worked out with SciPy: bones, markers, gaps, damage."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
from motionlake.errors import ClipError
from motionlake.formats import is_clip, read_clips, reader_for
from motionlake.motion.canonicalise import canonicalise
from motionlake.motion.kinematics import solve
from motionlake.motion.rigs import identify, load_rigs
from motionlake.motion.rotations import angle
from motionlake.motion.skeleton import INDEX
from scipy.spatial.transform import Rotation

from tests.damage import damaged_bytes
from tests.marker_samples import motive_skeleton, motive_text
from tests.samples import plug_in_gait_markers, swinging_body
from tests.test_damaged_files import EXTRA_MEMORY, SECONDS_PER_FILE, limited_memory, limited_time

HEIGHT = 1.6


def written(folder: Path, text: str) -> Path:
    path = folder / "take.csv"
    path.write_text(text)
    return path


def assert_like(path: Path, rotation: str = "Quaternion", who: str = "Bob") -> None:
    """The clip stands and turns as the bones that SciPy has placed."""
    (clip,) = read_clips(path)
    motion = solve(clip)
    assert motion.world is not None
    assert clip.fps == 120.0
    for _, name, _, numbers in motive_skeleton(40, who):
        bone = name.partition(":")[2]
        joint = clip.hierarchy.joints.index("Hip" if bone == who else bone)
        place = np.column_stack([numbers[f"Position {axis}"] for axis in "XYZ"])
        assert np.linalg.norm(motion.positions[:, joint] - place, axis=1).max() < 1e-3 * HEIGHT, bone
        turn = np.column_stack([numbers[f"Rotation {axis}"] for axis in "WXYZ"])
        assert angle(motion.world[:, joint], turn).max() < 0.01, bone


@pytest.mark.parametrize("parents", [True, False])
@pytest.mark.parametrize("rotation", ["Quaternion", "XYZ"])
def test_bones_stand_and_turn_as_they_were_written(rotation: str, parents: bool, tmp_path: Path) -> None:
    text = motive_text(motive_skeleton(40, rotation=rotation), rotation=rotation, parents=parents)
    path = written(tmp_path, text)
    assert_like(path)
    (clip,) = read_clips(path)
    motion = canonicalise(clip, solve(clip), identify(clip.hierarchy.joints, load_rigs()))
    assert motion.twist
    assert motion.fk_error < 1e-3 * HEIGHT
    assert clip.repaired == 0
    assert not any("zero pose" in note for note in motion.notes)
    knee = next(numbers for _, name, _, numbers in motive_skeleton(40) if name == "Bob:LShin")
    np.testing.assert_allclose(motion.positions[:, INDEX["left_knee"], 1], knee["Position Y"], atol=1e-4)


def test_units_are_those_of_the_header(tmp_path: Path) -> None:
    things = motive_skeleton(40)
    for _, _, _, numbers in things:
        for axis in "XYZ":
            numbers[f"Position {axis}"] = numbers[f"Position {axis}"] * 1000
    assert_like(written(tmp_path, motive_text(things, unit="Millimeters")))
    with pytest.raises(ClipError, match="Length Units is 'Cubits'"):
        read_clips(written(tmp_path, motive_text(things, unit="Cubits")))


def test_the_rate_is_that_of_the_export(tmp_path: Path) -> None:
    text = motive_text(motive_skeleton()).replace("Export Frame Rate,120.000000", "Export Frame Rate,60.000000")
    (clip,) = read_clips(written(tmp_path, text))
    assert clip.fps == 60.0
    with pytest.raises(ClipError, match="Export Frame Rate is 'fast', not a number"):
        read_clips(written(tmp_path, text.replace("Export Frame Rate,60.000000", "Export Frame Rate,fast")))


def test_every_skeleton_is_a_clip(tmp_path: Path) -> None:
    things = [*motive_skeleton(12, "Ann"), *motive_skeleton(12, "Bob")]
    extra = ("Marker", "Unlabeled 12", "", {f"Position {axis}": np.zeros(12) for axis in "XYZ"})
    clips = read_clips(written(tmp_path, motive_text([*things, extra])))
    assert [clip.body for clip in clips] == ["1", "2"]
    assert [clip.notes[0] for clip in clips] == ["subject Ann", "subject Bob"]
    np.testing.assert_array_equal(clips[0].channels, clips[1].channels)


@pytest.mark.parametrize("rotation", ["Quaternion", "XYZ"])
def test_gaps_are_filled_and_counted(rotation: str, tmp_path: Path) -> None:
    things = motive_skeleton(40, rotation=rotation)
    (whole,) = read_clips(written(tmp_path, motive_text(things, rotation=rotation)))
    for _, name, _, numbers in things:
        if name in ("Bob:LShin", "Bob:Head"):
            for values in numbers.values():
                values[10:14] = np.nan
    (clip,) = read_clips(written(tmp_path, motive_text(things, rotation=rotation)))
    assert clip.repaired == 4
    assert "4 of 40 frames had missing joints, interpolated" in clip.notes
    assert np.abs(solve(clip).positions - solve(whole).positions).max() < 0.02


def test_rotations_in_a_gap_go_evenly(tmp_path: Path) -> None:
    things = motive_skeleton(3)
    numbers = next(numbers for _, name, _, numbers in things if name == "Bob:Head")
    for frame, degrees in ((0, 10.0), (2, 50.0)):
        turn = Rotation.from_euler("Y", degrees, degrees=True).as_quat()
        for axis, value in zip("XYZW", turn if frame else -turn, strict=True):
            numbers[f"Rotation {axis}"][frame] = value
    for values in numbers.values():
        values[1] = np.nan
    (clip,) = read_clips(written(tmp_path, motive_text(things)))
    world = solve(clip).world
    assert world is not None
    wanted = Rotation.from_euler("Y", 30.0, degrees=True).as_quat(scalar_first=True)
    assert angle(world[1, clip.hierarchy.joints.index("Head")], wanted) < 0.01


def test_local_bones_are_put_together(tmp_path: Path) -> None:
    things = motive_skeleton(40)
    world = {
        name: (
            Rotation.from_quat(np.column_stack([numbers[f"Rotation {axis}"] for axis in "XYZW"])),
            np.column_stack([numbers[f"Position {axis}"] for axis in "XYZ"]),
        )
        for _, name, _, numbers in things
    }
    local = []
    for kind, name, parent, numbers in things:
        above = "Bob:Bob" if parent == "Bob:Hip" else parent
        turn, place = world[name]
        if above:
            turn, place = world[above][0].inv() * turn, world[above][0].inv().apply(place - world[above][1])
        numbers = {f"Rotation {axis}": turn.as_quat()[:, at] for at, axis in enumerate("XYZW")}
        numbers |= {f"Position {axis}": place[:, at] for at, axis in enumerate("XYZ")}
        local.append((kind, name, parent, numbers))
    text = motive_text(local).replace("Coordinate Space,Global", "Coordinate Space,Local")
    assert_like(written(tmp_path, text))


def test_markers_alone_become_joints(tmp_path: Path) -> None:
    names, places = plug_in_gait_markers(swinging_body(40))
    places[5:8, 4] = np.nan
    things = [
        ("Marker", f"Ann:{name}", "", {f"Position {axis}": places[:, at, of] for of, axis in enumerate("XYZ")})
        for at, name in enumerate(names)
    ]
    (clip,) = read_clips(written(tmp_path, motive_text(things)))
    assert clip.notes[:2] == ("subject Ann", "joints from markers: plug_in_gait")
    assert clip.repaired == 3
    assert clip.up == "y"
    knee = clip.hierarchy.joints.index("right_knee_centre")
    np.testing.assert_allclose(solve(clip).positions[:, knee], places[:, names.index("RKNE")], atol=1e-5)


def test_other_exports_are_rejected(tmp_path: Path) -> None:
    numbers = {f"Position {axis}": np.zeros(12) for axis in "XYZ"}
    for kind, name, reason in (
        ("Rigid Body", "Ball", "no skeleton and no labelled markers, but Rigid Body"),
        ("Marker", "Unlabeled 3", "no labelled markers"),
        ("Marker", "Ann:Elbow", "fit no marker set"),
        ("Bone", "Ann:Thing", "no known skeleton's"),
    ):
        with pytest.raises(ClipError, match=reason):
            read_clips(written(tmp_path, motive_text([(kind, name, "", numbers)], parents=False)))


def test_what_is_wrong_is_said_with_its_line(tmp_path: Path) -> None:
    lines = motive_text(motive_skeleton()).splitlines()
    assert lines[8].startswith("0,")
    for number, line, reason in (
        (10, lines[10] + ",1.0", "line 11: the row has \\d+ fields, not \\d+"),
        (10, lines[10].replace(".", "x", 5), "line 11: .* is no number"),
        (7, "Time", "no line that begins with Frame"),
        (19, "", "12 frames declared, but the file is cut short"),
    ):
        changed = [*lines[:number], line, *lines[number + 1 :]]
        with pytest.raises(ClipError, match=reason):
            read_clips(written(tmp_path, "\n".join(changed) + "\n"))


def test_other_tables_are_no_clips(tmp_path: Path) -> None:
    path = tmp_path / "labels.csv"
    path.write_text("file,label\nwalk.bvh,walk\n")
    assert not is_clip(path)
    take = tmp_path / "take.csv.gz"
    take.write_bytes(gzip.compress(motive_text(motive_skeleton()).encode()))
    reader = reader_for(take)
    assert is_clip(take)
    assert reader is not None
    assert reader.name == "Motive CSV"


def test_damaged_files_are_read_or_rejected(tmp_path: Path) -> None:
    path, reasons = tmp_path / "take.csv", []
    for data in damaged_bytes(motive_text(motive_skeleton()).encode(), 200, seed=12):
        path.write_bytes(data)
        try:
            with limited_memory(EXTRA_MEMORY), limited_time(SECONDS_PER_FILE):
                read_clips(path)
        except ClipError as error:
            reasons.append(str(error))
    assert 40 < len(reasons) < 200
    assert not any("\n" in reason or "Error:" in reason for reason in reasons), reasons
