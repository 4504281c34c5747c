"""AMASS in and out: joints against forward kinematics of another library, names of packages, round trips, bad files."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats import read_clips
from motionlake.formats.write.registry import ClipToWrite, writers
from motionlake.motion.kinematics import solve
from motionlake.motion.smpl import JOINTS, OFFSETS, PARENTS, PELVIS
from scipy.spatial.transform import Rotation

from tests.lakes import motionlake, query
from tests.samples import amass_bytes

CLOSE = 1e-6  # metres


def arrays(frames: int = 20, seed: int = 0) -> dict[str, Any]:
    """A body that turns every joint at random."""
    rng = np.random.default_rng(seed)
    return {
        "poses": rng.normal(0, 0.4, (frames, 72)), "trans": rng.normal(0, 1, (frames, 3)),
        "mocap_framerate": np.array(120.0), "betas": np.zeros(10), "gender": np.array("male"),
    }  # fmt: skip


def saved(path: Path, **members: Any) -> Path:
    np.savez(path, **members)
    return path


def joints_of(poses: Float64Array, trans: Float64Array) -> Float64Array:
    """[F, 24, 3] joints of the mean body, by chains of SciPy's rotations."""
    found = np.zeros((len(poses), len(JOINTS), 3))
    turns: list[Rotation] = []
    for joint, parent in enumerate(PARENTS):
        own = Rotation.from_rotvec(poses[:, 3 * joint : 3 * joint + 3])
        turns.append(own if parent < 0 else turns[parent] * own)
        found[:, joint] = trans + PELVIS if parent < 0 else found[:, parent] + turns[parent].apply(OFFSETS[joint])
    return found


def test_joints_are_where_another_library_puts_them(tmp_path: Path) -> None:
    made = arrays()
    [clip] = read_clips(saved(tmp_path / "a.npz", **made))
    assert (clip.hierarchy.joints, clip.fps, clip.up, clip.metres_per_unit) == (JOINTS, 120.0, "z", 1.0)
    assert any("no body model" in note for note in clip.notes)
    np.testing.assert_allclose(solve(clip).positions, joints_of(made["poses"], made["trans"]), atol=CLOSE)


@pytest.mark.parametrize(
    ("names", "place"), [(("root_orient", "pose_body"), "trans"), (("global_orient", "body_pose"), "transl")]
)
def test_the_names_of_other_packages_mean_the_same(names: tuple[str, str], place: str, tmp_path: Path) -> None:
    made = arrays()
    apart = {names[0]: made["poses"][:, :3], names[1]: made["poses"][:, 3:66], place: made["trans"]}
    [clip] = read_clips(saved(tmp_path / "a.npz", mocap_frame_rate=np.array(30.0), **apart))
    still = made["poses"].copy()
    still[:, 66:] = 0.0
    np.testing.assert_allclose(solve(clip).positions, joints_of(still, made["trans"]), atol=CLOSE)
    assert clip.fps == 30.0


def test_fingers_are_left_out_and_said_so(tmp_path: Path) -> None:
    made = arrays()
    fingers = np.hstack([made["poses"][:, :66], np.ones((20, 90))])
    [clip] = read_clips(saved(tmp_path / "a.npz", **made | {"poses": fingers}))
    assert any("fingers" in note for note in clip.notes)
    still = made["poses"].copy()
    still[:, 66:] = 0.0
    np.testing.assert_allclose(solve(clip).positions[:, :22], joints_of(still, made["trans"])[:, :22], atol=CLOSE)


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    made = arrays()
    made["poses"][:, 66:] = 0.0  # hands of SMPL-H have no joint of their own
    [clip] = read_clips(saved(tmp_path / "a.npz", **made))
    writers()["amass"].write(ClipToWrite("a", clip, 1.0, "z"), tmp_path / "b.npz")
    [again] = read_clips(tmp_path / "b.npz")
    np.testing.assert_allclose(solve(again).positions, solve(clip).positions, atol=CLOSE)
    with np.load(tmp_path / "b.npz", allow_pickle=False) as written:
        assert written["poses"].shape == (20, 156)
        assert (written["betas"].shape, str(written["gender"]), float(written["mocap_framerate"])) == (
            (16,), "neutral", 120.0,
        )  # fmt: skip
        np.testing.assert_allclose(written["trans"], made["trans"], atol=CLOSE)


def test_a_lake_takes_it_in_and_gives_it_out(tmp_path: Path, scheduler: str) -> None:
    folder = tmp_path / "clips"
    folder.mkdir()
    (folder / "walk.npz").write_bytes(amass_bytes(60))
    lake = tmp_path / "lake"
    run = motionlake("ingest", folder, "--lake", lake, "--scheduler", scheduler)
    assert run.status == 0, run.err
    assert query(lake, "SELECT rig, round(fps) FROM clips") == [("smpl", 60.0)]
    out = tmp_path / "out"
    out.mkdir()
    run = motionlake("export", "walk", "--lake", lake, "--format", "amass", "--out", out / "walk.npz")
    assert run.status == 0, run.err
    [before], [after] = read_clips(folder / "walk.npz"), read_clips(out / "walk.npz")
    one, other = (solve(clip).positions[:, :22] for clip in (before, after))
    np.testing.assert_allclose(other, one, atol=1e-5)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"trans": np.zeros((3, 3))}, "trans is"),
        ({"poses": np.zeros((20, 12))}, "has 12 numbers of rotation a frame"),
        ({"poses": np.full((20, 72), np.nan)}, "not finite"),
        ({"poses": np.full((20, 72), 1e9)}, "absurdly large"),
        ({"mocap_framerate": np.array([1.0, 2.0])}, "not one number: say --fps"),
        ({"mocap_framerate": None}, "has no frame rate"),
        ({"trans": np.array([["a", "b", "c"]] * 20)}, "not numbers of every frame"),
    ],
)
def test_what_is_wrong_is_said(change: dict[str, Any], reason: str, tmp_path: Path) -> None:
    made = {name: array for name, array in (arrays() | change).items() if array is not None}
    with pytest.raises(ClipError, match=reason):
        read_clips(saved(tmp_path / "a.npz", **made))


def test_no_python_object_is_loaded(tmp_path: Path) -> None:
    stream = io.BytesIO()
    np.savez(stream, **arrays() | {"trans": np.array([object()] * 20)})
    (tmp_path / "a.npz").write_bytes(stream.getvalue())
    with pytest.raises(ClipError, match="Python objects, which are never loaded"):
        read_clips(tmp_path / "a.npz")


def test_a_position_archive_is_no_amass(tmp_path: Path) -> None:
    saved(tmp_path / "a.npz", poses=np.zeros(3))
    with pytest.raises(ClipError, match="poses is"):
        read_clips(tmp_path / "a.npz")
    saved(tmp_path / "b.npz", other=np.zeros(3))
    with pytest.raises(ClipError, match="has no array 'positions'"):
        read_clips(tmp_path / "b.npz")
