"""ASF/AMC: forward kinematics against the HDM05 authors' own, finding skeletons, refusing broken files."""

from __future__ import annotations

import gzip
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.errors import ClipError
from motionlake.formats import companions, is_clip, read_clips
from motionlake.formats.asf import parse_asf
from motionlake.formats.asf_amc import READER, find_skeleton
from motionlake.motion.clip import SourceClip
from motionlake.motion.kinematics import solve
from motionlake.motion.rotations import from_euler, rotate
from scipy.spatial.transform import Rotation

ASF = """# a comment
:version 1.10
:name VICON
:units
  mass 1.0
  length 0.45
  angle deg
:documentation
   root lhip begin end
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
  begin
     id 1
     name hip
     direction 0 -1 0
     length 2
     axis 0 0 20 XYZ
     dof rz rx
     limits (-160.0 20.0)
            (-70.0 70.0)
  end
  begin
     id 2
     name still
     direction 1 0 0
     length 3
     axis 0 0 0 XYZ
  end
  begin
     id 3
     name foot
     direction 0 0 1
     length 1.5
     axis 10 20 30 XYZ
     dof rx ry rz
  end
:hierarchy
  begin
    still foot
    root still hip
  end
"""
AMC = """#!OML:ASF X:\\f\xfcr Bonn\\a b.ASF
:FULLY-SPECIFIED
:DEGREES
1
root 1 2 3 10 20 30
hip 1.5 -2
foot 5 6.25 7e-1
2
root 1 2 3.5 10 20 30
hip 1.5 -3
foot 5 6 7
"""


def write(folder: Path, amc: str = AMC, asf: str = ASF, name: str = "a b.asf") -> Path:
    (folder / name).write_text(asf, "latin-1")
    path = folder / "clip_01.amc"
    path.write_text(amc, "latin-1")
    return path


def read(path: Path) -> SourceClip:
    (clip,) = read_clips(path)
    return clip


@pytest.mark.recordings
def test_positions_are_those_of_the_hdm05_authors(recordings: Path) -> None:
    oracles = sorted((recordings / "hdm05" / "oracle").glob("*.mat"))
    assert len(oracles) == 25
    for oracle in oracles:
        motion = scipy.io.loadmat(oracle, squeeze_me=True, struct_as_record=False)["mot"]
        expected = dict(zip(motion.boneNames, motion.jointTrajectories, strict=True))
        (path,) = (recordings / "hdm05" / "clips").rglob(oracle.name.removesuffix(".mat"))
        clip = read(path)
        tree, solved = clip.hierarchy, solve(clip)
        assert solved.world is not None
        # Theirs are the ends of bones, in inches; ours are the starts, and end sites.
        for j, parent in enumerate(tree.parents):
            bone = "root" if j == 0 else tree.joints[parent]
            np.testing.assert_allclose(solved.positions[:, j] / 0.45, expected[bone].T, atol=1e-4, rtol=0)
        for j, offset in tree.end_sites:
            end = solved.positions[:, j] + rotate(solved.world[:, j], np.array(offset))
            np.testing.assert_allclose(end / 0.45, expected[tree.joints[j]].T, atol=1e-4, rtol=0)


@pytest.mark.recordings
def test_recordings_hold_what_a_plain_split_finds(recordings: Path) -> None:
    paths = [*sorted(recordings.glob("hdm05/**/*.amc"))[::60], recordings / "cmu_86" / "clips" / "86_01.amc"]
    for path in paths:
        clip = read(path)
        bones = [f"{name}." for name in clip.hierarchy.joints]
        rows: list[dict[str, list[float]]] = []
        for line in path.read_text("latin-1").splitlines():
            words = line.split()
            if len(words) == 1 and words[0].isdigit():
                rows.append({})
            elif rows:
                rows[-1][words[0]] = [float(word) for word in words[1:]]
        expected = [[v for bone in bones for v in row.get(bone[:-1], [])] for row in rows]
        np.testing.assert_array_equal(clip.channels, expected)
        assert clip.fps == 120
        assert clip.metres_per_unit == pytest.approx(0.0254 / 0.45)


def test_a_small_file_is_read_in_full(tmp_path: Path) -> None:
    clip = read(write(tmp_path))
    tree = clip.hierarchy
    assert tree.joints == ("root", "still", "foot", "hip")
    assert tree.parents == (-1, 0, 1, 0)
    assert tree.offsets.tolist() == [[0, 0, 0], [0, 0, 0], [3, 0, 0], [0, 0, 0]]
    assert tree.channels[3] == ("Zrotation", "Xrotation")
    assert tree.channels[1] == ()
    assert tree.end_sites == ((2, (0.0, 0.0, 1.5)), (3, (0.0, -2.0, 0.0)))
    assert tree.fixed_axes
    np.testing.assert_allclose(tree.axes[2], from_euler(np.array([10.0, 20, 30]), "XYZ", fixed=True))
    assert clip.channels[0].tolist() == [1, 2, 3, 10, 20, 30, 5, 6.25, 0.7, 1.5, -2]
    axis = Rotation.from_euler("xyz", [10, 20, 30], degrees=True)
    turn = Rotation.from_euler("xyz", [5, 6.25, 0.7], degrees=True)
    local = solve(clip).local
    assert local is not None
    found = Rotation.from_quat(local[0, 2], scalar_first=True)
    assert (found.inv() * axis * turn * axis.inv()).magnitude() < 1e-12


