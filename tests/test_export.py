"""Clips out of a lake again: in their own rig, and on the canonical skeleton."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from motionlake.formats import read_clips
from motionlake.lake.frames import read_clip
from motionlake.motion.kinematics import solve

from tests.lakes import motionlake, query


def exported(lake: Path, tmp_path: Path, clip: str, *more: str | int) -> Path:
    file = tmp_path / "out.bvh"
    run = motionlake("export", clip, "--lake", lake, "-o", file, *more)
    assert run.status == 0, run.err
    return file


def test_a_round_trip_in_its_own_rig_keeps_every_joint(built_lake: Path, clips_folder: Path, tmp_path: Path) -> None:
    rows = query(built_lake, "SELECT clip, path, body_height / metres_per_unit FROM clips ORDER BY clip")
    for clip, path, height in rows:
        source = read_clips(clips_folder / path)[0]
        again = read_clips(exported(built_lake, tmp_path, clip))[0]
        before, after = solve(source), solve(again)
        assert len(after.positions) == len(before.positions)
        assert again.fps == pytest.approx(source.fps, rel=1e-5)
        order = [again.hierarchy.joints.index(joint) for joint in source.hierarchy.joints]
        worst = np.abs(after.positions[:, order] - before.positions).max()
        assert worst < 1e-4 * height, clip


def test_retargeted_to_the_canonical_skeleton(built_lake: Path, tmp_path: Path) -> None:
    rows = query(built_lake, "SELECT clip, part, body_height, rig FROM clips ORDER BY clip")
    for clip, part, height, rig in rows:
        frames = read_clip(built_lake / f"frames/dataset=clips/{part}.parquet", clip)
        again = solve(read_clips(exported(built_lake, tmp_path, clip, "--rig", "canonical"))[0])
        # Sensor bones change their length from frame to frame, the exported ones do not.
        error = np.linalg.norm(again.positions / 100 - frames.positions, axis=-1)
        assert np.median(error) < (0.08 if rig.startswith(("kinect", "ntu")) else 0.02) * height, clip


def test_a_range_of_frames(built_lake: Path, tmp_path: Path) -> None:
    clip = query(built_lake, "SELECT min(clip) FROM clips")[0][0]
    whole = solve(read_clips(exported(built_lake, tmp_path, clip))[0])
    piece = solve(read_clips(exported(built_lake, tmp_path, clip, "--from", 3, "--to", 9))[0])
    np.testing.assert_allclose(piece.positions, whole.positions[3:9], atol=1e-3)


def test_a_range_outside_the_clip_is_a_clear_error(built_lake: Path, tmp_path: Path) -> None:
    clip, frames = query(built_lake, "SELECT clip, frames FROM clips ORDER BY clip LIMIT 1")[0]
    run = motionlake("export", clip, "--lake", built_lake, "-o", tmp_path / "x.bvh", "--to", frames + 1)
    assert run.status == 2
    assert f"has frames 0 to {frames}" in run.err
    assert not (tmp_path / "x.bvh").exists()
