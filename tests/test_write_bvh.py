"""Clips written as BVH and read back move as before."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Float64Array
from motionlake.formats import read_clips
from motionlake.formats.bvh import READER
from motionlake.formats.write.bvh import write_bvh
from motionlake.motion.clip import ChannelKind, Hierarchy, SourceClip
from motionlake.motion.kinematics import solve
from motionlake.motion.rotations import IDENTITY, from_euler, to_matrix


def read_back(clip: SourceClip, start: int = 0, stop: int | None = None) -> SourceClip:
    stream = io.StringIO()
    write_bvh(clip, stream, start, stop)
    (back,) = READER.read(stream.getvalue().encode(), Path("x.bvh"))
    return back


def positions_in_order(back: SourceClip, tree: Hierarchy) -> Float64Array:
    return solve(back).positions[:, [back.hierarchy.joints.index(joint) for joint in tree.joints]]


@pytest.mark.recordings
@pytest.mark.parametrize(
    "pattern",
    ["cmu_dance/**/*.bvh", "cmu_bvh/**/*.bvh", "bandai1/**/*.bvh", "hdm05/**/*.amc", "cmu_86/**/*.amc",
     "utd_mhad/**/*.npz"],
)  # fmt: skip
def test_a_range_of_a_recording_keeps_every_joint(recordings: Path, tmp_path: Path, pattern: str) -> None:
    for source in sorted(recordings.glob(pattern))[::40][:3]:
        (clip,) = read_clips(source)
        start, stop = len(clip.channels) // 3, 2 * len(clip.channels) // 3
        write_bvh(clip, tmp_path / "range.bvh", start, stop)
        (back,) = read_clips(tmp_path / "range.bvh")
        expected = solve(clip).positions[start:stop]
        height = np.median(np.ptp(expected[..., 1], axis=1))
        error = np.abs(positions_in_order(back, clip.hierarchy) - expected).max()
        assert error < 1e-4 * height
        assert back.fps == clip.fps


@pytest.mark.recordings
def test_a_bvh_keeps_its_own_channels(recordings: Path) -> None:
    for pattern in ("cmu_dance/**/*.bvh", "bandai1/**/*.bvh"):
        (clip,) = read_clips(min(recordings.glob(pattern)))
        back = read_back(clip, 5, 25)
        np.testing.assert_array_equal(back.channels, clip.channels[5:25])
        assert back.hierarchy.channel_names == clip.hierarchy.channel_names
        assert back.hierarchy.end_sites == clip.hierarchy.end_sites
        np.testing.assert_array_equal(back.hierarchy.offsets, clip.hierarchy.offsets)


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(["euler", "asf", "quaternion", "positions"]), st.integers(0, 10**6))
def test_any_kind_of_channels_in_any_order_of_joints(kind: str, seed: int) -> None:
    generator = np.random.default_rng(seed)
    joints = 6
    parents = (-1, *(int(generator.integers(0, j)) for j in range(1, joints)))
    xyz = ("Xposition", "Yposition", "Zposition")
    euler, quaternion = ("Xrotation", "Zrotation"), tuple(f"{c}quaternion" for c in "WXYZ")
    layout = {
        "euler": ((*euler, *xyz), *((*euler, "Yposition")[: 2 + j % 2] for j in range(1, joints))),
        "asf": ((*xyz, *euler), *(euler[: j % 3] for j in range(1, joints))),
        "quaternion": (
            (*xyz, *quaternion),
            *((*quaternion, "Yposition")[: 4 + j % 2] for j in range(1, joints)),
        ),
        "positions": (("x", "y", "z"),) * joints,
    }[kind]
    axes = np.tile(IDENTITY, (joints, 1))
    tree = Hierarchy(
        joints=tuple(f"joint {j}" for j in range(joints)),
        parents=parents,
        offsets=generator.normal(size=(joints, 3)),
        channels=layout,
        kind=ChannelKind("euler" if kind == "asf" else kind),
        axes=from_euler(generator.uniform(-180, 180, (joints, 3)), "XYZ") if kind == "asf" else axes,
        fixed_axes=kind == "asf",
        end_sites=((joints - 1, (0.0, 1.0, 0.0)), (joints - 1, (1.0, 0.0, 0.0))),
    )
    clip = SourceClip(tree, generator.normal(size=(5, len(tree.channel_names))) * 100, 24.0)
    back = read_back(clip)
    expected = solve(clip)
    np.testing.assert_allclose(positions_in_order(back, tree), expected.positions, atol=1e-5)
    if expected.world is not None:
        world = solve(back).world
        assert world is not None
        order = [back.hierarchy.joints.index(joint) for joint in tree.joints]
        np.testing.assert_allclose(to_matrix(world[:, order]), to_matrix(expected.world), atol=1e-7)
    assert {offset for _, offset in tree.end_sites} <= {offset for _, offset in back.hierarchy.end_sites}


def walker() -> SourceClip:
    tree = Hierarchy(("root",), (-1,), np.zeros((1, 3)), (("x", "y", "z"),), ChannelKind.POSITIONS, IDENTITY[None])
    return SourceClip(tree, np.arange(12.0).reshape(4, 3), 30.0)


@pytest.mark.parametrize(("start", "stop"), [(0, 5), (2, 2), (3, 1), (-1, 2), (4, None)])
def test_a_range_outside_the_clip_is_refused(tmp_path: Path, start: int, stop: int | None) -> None:
    with pytest.raises(IndexError):
        write_bvh(walker(), tmp_path / "x.bvh", start, stop)
    assert list(tmp_path.iterdir()) == []


def test_a_write_that_fails_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "x.bvh"
    path.write_text("old")

    def full(handle: int) -> None:
        raise OSError("no space left")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="no space"):
        write_bvh(walker(), path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
