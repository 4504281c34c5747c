"""Reading BVH: real recordings, untidy files that are valid, broken files that must be refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.errors import ClipError
from motionlake.formats import read_clips
from motionlake.formats.bvh import READER, frame_rate
from motionlake.motion.clip import SourceClip

TIDY = """HIERARCHY
ROOT mixamorig:Hips
{
  OFFSET 0 90.5 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
  JOINT mixamorig:Arm
  {
    OFFSET 1 -2 3e-1
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 1 0
    }
  }
}
MOTION
Frames: 3
Frame Time: .0083333
0 90 0 1 2 3 4 5 6
1 91 -0 1.5 2 3 4 5 6.25
2 92 1e-3 1.5 2 3 4 5 -6.25
"""


def read(text: str | bytes) -> SourceClip:
    (clip,) = READER.read(text.encode("latin-1") if isinstance(text, str) else text, Path("x.bvh"))
    return clip


@pytest.mark.recordings
@pytest.mark.parametrize(
    ("pattern", "joints", "columns", "fps"),
    [
        ("cmu_dance/**/*.bvh", 43, 132, 120),
        ("cmu_bvh/**/*.bvh", 31, 96, 120),
        ("bandai1/**/*.bvh", 22, 132, 30),
    ],
)
def test_recordings_hold_what_a_plain_split_finds(
    recordings: Path, pattern: str, joints: int, columns: int, fps: float
) -> None:
    for path in sorted(recordings.glob(pattern))[::20][:4]:
        (clip,) = read_clips(path)
        rows = path.read_text("latin-1").partition("Frame Time:")[2].splitlines()[1:]
        expected = np.array([[float(word) for word in row.split()] for row in rows if row.strip()])
        assert len(clip.hierarchy.joints) == joints
        assert clip.fps == fps
        assert clip.channels.shape == (len(expected), columns)
        np.testing.assert_array_equal(clip.channels, expected)


def test_a_tidy_file_is_read_in_full() -> None:
    clip = read(TIDY)
    tree = clip.hierarchy
    assert tree.joints == ("mixamorig:Hips", "mixamorig:Arm")
    assert tree.parents == (-1, 0)
    assert tree.offsets.tolist() == [[0, 90.5, 0], [1, -2, 0.3]]
    assert tree.channels[1] == ("Zrotation", "Xrotation", "Yrotation")
    assert tree.end_sites == ((1, (0.0, 1.0, 0.0)),)
    assert clip.channels[2].tolist() == [2, 92, 0.001, 1.5, 2, 3, 4, 5, -6.25]
    assert clip.fps == 120


@pytest.mark.parametrize(
    "untidy",
    [
        TIDY.replace("\n", "\r\n"),
        TIDY.rstrip("\n"),
        "\n\n" + TIDY + "\n \n\t\n",
        "\ufeff".encode().decode("latin-1") + TIDY,
        TIDY.replace("Frames: ", "Frames:\t").replace("Frame Time: ", "Frame Time:\t"),
        TIDY.replace("  ", "\t").replace(" 5 ", "\t5  "),
        TIDY.replace("\n{\n", " {\n"),
        TIDY.replace("Xposition Yposition", "XPOSITION yposition").replace("End Site", "END SITE"),
        TIDY.replace("MOTION\n", "\nMOTION \n").replace("0 90 0 1", "\n 0 90 0 1"),
    ],
    ids=["crlf", "no-newline", "blank-lines", "bom", "tabs-after-colon", "tabs", "brace", "case", "spaces"],
)
def test_an_untidy_file_reads_the_same(untidy: str) -> None:
    tidy, clip = read(TIDY), read(untidy)
    np.testing.assert_array_equal(clip.channels, tidy.channels)
    np.testing.assert_array_equal(clip.hierarchy.offsets, tidy.hierarchy.offsets)
    assert clip.hierarchy.joints == tidy.hierarchy.joints
    assert clip.hierarchy.channels == tidy.hierarchy.channels
    assert clip.hierarchy.end_sites == tidy.hierarchy.end_sites
    assert clip.fps == tidy.fps


def test_names_may_repeat_hold_spaces_or_latin_letters() -> None:
    arm = TIDY[TIDY.index("  JOINT") : TIDY.index("}\nMOTION")]
    body = TIDY.replace("mixamorig:Hips", "Hüfte links").replace(arm, arm + arm)
    for number in ("6", "6.25", "-6.25"):
        body = body.replace(f" {number}\n", f" {number} 7 8 9\n")
    clip = read(body)
    assert clip.hierarchy.joints == ("Hüfte links", "mixamorig:Arm", "mixamorig:Arm.2")
    assert clip.hierarchy.parents == (-1, 0, 0)
    assert "mixamorig:Arm.2" in clip.notes[0]
    assert clip.channels[0].tolist() == [0, 90, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9]


def test_a_joint_may_have_several_end_sites_and_positions() -> None:
    site = "    End Site\n    {\n      OFFSET 0 1 0\n    }\n"
    text = TIDY.replace(site, site + site.replace("0 1 0", "2 0 0"))
    text = text.replace("3 Zrotation Xrotation Yrotation", "3 Xposition Xrotation Yrotation")
    tree = read(text).hierarchy
    assert tree.end_sites == ((1, (0.0, 1.0, 0.0)), (1, (2.0, 0.0, 0.0)))
    assert tree.channels[1] == ("Xposition", "Xrotation", "Yrotation")


@pytest.mark.parametrize("end", ["\n", "", "\n\n \n", "\r\n"])
def test_frames_beyond_those_declared_are_read_and_told(end: str) -> None:
    tidy = TIDY.rstrip("\n") + end
    assert read(tidy).notes == ()
    more = read(tidy.replace("Frames: 3", "Frames: 2"))
    assert more.notes == ("3 frames, though the file says 2",)
    np.testing.assert_array_equal(more.channels, read(TIDY).channels)


@pytest.mark.parametrize(
    ("old", "new", "line", "reason"),
    [
        ("MOTION", "", None, "no line MOTION"),
        ("HIERARCHY", "HIER", 1, "'HIERARCHY' is expected"),
        ("}\nMOTION", "MOTION", 14, "ends where"),
        ("  }\n}", "  }\n}\n}", 16, "'MOTION' is expected"),
        ("OFFSET 1 -2 3e-1", "OFFSET 1 -2 x", 8, "'x' is not a finite number"),
        ("OFFSET 1 -2 3e-1", "OFFSET 1 -2", 9, "'CHANNELS' is not a finite number"),
        ("    OFFSET 1 -2 3e-1\n", "", 13, "no OFFSET"),
        ("CHANNELS 3", "CHANNELS 4", 10, "'End' is not a channel"),
        ("CHANNELS 3", "CHANNELS 2", 9, "'Yrotation' is not expected"),
        ("CHANNELS 3", "CHANNELS three", 9, "not a number of channels"),
        ("Zrotation Xrotation Yrotation", "Zrotation Xrotation Xrotation", 9, "twice"),
        ("Frames: 3", "Frames: 4", None, "4 rows declared, 3 found"),
        ("Frames: 3", "Frames: 99999999999", None, "rows declared, 3 found"),
        ("Frames: 3", "Frames: -3", 17, "not a number of frames"),
        ("Frames: 3\n", "", 16, "no 'Frames:'"),
        (".0083333", "0", 18, "not a frame time"),
        (".0083333", "-0.01", 18, "not a frame time"),
        (".0083333", "nan", 18, "not a frame time"),
        (".0083333", "", 18, "'' is not a frame time"),
        (".0083333", "0.0000083", 18, "s is 1.205e\\+05 frames a second"),
        (".0083333", "60", 18, "s is 0.01667 frames a second"),
        ("Frame Time: .0083333\n", "", 18, "no 'Frame Time:'"),
        ("4 5 6.25", "4 5 nan", 20, "'nan' is not a finite number"),
        ("4 5 6.25", "4 5 1e999", 20, "'1e999' is not a finite number"),
        ("4 5 6.25", "4 5 1,5", 20, "'1,5' is not a finite number"),
        ("4 5 6.25", "4 5", 20, "8 values, not 9"),
        ("4 5 6.25", "4 5 6 7", 20, "more than 9 values"),
        ("5 -6.25\n", "5", None, "row has 8 values"),
    ],
)
def test_a_broken_file_is_refused_with_its_line(old: str, new: str, line: int | None, reason: str) -> None:
    assert old in TIDY
    with pytest.raises(ClipError, match=reason) as caught:
        read(TIDY.replace(old, new, 1))
    assert line is None or caught.value.line == line


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b" \n",
        bytes(range(256)) * 50,
        b"\x7fELF" + b"\0" * 4096,
        b"MOTION",
        b"MOTION\nFrames: 1\nFrame Time: 1\n",
        b"HIERARCHY ROOT " * 100_000,
        TIDY.encode() + b"7" * 3_000_000,
        TIDY.encode() + b"7 " * 3_000_000,
        b"{" * 3_000_000,
        TIDY.partition("MOTION")[0].encode() + b" " * 3_000_000 + b"\nMOTION" + b" \t" * 1_000_000,
        TIDY.replace("Frames: 3", "Frames: 0").partition("0 90")[0].encode(),
    ],
    ids=lambda data: data[:12].decode("latin-1").encode("unicode_escape").decode() + f"[{len(data)}]",
)
def test_a_file_that_is_no_clip_is_refused(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "x.bvh"
    path.write_bytes(data)
    with pytest.raises(ClipError):
        read_clips(path)


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_damage_is_refused_or_read_but_never_crashes(data: st.DataObject) -> None:
    damaged = bytearray(TIDY.encode())
    for _ in range(data.draw(st.integers(1, 4))):
        begin = data.draw(st.integers(0, len(damaged)))
        end = begin + data.draw(st.integers(0, 12))
        damaged[begin:end] = data.draw(st.one_of(st.binary(max_size=6), st.sampled_from([b"{", b"}", b"\n9 "])))
    try:
        clip = read(bytes(damaged))
    except ClipError:
        return
    assert clip.channels.shape[1] == len(clip.hierarchy.channel_names)
    assert np.isfinite(clip.channels).all()


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        (".0083333", 120),
        ("0.00833333", 120),
        ("0.0333333", 30),
        ("0.033", 30),
        ("0.0333667", 1 / 0.0333667),
        ("8.3333e-3", 120),
        ("0.008333333333333333", 120),
        ("0.04", 25),
        ("1", 1),
        ("0.0416667", 24),
        ("0.016", 1 / 0.016),
    ],
)
def test_the_frame_rate_is_whole_where_rounding_can_have_hidden_that(written: str, expected: float) -> None:
    assert frame_rate(written) == expected


def test_every_whole_frame_rate_survives_being_written() -> None:
    for fps in range(1, 1001):
        for written in (repr(1 / fps), f"{1 / fps:.12f}", f"{1 / fps:.9g}"):
            assert frame_rate(written) == fps
