"""C3D against ezc3d and the package c3d, which read and write it on their own, and against files made byte by byte."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import c3d
import ezc3d
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats import read_clips
from motionlake.formats.parse.c3d_blocks import read_points
from motionlake.formats.write.points_c3d import WRITER
from motionlake.formats.write.registry import ClipToWrite
from motionlake.motion.canonicalise import canonicalise
from motionlake.motion.kinematics import solve
from motionlake.motion.marker_sets import JOINT_CENTRES, fitting_sets, joint_centres, marker_sets
from motionlake.motion.rigs import identify, load_rigs
from motionlake.motion.skeleton import INDEX

from tests.damage import damaged_bytes
from tests.marker_samples import c3d_bytes
from tests.samples import KINECT_1, KINECT_1_PARENTS, npz_bytes, plug_in_gait_markers, swinging_body
from tests.test_damaged_files import EXTRA_MEMORY, SECONDS_PER_FILE, limited_memory, limited_time

NAMES, PLACES = plug_in_gait_markers(swinging_body(40))
pytestmark = pytest.mark.filterwarnings("ignore:No analog data found")


def written(folder: Path, data: bytes) -> Path:
    path = folder / "walk.c3d"
    path.write_bytes(data)
    return path


def by_ezc3d(path: Path) -> tuple[list[str], Float64Array]:
    """Names and [F, P, 3] in the file's unit; NaN where a point was not seen."""
    read: Any = ezc3d.c3d(str(path))
    points = np.array(read["data"]["points"][:3]).transpose(2, 1, 0)
    hidden = np.array(read["data"]["meta_points"]["residuals"])[0].T < 0
    points[hidden] = np.nan
    return list(read["parameters"]["POINT"]["LABELS"]["value"]), points


def by_c3d(path: Path) -> Float64Array:
    """The same with the package c3d."""
    with path.open("rb") as stream:
        frames = np.array([points for _, points, _ in c3d.Reader(stream).read_frames()])
    return np.where(frames[..., 3:4] < 0, np.nan, frames[..., :3].astype(float))


@pytest.mark.parametrize("scale", [-1.0, 0.1])
def test_points_are_those_that_other_libraries_read(scale: float, tmp_path: Path) -> None:
    holed = PLACES.copy()
    holed[10:14, 3] = np.nan
    path = written(tmp_path, c3d_bytes(NAMES, holed, scale=scale))
    points = read_points(path.read_bytes())
    names, theirs = by_ezc3d(path)
    assert list(points.names) == names == NAMES
    assert points.rate == 100.0
    np.testing.assert_allclose(points.places, theirs, atol=1e-3)
    np.testing.assert_allclose(points.places, by_c3d(path), atol=1e-3)
    np.testing.assert_allclose(points.places, holed * 1000, atol=1.01 * abs(scale))  # which the package c3d cuts off
    assert np.isnan(points.places[10:14, 3]).all()


@pytest.mark.recordings
def test_joints_of_real_motion_agree_with_what_ezc3d_reads(recordings: Path, tmp_path: Path) -> None:
    """Real bodies with markers put on them, written by the package c3d, read by ezc3d, joints worked out here."""
    paths = sorted((recordings / "utd_mhad" / "clips").glob("*.npz"))[::120]
    assert len(paths) > 5
    for clip in paths:
        with np.load(clip, allow_pickle=False) as archive:
            names, places = plug_in_gait_markers(archive["positions"].astype(np.float64))
        path = written(tmp_path, c3d_bytes(names, places, 30.0, scale=0.1))
        (ours,) = read_clips(path)
        _, theirs = by_ezc3d(path)
        seen = dict(zip(names, theirs.transpose(1, 0, 2) / 1000, strict=True))
        joints = dict(zip(JOINT_CENTRES, solve(ours).positions.transpose(1, 0, 2), strict=True))
        height = np.ptp(places[0, :, 1])
        for joint, markers in fitting_sets(names)[0].joints.items():
            off = np.linalg.norm(joints[joint] - np.mean([seen[marker] for marker in markers], axis=0), axis=1)
            assert off.max() < 1e-3 * height, (clip.name, joint)


def test_joints_are_the_canonical_ones(tmp_path: Path) -> None:
    (clip,) = read_clips(written(tmp_path, c3d_bytes(NAMES, PLACES)))
    assert (clip.fps, clip.up) == (100.0, "y")
    assert "joints from markers: plug_in_gait" in clip.notes
    motion = canonicalise(clip, solve(clip), identify(clip.hierarchy.joints, load_rigs()))
    body = swinging_body(40)
    for joint, place in (("left_wrist", 6), ("right_elbow", 9), ("left_knee", 13), ("right_ankle", 18), ("hips", 0)):
        assert np.linalg.norm(motion.positions[:, INDEX[joint]] - body[:, place], axis=1).max() < 0.08, joint