@pytest.mark.parametrize(
    ("amc", "asf"),
    [
        (AMC.replace("\n", "\r\n"), ASF.replace("\n", "\r\n")),
        (AMC.rstrip("\n"), ASF.rstrip("\n")),
        (AMC.replace(" ", "\t").replace("a\tb", "a b").replace("ASF\tX", "ASF X"), ASF.replace(" ", "\t")),
        (AMC.replace("\n1\n", "\n# made by hand\n\n41\n").replace("\n2\n", "\n42\n\n"), ASF),
        (AMC.replace("hip 1.5 -3\nfoot 5 6 7", "foot 5 6 7\nhip 1.5 -3"), ASF.replace("rz rx", "RZ RX")),
        (AMC, ASF.replace("0 -1 0", "0 -2 0")),
    ],
    ids=["crlf", "no-newline", "tabs", "numbers", "other-order", "direction-not-unit"],
)
def test_an_untidy_file_reads_the_same(tmp_path: Path, amc: str, asf: str) -> None:
    clip = read(write(tmp_path, amc, asf))
    (tmp_path / "tidy").mkdir()
    tidy = read(write(tmp_path / "tidy"))
    np.testing.assert_array_equal(clip.channels, tidy.channels)
    np.testing.assert_allclose(solve(clip).positions, solve(tidy).positions)


def test_radians_become_degrees(tmp_path: Path) -> None:
    clip = read(write(tmp_path, AMC.replace(":DEGREES", ":RADIANS")))
    expected = np.array([1, 2, 3, *np.rad2deg([10, 20, 30, 5, 6.25, 0.7, 1.5, -2])])
    np.testing.assert_allclose(clip.channels[0], expected)
    np.testing.assert_allclose(clip.hierarchy.axes[3], from_euler(np.array([20.0]), "Z"))
    radians = ASF.replace("angle deg", "angle rad").replace("0 0 20", f"0 0 {float(np.deg2rad(20))!r}")
    clip = read(write(tmp_path, AMC.replace(":DEGREES\n", ""), radians))
    np.testing.assert_allclose(clip.channels[0], expected)
    np.testing.assert_allclose(clip.hierarchy.axes[3], from_euler(np.array([20.0]), "Z"))


def test_a_bone_may_leave_its_place_and_change_its_length(tmp_path: Path) -> None:
    asf = ASF.replace("dof rx ry rz", "dof tx tz rx ry rz l")
    amc = AMC.replace("foot 5 6.25 7e-1", "foot 0.5 -1 5 6.25 7e-1 0.25").replace("foot 5 6 7", "foot 0 0 5 6 7 0")
    clip = read(write(tmp_path, amc, asf.replace("position 0 0 0", "position 0 10 0")))
    tree = clip.hierarchy
    assert tree.channels[2] == ("Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation")
    axis = Rotation.from_euler("xyz", [10, 20, 30], degrees=True)
    np.testing.assert_allclose(clip.channels[0, 6:9], np.array([3, 0, 0]) + axis.apply([0.5, 0, -1]))
    np.testing.assert_allclose(clip.channels[1, 6:12], [3, 0, 0, 5, 6, 7], atol=1e-12)
    assert clip.channels[0, :3].tolist() == [1, 12, 3]
    assert any("length of bone 'foot'" in note for note in clip.notes)


