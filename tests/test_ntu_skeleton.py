"""NTU RGB+D skeletons, written from real Kinect recordings: bodies, gaps, and files that are not right."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.ntu_skeleton import JOINTS, READER
from motionlake.motion.canonicalise import canonicalise
from motionlake.motion.clip import ChannelKind, SourceClip
from motionlake.motion.kinematics import solve
from motionlake.motion.rigs import load_rigs

from tests.samples import kinect_2_from_1, ntu_text, swinging_body

FIRST_ID, SECOND_ID = "72057594037944738", "72057594037944739"
FLOAT32_DIGITS = 1e-6


def read(text: str) -> list[SourceClip]:
    return READER.read(text.encode(), Path("S001C001P001R001A001.skeleton"))


def in_file_order(clip: SourceClip) -> Float64Array:
    """[F, 25, 3] in the order in which an NTU file lists the joints."""
    order = [clip.hierarchy.joints.index(joint) for joint in JOINTS]
    return clip.channels.reshape(len(clip.channels), -1, 3)[:, order]


@pytest.fixture(scope="module")
def people(recordings: Path) -> tuple[Float64Array, Float64Array]:
    """Two real people, [F, 25, 3] each."""
    clips = recordings / "utd_mhad" / "clips"
    motions = []
    for name in ("a01_s1_t1.npz", "a03_s6_t4.npz"):
        with np.load(clips / name, allow_pickle=False) as archive:
            motions.append(kinect_2_from_1(archive["positions"].astype(np.float64)))
    return motions[0][:45], motions[1][:40]


@pytest.mark.recordings
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_every_body_becomes_a_clip(people: tuple[Float64Array, Float64Array], newline: str) -> None:
    one, two = people
    clips = read(ntu_text([(FIRST_ID, 0, one), (SECOND_ID, 7, two)], newline=newline))
    assert [clip.body for clip in clips] == ["1", "2"]
    for clip, motion in zip(clips, people, strict=True):
        np.testing.assert_allclose(in_file_order(clip), motion, atol=FLOAT32_DIGITS)
        assert (clip.fps, clip.metres_per_unit, clip.repaired) == (30.0, 1.0, 0)
        assert clip.hierarchy.kind is ChannelKind.POSITIONS
    assert "frames 7 to 46 of 47" in clips[1].notes
    # A bone of the tree has much the same length all along; a wrong parent would not.
    clip = clips[0]
    world = clip.channels.reshape(len(one), 25, 3)
    bones = np.linalg.norm(world[:, 1:] - world[:, clip.hierarchy.parents[1:]], axis=2)
    assert bones.max() < 0.6
    parents = dict(zip(clip.hierarchy.joints, clip.hierarchy.parents, strict=True))
    assert clip.hierarchy.joints[parents["Neck"]] == "SpineShoulder"
    assert clip.hierarchy.joints[parents["HandTipLeft"]] == "HandLeft"


@pytest.mark.recordings
def test_gaps_are_interpolated_in_time(people: tuple[Float64Array, Float64Array]) -> None:
    one, two = people[0].copy(), people[1]
    one[20:23, 5] = 0.0
    one[30, 7] = np.nan
    dropped = frozenset({(0, 10), (0, 11), (0, 44)})
    untracked = frozenset({(0, 40, 3), (0, 41, 3)})
    clip, other = read(ntu_text([(FIRST_ID, 0, one), (SECOND_ID, 0, two)], dropped=dropped, untracked=untracked))
    missing = np.zeros((44, 25), bool)
    missing[10:12] = missing[20:23, 5] = missing[30, 7] = missing[40:42, 3] = True
    expected = people[0][:44].copy()
    for joint in range(25):
        gone = missing[:, joint]
        for axis in range(3):
            seen = expected[~gone, joint, axis]
            expected[gone, joint, axis] = np.interp(np.flatnonzero(gone), np.flatnonzero(~gone), seen)
    np.testing.assert_allclose(in_file_order(clip), expected, atol=FLOAT32_DIGITS)
    assert clip.repaired == 2 + 3 + 1 + 2
    assert any("8 of 44 frames" in note for note in clip.notes)
    assert (other.repaired, len(other.channels)) == (0, 40)


def test_a_hopeless_body_is_left_out_and_its_file_is_not() -> None:
    body = kinect_2_from_1(swinging_body(20))
    mostly_gone = frozenset((1, frame) for frame in range(1, 19))
    text = ntu_text([(FIRST_ID, 0, body), (SECOND_ID, 0, body + 1.0)], dropped=mostly_gone)
    (clip,) = read(text)
    assert clip.body == "1"
    assert "left out: body 2 is seen in 2 of 20 frames" in clip.notes
    alone = ntu_text([(FIRST_ID, 0, body)], dropped=frozenset((0, frame) for frame in range(1, 19)))
    with pytest.raises(ClipError, match="body is seen in 2 of 20 frames"):
        read(alone)


def test_a_joint_that_is_never_tracked_rejects_the_body() -> None:
    body = kinect_2_from_1(swinging_body(10))
    body[:, JOINTS.index("FootLeft")] = 0.0
    with pytest.raises(ClipError, match="FootLeft is seen in 0 of 10 frames"):
        read(ntu_text([(FIRST_ID, 0, body)]))


def test_a_body_stays_though_its_hands_were_hardly_seen() -> None:
    """Hands of a real body are often hidden; they go with the arm rather than stay behind in the room."""
    body = kinect_2_from_1(swinging_body(12))
    body[..., 0] += np.linspace(0, 3, 12)[:, None]
    expected = body.copy()
    wrist, hand, tip, thumb = (JOINTS.index(f"{part}Left") for part in ("Wrist", "Hand", "HandTip", "Thumb"))
    for joint in (hand, tip):
        expected[3:, joint] = expected[3:, wrist] + (body[2, joint] - body[2, wrist])
        body[3:, joint] = 0.0
    expected[:, thumb], body[:, thumb] = body[:, wrist], 0.0
    (clip,) = read(ntu_text([(FIRST_ID, 0, body)]))
    np.testing.assert_allclose(in_file_order(clip), expected, atol=1e-6)
    assert clip.repaired == 12
    assert "HandTipLeft seen in 3 of 12 frames, carried by HandLeft" in clip.notes
    motion = canonicalise(clip, solve(clip), load_rigs()["kinect_v2"])
    assert np.isfinite(motion.rotations).all()


def test_a_body_of_a_few_frames_is_noise_beside_a_longer_one_and_a_clip_alone() -> None:
    body = kinect_2_from_1(swinging_body(12))
    (clip,) = read(ntu_text([(FIRST_ID, 0, body), (SECOND_ID, 0, body[:11])]))
    assert len(clip.channels) == 12
    assert clip.notes[-1] == "left out: body 2 is seen in 11 of 12 frames"
    assert len(read(ntu_text([(FIRST_ID, 0, body), (SECOND_ID, 0, body)]))) == 2
    assert len(read(ntu_text([(FIRST_ID, 0, body[:11]), (SECOND_ID, 0, body[:5])]))) == 2


@pytest.mark.parametrize("token", ["NaN", "-nan", "-1.#IND", "Infinity", "-inf", "1e30"])
def test_a_value_that_is_no_position_is_a_gap(token: str) -> None:
    lines = ntu_text([(FIRST_ID, 0, kinect_2_from_1(swinging_body(9)))]).split("\n")
    at = lines.index("25") + 1 + 4 * (2 + 1 + 25)
    lines[at] = " ".join([token, *lines[at].split()[1:]])
    (clip,) = read("\n".join(lines))
    assert clip.repaired == 1
    assert np.isfinite(clip.channels).all()


def damaged(lines: list[str], at: int, line: str | None) -> list[str]:
    return lines[: at - 1] + ([] if line is None else [line]) + lines[at:]


@pytest.mark.parametrize(
    ("at", "line", "reason"),
    [
        (1, "x", "line 1: 'x' is not the number of frames"),
        (1, "90000000", "90000000 frames declared, but the file is cut short"),
        (1, "3", "line 86: '1' follows the last frame"),
        (2, "1.5", "line 2: '1.5' is not the number of frames or bodies"),
        (3, "7205 0 1 2", "line 3: '7205' starts a line that is not a body's 10 values"),
        (4, "20", "line 4: '20' is not the joint count 25"),
        (9, "0.1 0.2 0.3", "line 9: '0.1' starts a line that is not a joint's 12 values"),
        (9, None, "line 29: '1' starts a line that is not a joint's 12 values"),
        (10, "0.1 0,2 0.3 1 1 1 1 0 0 0 0 2", "line 10: '0,2' is not a number"),
        (10, "0.1 0.2 0.3 1 1 1 1 0 0 0 0 two", "line 10: 'two' is not a number"),
    ],
)
def test_a_fault_is_named_with_its_line(at: int, line: str | None, reason: str) -> None:
    lines = ntu_text([(FIRST_ID, 0, kinect_2_from_1(swinging_body(5)))]).split("\n")
    with pytest.raises(ClipError) as caught:
        read("\n".join(damaged(lines, at, line)))
    assert reason in str(caught.value)


def test_a_body_listed_twice_in_a_frame_is_rejected() -> None:
    body = kinect_2_from_1(swinging_body(5))
    with pytest.raises(ClipError, match="occurs twice in one frame"):
        read(ntu_text([(FIRST_ID, 0, body), (FIRST_ID, 0, body)]))


def test_a_file_without_bodies_is_rejected() -> None:
    with pytest.raises(ClipError, match="no body is tracked"):
        read("3\n0\n0\n0\n")


@given(
    st.lists(
        st.floats(-1e4, 1e4).filter(bool) | st.decimals(-10, 10, places=22).filter(bool),
        min_size=6,
        max_size=6,
    )
)
def test_numbers_are_read_to_the_last_bit(values: list[object]) -> None:
    """As Python's `float` reads them, however many digits they have."""
    lines = ntu_text([(FIRST_ID, 0, kinect_2_from_1(swinging_body(2)))]).split("\n")
    for line, start in ((4, 0), (8, 3)):
        lines[line] = " ".join([*map(str, values[start : start + 3]), *lines[line].split()[3:]])
    (clip,) = read("\n".join(lines))
    np.testing.assert_array_equal(in_file_order(clip)[0, [0, 4]].ravel(), [float(str(value)) for value in values])