def turned(places: Float64Array, up: str) -> Float64Array:
    """Places with y up, in axes of which another is."""
    x, y, z = places[..., 0], places[..., 1], places[..., 2]
    return np.stack({"y": [x, y, z], "z": [x, -z, y], "-z": [x, z, -y], "-y": [x, -y, -z], "x": [y, -x, z]}[up], -1)


@pytest.mark.parametrize("up", ["y", "z", "-z", "-y", "x"])
def test_up_is_what_the_screen_shows(up: str, tmp_path: Path) -> None:
    y_screen = ("-" if up[0] == "-" else "+") + up[-1].upper()
    (clip,) = read_clips(written(tmp_path, c3d_bytes(NAMES, turned(PLACES, up), screen=("+X", y_screen))))
    assert clip.up == up
    assert not any("by the body" in note for note in clip.notes)


@pytest.mark.parametrize("up", ["y", "z", "-z", "-y"])
def test_up_is_told_by_the_body_where_the_file_does_not_say(up: str, tmp_path: Path) -> None:
    path = written(tmp_path, made(turned(PLACES, up)))
    (clip,) = read_clips(path)
    assert clip.up == up
    assert f"up is {up}, by the body" in clip.notes
    motion = canonicalise(clip, solve(clip), identify(clip.hierarchy.joints, load_rigs()))
    assert (motion.positions[:, INDEX["head"], 1] > motion.positions[:, INDEX["left_ankle"], 1] + 1).all()


@pytest.mark.parametrize(("unit", "name"), [(0.001, "mm"), (0.01, "cm"), (1.0, "m"), (1.0, "meters"), (0.0254, "in")])
def test_units_are_those_of_the_file(unit: float, name: str, tmp_path: Path) -> None:
    (clip,) = read_clips(written(tmp_path, c3d_bytes(NAMES, PLACES, unit=unit, unit_name=name)))
    (metres,) = read_clips(written(tmp_path, c3d_bytes(NAMES, PLACES)))
    np.testing.assert_allclose(clip.channels, metres.channels, atol=1e-6)
    with pytest.raises(ClipError, match="POINT:UNITS is 'furlong'"):
        read_clips(written(tmp_path, c3d_bytes(NAMES, PLACES, unit_name="furlong")))


def test_gaps_are_filled_and_counted(tmp_path: Path) -> None:
    (whole,) = read_clips(written(tmp_path, c3d_bytes(NAMES, PLACES)))
    holed = PLACES.copy()
    holed[10:14, NAMES.index("LKNE")] = np.nan
    holed[12:18, NAMES.index("RANK")] = 0.0  # as Vicon writes a gap, but with a sign that it was seen
    (clip,) = read_clips(written(tmp_path, c3d_bytes(NAMES, holed)))
    assert clip.repaired == 8
    assert "8 of 40 frames had missing joints, interpolated" in clip.notes
    np.testing.assert_allclose(clip.channels, whole.channels, atol=1e-4)
    holed[:30, NAMES.index("LKNE")] = np.nan
    with pytest.raises(ClipError, match="LKNE is seen in 10 of 40 frames"):
        read_clips(written(tmp_path, c3d_bytes(NAMES, holed)))


def test_two_subjects_become_two_clips(tmp_path: Path) -> None:
    both = np.concatenate([PLACES, PLACES + np.array([1.0, 0.0, 0.0])], axis=1)
    names = [f"{who}:{name}" for who in ("anna", "bert") for name in NAMES]
    one, two = read_clips(written(tmp_path, c3d_bytes([*names, "*12"], np.concatenate([both, both[:, :1]], axis=1))))
    assert (one.body, two.body) == ("1", "2")
    assert "subject bert" in two.notes
    assert any("(no name) left out" in note for note in one.notes)
    np.testing.assert_allclose((solve(two).positions - solve(one).positions)[..., 0], 1.0, atol=1e-4)


@pytest.mark.parametrize("name", [marker_set.name for marker_set in marker_sets()])
def test_every_set_comes_in_as_c3d(name: str, tmp_path: Path) -> None:
    marker_set = next(each for each in marker_sets() if each.name == name)
    places = np.random.default_rng(5).normal(size=(6, len(marker_set.required), 3))
    (clip,) = read_clips(written(tmp_path, c3d_bytes(marker_set.required, places)))
    assert f"joints from markers: {name}" in clip.notes
    np.testing.assert_allclose(solve(clip).positions, joint_centres(marker_set, places, marker_set.required), atol=1e-6)