@pytest.mark.parametrize(
    ("old", "new", "line", "reason"),
    [
        ("foot 5 6.25 7e-1\n", "", 7, "'foot' is missing"),
        ("foot 5 6 7\n", "", 11, "'foot' is missing"),
        ("hip 1.5 -2", "hop 1.5 -2", 6, "'hop' is not a bone"),
        ("hip 1.5 -2", "hipp 1.5 -2", 6, "'hipp' is not a bone"),
        ("hip 1.5 -2", "still 1.5", 6, "'still' is not a bone"),
        ("hip 1.5 -2", "hip 1.5", 6, "fewer than 2 values"),
        ("hip 1.5 -2", "hip 1.5 -2 3", 6, "more than 2 values"),
        ("hip 1.5 -2", "hip 1.5 nan", 6, "'nan' is not a finite number"),
        ("hip 1.5 -2", "hip 1.5 1e999", 6, "'1e999' is not a finite number"),
        ("hip 1.5 -2", "hip 1.5 -2\nhip 1.5 -2", 7, "'hip' twice"),
        ("\n2\n", "\n3\n", 8, "next frame's number"),
        ("\n2\n", "\n2 x\n", 8, "'x' is not a bone"),
        ("\n2\n", "\n2.5\n", 8, "next frame's number"),
        ("\n1\n", "\n", 4, "next frame's number"),
        (AMC[AMC.index("1\nroot") :], "", None, "at least two"),
        (AMC[AMC.index("2\nroot") :], "", None, "at least two"),
    ],
)
def test_a_broken_amc_is_refused_with_its_line(
    tmp_path: Path, old: str, new: str, line: int | None, reason: str
) -> None:
    assert old in AMC
    with pytest.raises(ClipError, match=reason) as caught:
        read(write(tmp_path, AMC.replace(old, new, 1)))
    assert caught.value.line == line


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        (":hierarchy", ":hierarchie", "no :hierarchy"),
        ("length 0.45", "length 0", "line 6: the unit of length"),
        ("direction 0 -1 0", "direction 0 -1", "line 19: 3 number"),
        ("length 2", "length two", "line 20: 1 number"),
        ("0 0 20 XYZ", "0 0 20 XYX", "line 21: 'XYX' is not an order"),
        ("rz rx", "rz rz", "line 22: 'rz rz' are not"),
        ("name foot", "name hip", "line 40: bone 'hip' twice"),
        ("still foot\n", "still toes\n", "unknown bone 'toes'"),
        ("still foot\n", "still foot hip\n", "'hip' has two parents"),
        ("    still foot\n", "", "'foot' does not hang from the root"),
        ("still foot\n", "foot foot\n", "'foot' does not hang from the root"),
    ],
)
def test_a_broken_asf_is_refused_with_its_name_and_line(tmp_path: Path, old: str, new: str, reason: str) -> None:
    assert old in ASF
    with pytest.raises(ClipError, match=reason) as caught:
        read(write(tmp_path, asf=ASF.replace(old, new, 1)))
    assert "a b.asf" in str(caught.value)


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_damage_is_refused_or_read_but_never_crashes(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    folder = tmp_path_factory.getbasetemp() / "damage"
    folder.mkdir(exist_ok=True)
    (folder / "a b.asf").write_text(ASF)

    def damage(text: str) -> bytes:
        damaged = bytearray(text.encode("latin-1"))
        for _ in range(data.draw(st.integers(1, 3))):
            begin = data.draw(st.integers(0, len(damaged)))
            end = begin + data.draw(st.integers(0, 12))
            damaged[begin:end] = data.draw(st.one_of(st.binary(max_size=5), st.sampled_from([b"\n3\n", b"hip "])))
        return bytes(damaged)

    with suppress(ClipError):
        (clip,) = READER.read(damage(AMC), folder / "x.amc")
        assert clip.channels.shape[1] == len(clip.hierarchy.channel_names)
    with suppress(ClipError):
        parse_asf(damage(ASF), "x.asf").hierarchy()


def test_the_skeleton_is_found_by_name_and_place(tmp_path: Path) -> None:
    deep = tmp_path / "a" / "b" / "c"
    deep.mkdir(parents=True)
    clip = deep / "86_01_walk.AMC"
    with pytest.raises(ClipError, match="no skeleton"):
        find_skeleton(clip)
    (deep / "other.asf").touch()
    assert find_skeleton(clip)[0] == deep / "other.asf"
    (tmp_path / "86.asf").touch()
    assert find_skeleton(clip)[0] == tmp_path / "86.asf"
    (tmp_path / "a" / "8.asf").touch()
    assert find_skeleton(clip)[0] == tmp_path / "86.asf"
    (tmp_path / "a" / "86_01.ASF").touch()
    (tmp_path / "a" / "86_0.ASF").touch()
    assert find_skeleton(clip)[0] == tmp_path / "a" / "86_01.ASF"
    (deep / "86_01_walk.asf").touch()
    assert find_skeleton(clip)[0] == deep / "86_01_walk.asf"
    assert find_skeleton(clip, "OTHER.ASF")[0] == deep / "other.asf"
    assert find_skeleton(clip, "elsewhere.asf")[0] == deep / "86_01_walk.asf"


def test_the_skeleton_is_part_of_the_clip_but_none_itself(tmp_path: Path) -> None:
    path = write(tmp_path)
    assert companions(path) == [tmp_path / "a b.asf"]
    assert is_clip(path)
    assert not is_clip(tmp_path / "a b.asf")
    with pytest.raises(ClipError, match="no reader"):
        read_clips(tmp_path / "a b.asf")


def test_a_skeleton_that_changes_is_read_again(tmp_path: Path) -> None:
    assert read(write(tmp_path)).hierarchy.offsets[2, 0] == 3
    assert read(write(tmp_path, asf=ASF.replace("length 3", "length 4.5"))).hierarchy.offsets[2, 0] == 4.5


def test_both_files_may_be_compressed(tmp_path: Path) -> None:
    (tmp_path / "clip.asf.gz").write_bytes(gzip.compress(ASF.encode("latin-1")))
    path = tmp_path / "clip_1.amc.gz"
    path.write_bytes(gzip.compress(AMC.encode("latin-1")))
    assert read(path).channels.shape == (2, 11)
    assert companions(path) == [tmp_path / "clip.asf.gz"]
