"""Positions `.npz`: real Kinect recordings, joint order, gaps, and archives that are not right."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.errors import ClipError
from motionlake.formats import read_clips
from motionlake.formats.positions_npz import READER, parents_first
from motionlake.formats.repair import fill_missing, missing_samples
from motionlake.motion.clip import SourceClip

from tests.samples import KINECT_1, KINECT_1_PARENTS, npz_bytes, swinging_body


def read(data: bytes) -> SourceClip:
    (clip,) = READER.read(data, Path("made.npz"))
    return clip


def archive_of(**arrays: Any) -> bytes:
    good: dict[str, Any] = {
        "positions": swinging_body(6),
        "joints": np.array(KINECT_1),
        "parents": np.array(KINECT_1_PARENTS),
        "fps": 30.0,
    }
    stream = io.BytesIO()
    np.savez(stream, **{name: array for name, array in (good | arrays).items() if array is not None})
    return stream.getvalue()


@pytest.mark.recordings
def test_real_recordings_come_out_as_they_stand(recordings: Path) -> None:
    paths = sorted((recordings / "utd_mhad" / "clips").glob("*.npz"))[::40]
    assert paths
    for path in paths:
        (clip,) = read_clips(path)
        with np.load(path, allow_pickle=False) as archive:
            assert clip.hierarchy.joints == tuple(archive["joints"])
            assert clip.hierarchy.parents == tuple(archive["parents"])
            np.testing.assert_array_equal(clip.channels.reshape(archive["positions"].shape), archive["positions"])
        assert (clip.fps, clip.metres_per_unit, clip.repaired, clip.notes) == (30.0, 1.0, 0, ())


@given(st.permutations(range(20)))
def test_joints_in_any_order_give_the_same_tree(order: list[int]) -> None:
    motion = swinging_body(5)
    place = {joint: index for index, joint in enumerate(order)} | {-1: -1}
    parents = [place[KINECT_1_PARENTS[joint]] for joint in order]
    clip = read(npz_bytes(motion[:, order], [KINECT_1[joint] for joint in order], parents, 30.0))
    hierarchy = clip.hierarchy
    for index, (joint, parent) in enumerate(zip(hierarchy.joints, hierarchy.parents, strict=True)):
        assert parent < index
        own = KINECT_1.index(joint)
        expected = KINECT_1_PARENTS[own]
        assert (hierarchy.joints[parent] if parent >= 0 else None) == (KINECT_1[expected] if expected >= 0 else None)
        np.testing.assert_array_equal(clip.channels[:, 3 * index : 3 * index + 3], motion[:, own].astype(np.float32))
    assert bool(clip.notes) == (parents_first(parents) != list(range(20)))


def test_gaps_are_filled_and_a_centred_root_is_no_gap() -> None:
    motion = swinging_body(20)
    motion -= motion[:, :1]
    motion[4:6, 3] = 0.0
    motion[9] = np.nan
    motion[0, 7] = motion[19, 7] = np.inf
    clip = read(archive_of(positions=motion))
    assert clip.repaired == 2 + 1 + 2
    filled = clip.channels.reshape(20, 20, 3)
    assert not filled[:, 0].any()
    np.testing.assert_allclose(filled[9], (motion[8] + motion[10]) / 2, atol=1e-12)
    np.testing.assert_array_equal(filled[0, 7], motion[1, 7])
    np.testing.assert_array_equal(filled[19, 7], motion[18, 7])


def test_wholly_empty_frames_of_a_centred_body_are_gaps() -> None:
    motion = swinging_body(8)
    motion -= motion[:, :1]
    motion[3] = 0.0
    missing = missing_samples(motion)
    assert missing[3].all()
    assert missing.sum() == 20
    assert fill_missing(motion, missing, KINECT_1)[1] == 1


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (archive_of(fps=None), "has no array 'fps'"),
        (archive_of(positions=np.zeros((6, 20))), r"positions is float64 \[6, 20\]"),
        (archive_of(positions=np.zeros((6, 20, 3), complex)), "positions is complex128"),
        (archive_of(joints=np.array(KINECT_1[:-1])), "20 joints in positions, 19 names, 20 parents"),
        (archive_of(joints=np.array(["a"] * 20)), "two joints of one name"),
        (archive_of(joints=np.arange(20)), r"joints is int64 \[20\]"),
        (archive_of(joints=np.array(KINECT_1, object)), "Python objects"),
        (archive_of(parents=np.array([-1, -1, *KINECT_1_PARENTS[2:]])), "has 2 root joints"),
        (archive_of(parents=np.array([3, *KINECT_1_PARENTS[1:]])), "has 0 root joints"),
        (archive_of(parents=np.array([-1, 2, 1, *KINECT_1_PARENTS[3:]])), "are their own ancestors"),
        (archive_of(parents=np.array([-1, 99, *KINECT_1_PARENTS[2:]])), "joint 1 has parent 99"),
        (archive_of(fps=np.array([30.0, 30.0])), r"fps is float64 \[2\]"),
        (archive_of(positions=np.zeros((6, 20, 3))), "the body is seen in 0 of 6 frames"),
        (archive_of()[:3000], "damaged .npz archive"),
        (b"PK\x03\x04 not an archive", "damaged .npz archive"),
    ],
)
def test_a_fault_is_rejected_with_its_reason(data: bytes, reason: str) -> None:
    with pytest.raises(ClipError, match=reason):
        read(data)


def test_a_joint_missing_in_most_frames_is_named() -> None:
    motion = swinging_body(10)
    motion[2:8, 5] = np.nan
    with pytest.raises(ClipError, match="ElbowLeft is seen in 4 of 10 frames"):
        read(archive_of(positions=motion))


def member(header_shape: tuple[int, ...], payload: bytes) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": "<f4", "fortran_order": False, "shape": header_shape})
    return stream.getvalue() + payload


def test_a_header_or_member_that_promises_gigabytes_is_rejected_unread() -> None:
    def with_positions(content: bytes, promised: int | None = None) -> bytes:
        stream = io.BytesIO()
        source = zipfile.ZipFile(io.BytesIO(archive_of(positions=None)))
        with zipfile.ZipFile(stream, "w") as target:
            for name in source.namelist():
                target.writestr(name, source.read(name))
            info = zipfile.ZipInfo("positions.npy")
            target.writestr(info, content)
            if promised is not None:
                info.file_size = promised
        return stream.getvalue()

    shape = (10**12, 20, 3)
    with pytest.raises(ClipError, match="bytes long, but its header says"):
        read(with_positions(member(shape, b"\0" * 240)))
    with pytest.raises(ClipError, match="bytes long, but its header says"):
        read(with_positions(member((-1, -20, 3), b"\0" * 240)))
    with pytest.raises(ClipError, match="array 'positions' is 4000000000 bytes"):
        read(with_positions(member((1, 20, 3), b"\0" * 240), promised=4_000_000_000))