def test_joint_centres_come_before_markers_unless_they_were_lost(tmp_path: Path) -> None:
    centres = next(each for each in marker_sets() if each.name == "plug_in_gait_centres")
    extra = [name for name in centres.required if name not in NAMES]
    places = np.concatenate([PLACES, PLACES[:, : len(extra)]], axis=1)
    (clip,) = read_clips(written(tmp_path, c3d_bytes([*NAMES, *extra], places)))
    assert "joints from markers: plug_in_gait_centres" in clip.notes
    places[5:, len(NAMES)] = np.nan
    (clip,) = read_clips(written(tmp_path, c3d_bytes([*NAMES, *extra], places)))
    assert "joints from markers: plug_in_gait" in clip.notes


def test_what_motionlake_exports_comes_back(tmp_path: Path) -> None:
    source = tmp_path / "take.npz"
    source.write_bytes(npz_bytes(swinging_body(12), KINECT_1, KINECT_1_PARENTS, 30.0))
    (before,) = read_clips(source)
    WRITER.write(ClipToWrite("take", before, 1.0), tmp_path / "take.c3d")
    (after,) = read_clips(tmp_path / "take.c3d")
    assert after.hierarchy.joints == before.hierarchy.joints
    assert after.hierarchy.parents == before.hierarchy.parents
    assert (after.fps, after.up) == (30.0, "y")
    np.testing.assert_allclose(after.channels, before.channels, atol=1e-6)


def test_points_called_as_joints_of_a_rig_are_joints(tmp_path: Path) -> None:
    names = [*(f"Anna:{name}" for name in KINECT_1), "Anna:prop"]
    places = np.pad(swinging_body(12), ((0, 0), (0, 1), (0, 0)), mode="edge")
    (clip,) = read_clips(written(tmp_path, c3d_bytes(names, places)))
    assert "points are joints: kinect_v1" in clip.notes
    joints, parents = clip.hierarchy.joints, clip.hierarchy.parents
    assert "prop" not in joints
    assert joints[parents[joints.index("WristLeft")]] == "ElbowLeft"
    for joint, name in enumerate(joints):
        np.testing.assert_allclose(solve(clip).positions[:, joint], places[:, KINECT_1.index(name)], atol=1e-6)


def made(
    places: Float64Array,
    names: list[str] = NAMES,
    processor: int = 84,
    wide: bool = True,
    analog: int = 3,
    rate: float = 100.0,
) -> bytes:
    """A C3D made byte by byte, millimetres, as one of the three processors writes it; no screen axes are in it."""
    order = ">" if processor == 86 else "<"

    def floats(values: Float64Array) -> bytes:
        if processor != 85:
            return np.asarray(values, f"{order}f4").tobytes()
        return np.asarray(np.asarray(values, np.float32) * 4, "<f4").view("<u2").reshape(-1, 2)[:, ::-1].tobytes()

    def parameter(group: int, name: str, kind: int, shape: list[int], content: bytes) -> bytes:
        body = struct.pack("bB", kind, len(shape)) + bytes(shape) + content + b"\0"
        return struct.pack("bb", len(name), group) + name.encode() + struct.pack(f"{order}H", len(body) + 2) + body

    frames, points = places.shape[:2]
    scale = -1.0 if wide else 0.1
    width = max(map(len, names))
    records = struct.pack("bb", 5, -1) + b"POINT" + struct.pack(f"{order}H", 3) + b"\0"
    records += parameter(1, "LABELS", -1, [width, points], "".join(name.ljust(width) for name in names).encode())
    records += parameter(1, "UNITS", -1, [2], b"mm") + parameter(1, "RATE", 4, [], floats(np.array([rate])))
    for name, number in (("USED", points), ("FRAMES", frames)):
        records += parameter(1, name, 2, [], struct.pack(f"{order}H", number))
    records += parameter(1, "SCALE", 4, [], floats(np.array([scale]))) + bytes(2)
    blocks = -(-(len(records) + 4) // 512)
    header = struct.pack(f"{order}BBHHHHH", 2, 0x50, points, analog, 1, frames, 0) + floats(np.array([scale]))
    header += struct.pack(f"{order}HH", 2 + blocks, 1) + floats(np.array([rate]))
    values = np.concatenate([places * 1000 / (1 if wide else scale), np.zeros((frames, points, 1))], axis=2)
    hidden = ~np.isfinite(values).all(axis=2)
    values[hidden] = (0.0, 0.0, 0.0, -1.0)
    rows = np.concatenate([values.reshape(frames, -1), np.full((frames, analog), 7.0)], axis=1)
    data = floats(rows) if wide else np.asarray(rows.round(), f"{order}i2").tobytes()
    head = bytes((1, 0x50, blocks, processor))
    return header.ljust(512, b"\0") + (head + records).ljust(512 * blocks, b"\0") + data


@pytest.mark.parametrize("processor", [84, 85, 86])
@pytest.mark.parametrize("wide", [True, False])
def test_every_processor_and_kind_of_number(processor: int, wide: bool, tmp_path: Path) -> None:
    holed = PLACES.copy()
    holed[3, 5] = np.nan
    path = written(tmp_path, made(holed, processor=processor, wide=wide))
    points = read_points(path.read_bytes())
    np.testing.assert_allclose(points.places, holed * 1000, atol=0.06, equal_nan=True)
    np.testing.assert_allclose(points.places, by_c3d(path), atol=1e-3)
    path.write_bytes(made(holed, processor=processor, wide=wide, analog=0))
    if processor == 84:  # of others it takes the header's numbers for Intel's
        np.testing.assert_allclose(points.places, by_ezc3d(path)[1], atol=1e-3)


@settings(max_examples=60, deadline=None)
@given(
    frames=st.integers(1, 6),
    points=st.integers(1, 8),
    analog=st.integers(0, 5),
    processor=st.sampled_from([84, 85, 86]),
    wide=st.booleans(),
    seed=st.integers(0, 99),
)
def test_any_small_file_gives_its_numbers_back(
    frames: int, points: int, analog: int, processor: int, wide: bool, seed: int
) -> None:
    places = np.random.default_rng(seed).uniform(-3, 3, (frames, points, 3))
    names = [f"m{number}" for number in range(points)]
    read = read_points(made(places, names, processor, wide, analog))
    assert list(read.names) == names
    np.testing.assert_allclose(read.places, places * 1000, atol=0.06)


def test_more_frames_than_two_bytes_count() -> None:
    places = np.zeros((70_000, 1, 3))
    places[:, 0, 0] = np.arange(70_000) / 1000
    read = read_points(c3d_bytes(["one"], places))
    assert len(read.places) == 70_000
    np.testing.assert_allclose(read.places[:, 0, 0], np.arange(70_000), rtol=1e-6)


def test_frames_are_counted_where_the_file_cannot_say_how_many() -> None:
    places = np.zeros((65_535, 1, 3))
    places[:, 0, 0] = np.arange(65_535) / 1000
    more = np.array([[number, 0.0, 0.0, 0.0] for number in range(65_535, 65_600)], "<f4")
    read = read_points(made(places, ["one"], analog=0) + more.tobytes())
    np.testing.assert_allclose(read.places[:, 0, 0], np.arange(65_600), rtol=1e-6)


def test_more_than_255_points_are_named_by_two_parameters(tmp_path: Path) -> None:
    names = [f"m{number}" for number in range(300)]
    file: Any = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    file["parameters"]["POINT"]["LABELS"]["value"] = names[:255]
    file.add_parameter("POINT", "LABELS2", names[255:])
    file["data"]["points"] = np.ones((4, 300, 3))
    file.write(str(tmp_path / "many.c3d"))
    assert list(read_points((tmp_path / "many.c3d").read_bytes()).names) == names


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda data: data[:-600], "40 frames declared, but the file is cut short"),
        (lambda data: data[:1] + b"\0" + data[2:], "is no C3D"),
        (lambda data: b"\xff" + data[1:], "its parameters lie outside the file"),
        (lambda data: data.replace(b"LABELS", b"LABORS"), "has no named points"),
        (lambda data: data[:515] + b"\x09" + data[516:], "processor 9 is not one of"),
    ],
)
def test_what_is_wrong_is_said(change: Any, reason: str, tmp_path: Path) -> None:
    with pytest.raises(ClipError, match=reason):
        read_clips(written(tmp_path, change(made(PLACES))))


def test_damaged_files_are_read_or_rejected(tmp_path: Path) -> None:
    reasons = []
    for data in damaged_bytes(c3d_bytes(NAMES, PLACES[:12]), 200, seed=11):
        path = written(tmp_path, data)
        try:
            with limited_memory(EXTRA_MEMORY), limited_time(SECONDS_PER_FILE):
                read_clips(path)
        except ClipError as error:
            reasons.append(str(error))
    assert 40 < len(reasons) < 200
    assert not any("\n" in reason or "Error:" in reason for reason in reasons), reasons
