"""HumanML3D in and out: features against a naive version, joints, rotations with twist, round trips, bad files."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats import is_clip, read_clips
from motionlake.formats.limits_config import Limits
from motionlake.formats.write.humanml3d import humanml3d_features
from motionlake.formats.write.registry import ClipToWrite, set_writers
from motionlake.motion.clip import ChannelKind
from motionlake.motion.humanml3d import GROUPS, TURNS, features, placed, recovered
from motionlake.motion.kinematics import solve
from motionlake.motion.rotations import angle, conjugate, multiply
from motionlake.motion.smpl import BODY_JOINTS, INDEX, JOINTS, OFFSETS, PARENTS, smpl_clip
from motionlake.motion.smpl_from_joints import CHILDREN, HINGES
from scipy.spatial.transform import Rotation

from tests import humanml3d_oracle as oracle
from tests.damage import DAMAGES
from tests.lakes import motionlake, query
from tests.samples import humanml3d_bytes

CLOSE = 1e-6  # metres, and other numbers of features
BORNE = [joint for joint in range(BODY_JOINTS) if CHILDREN[joint]]
TALLER = np.linspace(1.05, 1.2, BODY_JOINTS)[:, None] * OFFSETS[:BODY_JOINTS]  # bones of another body


def turns(frames: int, seed: int = 0, reach: float = 0.3) -> Float64Array:
    """[F, 22, 3] smooth rotation vectors of joints; the pelvis turns once around, past -z."""
    rng, time = np.random.default_rng(seed), np.linspace(0.0, 3.0, frames)[:, None, None]
    vectors = reach * np.sin(rng.uniform(1, 3, (BODY_JOINTS, 3)) * time + rng.uniform(0, 6, (BODY_JOINTS, 3)))
    whole = np.stack([0 * time[:, 0, 0], 2 * time[:, 0, 0], 0 * time[:, 0, 0]], axis=1)
    vectors[:, 0] = (Rotation.from_rotvec(whole) * Rotation.from_rotvec(vectors[:, 0])).as_rotvec()
    return np.asarray(vectors)


def clip_of(vectors: Float64Array, offsets: Float64Array = OFFSETS, fps: float = 20.0) -> ClipToWrite:
    """A body that turns so and walks."""
    frames = len(vectors)
    time = np.linspace(0.0, 3.0, frames)
    root = np.stack([np.sin(time), 0.95 + 0.05 * np.sin(3 * time), time], axis=1)
    local = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_quat(scalar_first=True).reshape(frames, BODY_JOINTS, 4)
    return ClipToWrite("walk", smpl_clip(root, local, fps, offsets=offsets), 1.0)


def floored(offsets: Float64Array = OFFSETS, frames: int = 60, seed: int = 0) -> Float64Array:
    return placed(solve(clip_of(turns(frames, seed), offsets).clip).positions)[0]


def saved(path: Path, array: Any) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    np.save(path, array)
    return path


def relative(world: Float64Array) -> Float64Array:
    """Global rotations of joints as the pelvis sees them."""
    return multiply(conjugate(world[:, :1]), world)


def test_features_are_those_of_the_published_definition() -> None:
    positions = solve(clip_of(turns(60), TALLER).clip).positions
    floor, _ = placed(positions)
    np.testing.assert_allclose(floor, oracle.on_the_floor(positions), atol=CLOSE)
    made, expected = features(floor), oracle.features(floor)
    assert made.shape == (59, 263)
    for group in GROUPS:
        np.testing.assert_allclose(made[:, group], expected[:, group], atol=CLOSE)
    assert 0 < made[:, 259:].mean() < 1


def test_joints_are_recovered_as_published() -> None:
    rows = features(floored())
    found = recovered(rows).positions
    np.testing.assert_allclose(found[:-1], oracle.recovered_joints(rows), atol=CLOSE)


@given(st.integers(0, 10_000), st.integers(2, 40), st.floats(0, 0.6))
@settings(max_examples=25, deadline=None)
def test_recovery_is_the_inverse(seed: int, frames: int, reach: float) -> None:
    floor, _ = placed(solve(clip_of(turns(frames, seed, reach)).clip).positions)
    rows = features(floor)
    again, _ = placed(recovered(rows).positions)
    np.testing.assert_allclose(again, floor, atol=CLOSE)
    np.testing.assert_allclose(features(again), rows, atol=CLOSE)


@pytest.mark.parametrize("twist", [False, True])
def test_the_rotations_alone_put_joints_where_the_places_do(twist: bool) -> None:
    """As the dataset's own chains of bones have it, whether turns about bones are in or not."""
    rows = humanml3d_features(clip_of(turns(60)), twist=twist)
    joints = oracle.recovered_joints(rows)
    lengths = np.linalg.norm(OFFSETS[:BODY_JOINTS], axis=1)
    heading = oracle.headings(placed(solve(clip_of(turns(60)).clip).positions)[0])[0]
    by_turns = oracle.joints_by_rotations(rows, lengths, oracle.angle_about_y(heading))
    # By rotations joints are as the features' first frame lay before it was turned, by the heading, to face +z.
    seen = np.array([heading.inv().apply(frame) for frame in joints - joints[:, :1]])
    np.testing.assert_allclose(by_turns, seen, atol=CLOSE)


def test_joints_go_in_as_they_are(tmp_path: Path) -> None:
    floor = floored()
    [clip] = read_clips(saved(tmp_path / "new_joints" / "a.npy", floor.astype(np.float32)))
    assert (clip.hierarchy.joints, clip.hierarchy.kind) == (JOINTS[:BODY_JOINTS], ChannelKind.POSITIONS)
    assert (clip.fps, clip.up, clip.metres_per_unit, clip.twist) == (20.0, "y", 1.0, False)
    np.testing.assert_allclose(solve(clip).positions, floor, atol=CLOSE)


def test_features_of_the_dataset_go_in_with_their_own_bones_and_without_twist(tmp_path: Path) -> None:
    rows = oracle.features(floored(TALLER))
    [clip] = read_clips(saved(tmp_path / "a.npy", rows))
    found = solve(clip).positions
    assert len(found) == 60, "the ways of the last row lead to one more frame"
    np.testing.assert_allclose(found[:-1], oracle.recovered_joints(rows), atol=CLOSE)
    assert not clip.twist
    assert any("turns about bones" in note for note in clip.notes)
    lengths = np.linalg.norm(clip.hierarchy.offsets[1:], axis=1)
    np.testing.assert_allclose(lengths, np.linalg.norm(TALLER[1:], axis=1), atol=CLOSE)


def test_features_with_twist_give_the_rotations_back(tmp_path: Path) -> None:
    made = clip_of(turns(60))
    [clip] = read_clips(saved(tmp_path / "a.npy", humanml3d_features(made, twist=True)))
    assert clip.twist
    assert not clip.notes
    world, expected = solve(clip).world, solve(made.clip).world
    assert world is not None
    assert expected is not None
    # The last frame has no numbers of rotations.
    assert angle(relative(world), relative(expected))[:-1, BORNE].max() < 1e-4
    assert angle(relative(world), relative(expected))[-1, BORNE].max() < 5
    [plain] = read_clips(saved(tmp_path / "b.npy", humanml3d_features(made, twist=False)))
    untold = solve(plain).world
    assert untold is not None
    np.testing.assert_allclose(solve(plain).positions, solve(clip).positions, atol=CLOSE)
    assert angle(relative(untold), relative(expected))[:, BORNE].max() > 10


def test_limbs_without_twist_bend_about_their_hinges(tmp_path: Path) -> None:
    vectors, bend = turns(60, reach=0.5), 0.8 + 0.4 * np.sin(np.linspace(0, 6, 60))
    vectors[:, BORNE[1:]] *= np.isin(BORNE[1:], list(HINGES))[:, None]
    for upper, axis in HINGES.items():
        vectors[:, CHILDREN[upper][0]] = bend[:, None] * np.array(axis)
    made = clip_of(vectors)
    [clip] = read_clips(saved(tmp_path / "a.npy", humanml3d_features(made, twist=False)))
    world, expected = solve(clip).world, solve(made.clip).world
    assert world is not None
    assert expected is not None
    off = angle(relative(world), relative(expected))[:, list(HINGES)]
    # Limbs of SMPL's T-pose are some degrees from straight.
    assert off.max() < 16
    assert off.mean() < 7


def test_a_piece_of_a_motion_is_read_too(tmp_path: Path) -> None:
    """Its first frame faces anywhere, and rotations are counted from a heading that is not in the file."""
    made = clip_of(turns(60))
    piece = humanml3d_features(made, twist=True)[20:45]
    [clip] = read_clips(saved(tmp_path / "a.npy", piece))
    assert clip.twist
    world, expected = solve(clip).world, solve(made.clip).world
    assert world is not None
    assert expected is not None
    assert angle(relative(world)[:-1], relative(expected)[20:45])[:, BORNE].max() < 1e-4
    np.testing.assert_allclose(solve(clip).positions[:-1], oracle.recovered_joints(piece), atol=CLOSE)


def test_bones_that_change_their_lengths_are_told(tmp_path: Path) -> None:
    rows = features(floored())
    rows[:, 4:67] *= 1 + 0.02 * np.sin(np.arange(59))[:, None]
    [clip] = read_clips(saved(tmp_path / "a.npy", rows))
    assert any("mm from where the features say" in note for note in clip.notes)


def exported(lake: Path, out: Path, *words: object) -> Path:
    run = motionlake("export", "--lake", lake, "--out", out, *words)
    assert run.status == 0, run.err
    return out


@pytest.mark.parametrize("form", ["humanml3d", "humanml3d-twist"])
def test_features_come_back_the_same_through_bvh(form: str, tmp_path: Path, scheduler: str) -> None:
    """Features, lake, BVH, lake, features; and in the BVH each joint turns as the numbers say."""
    twist = form == "humanml3d-twist"
    made = clip_of(turns(60), OFFSETS if twist else TALLER)
    rows = humanml3d_features(made, twist=twist)
    saved(tmp_path / "given" / "walk.npy", rows)
    for source, lake in (("given", "one"), ("bvh", "two")):
        run = motionlake("ingest", tmp_path / source, "--lake", tmp_path / lake, "--scheduler", scheduler)
        assert run.status == 0, run.err
        if source == "given":
            assert query(tmp_path / lake, "SELECT rig, fps, frames, twist FROM clips") == [("smpl", 20.0, 60, twist)]
            exported(tmp_path / lake, tmp_path / "bvh", "--where", "true", "--format", "bvh")
    [bvh] = read_clips(tmp_path / "bvh" / "walk.bvh")
    world, expected = solve(bvh).world, solve(made.clip).world
    assert world is not None
    assert expected is not None
    order = [bvh.hierarchy.joints.index(name) for name in JOINTS[:BODY_JOINTS]]
    off = angle(relative(world[:, order]), relative(expected))[:-1, BORNE]
    assert (off.max() < 1e-3) == twist
    for lake in ("one", "two"):
        out = exported(tmp_path / lake, tmp_path / f"out_{lake}", "--where", "true", "--format", form)
        again = np.load(out / "new_joint_vecs" / "walk.npy", allow_pickle=False)
        assert again.dtype == np.float32
        others = np.r_[0:67, 193:259]
        np.testing.assert_allclose(again[:, others], rows[:, others], atol=5e-5)
        # The smallest turn onto nearly the opposite direction magnifies what a lake rounds off.
        np.testing.assert_allclose(again[:, TURNS], rows[:, TURNS], atol=5e-4)
        assert (again[:, 259:] != rows[:, 259:]).mean() < 0.01
    out = exported(tmp_path / "one", tmp_path / "posed", "--where", "true", "--format", form, "--tpose")
    joints = np.load(out / "new_joints" / "walk.npy")
    assert len(joints) == 60
    arm = joints[0, INDEX["left_wrist"]] - joints[0, INDEX["left_shoulder"]]
    assert abs(arm[1]) < 0.1 * np.linalg.norm(arm)


def test_a_set_is_laid_out_as_the_dataset(tmp_path: Path) -> None:
    facts: list[Mapping[str, object]] = [{"label": "walk_slow#2"}, {"label": None}, {}]
    clips = [ClipToWrite("a/walk.bvh", clip_of(turns(30, at)).clip, 1.0, "y", facts[at]) for at in range(3)]
    one_frame = ClipToWrite("still.bvh", clip_of(turns(1)).clip, 1.0)
    clips.insert(1, one_frame)
    [(number, reason)] = set_writers()["humanml3d"].write_all(iter(clips), tmp_path)
    assert (number, "one frame" in str(reason)) == (1, True)
    assert (tmp_path / "all.txt").read_text().split() == ["walk", "walk-2", "walk-3"]
    assert (tmp_path / "texts" / "walk.txt").read_text() == "walk slow 2#walk/OTHER slow/OTHER 2/OTHER#0.0#0.0\n"
    assert [path.name for path in (tmp_path / "texts").iterdir()] == ["walk.txt"]
    rows = [np.load(tmp_path / "new_joint_vecs" / f"{name}.npy") for name in ("walk", "walk-2", "walk-3")]
    for name, each in zip(("walk", "walk-2", "walk-3"), rows, strict=True):
        joints = np.load(tmp_path / "new_joints" / f"{name}.npy")
        assert joints.shape == (29, 22, 3)
        np.testing.assert_allclose(joints, oracle.recovered_joints(each.astype(float)), atol=1e-5)
    every = np.concatenate(rows).astype(float)
    np.testing.assert_allclose(np.load(tmp_path / "Mean.npy"), every.mean(0), atol=1e-5)
    deviation = np.load(tmp_path / "Std.npy")
    np.testing.assert_allclose(deviation[4:67], every.std(0)[4:67].mean(), atol=1e-5)
    np.testing.assert_allclose(deviation[259:], every.std(0)[259:].mean(), atol=1e-5)
    assert not is_clip(tmp_path / "Mean.npy")
    assert not is_clip(tmp_path / "Std.npy")


def test_clips_leave_at_the_dataset_s_rate_and_on_its_body(clips_folder: Path, tmp_path: Path, scheduler: str) -> None:
    lake = tmp_path / "lake"
    assert motionlake("ingest", clips_folder, "--lake", lake, "--scheduler", scheduler).status == 0
    out = exported(lake, tmp_path / "out", "--where", "true", "--format", "humanml3d")
    manifest = json.loads((out / "manifest.json").read_text(encoding="utf-8"))
    names = (out / "all.txt").read_text(encoding="utf-8").split("\n")[:-1]
    assert len(names) == len(manifest["clips"]) > 1
    for name, row in zip(names, manifest["clips"], strict=True):
        rows = np.load(out / "new_joint_vecs" / f"{name}.npy").astype(float)
        assert (row["fps"], len(rows) + 1) == (20.0, row["frames"])
        joints = np.load(out / "new_joints" / f"{name}.npy").astype(float)
        thigh = np.linalg.norm(joints[:, INDEX["left_knee"]] - joints[:, INDEX["left_hip"]], axis=-1)
        np.testing.assert_allclose(thigh, np.linalg.norm(OFFSETS[INDEX["left_knee"]]), atol=1e-3)
        assert abs(joints[..., 1].min()) < 0.05
        np.testing.assert_allclose(joints[0, 0, [0, 2]], 0.0, atol=CLOSE)
    out = exported(lake, tmp_path / "fast", "--where", "true", "--format", "humanml3d", "--fps", 60)
    assert {row["fps"] for row in json.loads((out / "manifest.json").read_text())["clips"]} == {60.0}


def standardised() -> Float64Array:
    rows = np.concatenate([features(floored(seed=seed)) for seed in range(4)])
    return np.asarray((rows - rows.mean(0)) / (rows.std(0) + 1e-3))


@pytest.mark.parametrize(
    ("array", "reason"),
    [
        (standardised(), "multiply by Std.npy and add Mean.npy"),
        (np.zeros((20, 263)), "multiply by Std.npy"),
        (np.zeros((20, 251)), "of KIT-ML, whose skeleton is another"),
        (np.zeros((20, 21, 3)), "of KIT-ML"),
        (np.zeros((20, 24, 3)), r"not \[frames, 22, 3\] or \[frames, 263\]"),
        (np.full((20, 22, 3), np.nan), "not finite"),
        (np.full((20, 263), 1e300), "absurdly large"),
        (np.zeros((0, 263)), "has no frame"),
        (np.array([["a"] * 263] * 3), "not numbers"),
        (np.array([[None] * 263] * 3), "Python objects, which are never loaded"),
    ],
)
def test_what_is_wrong_is_said(array: Any, reason: str, tmp_path: Path) -> None:
    with pytest.raises(ClipError, match=reason):
        read_clips(saved(tmp_path / "a.npy", array))


def test_other_arrays_are_no_clips(tmp_path: Path) -> None:
    for shape in ((263,), (20, 24, 3), (20, 7), ()):
        assert not is_clip(saved(tmp_path / "a.npy", np.zeros(shape)))
    path = saved(tmp_path / "a.npy", np.zeros((5, 263)))
    assert is_clip(path)
    path.write_bytes(path.read_bytes()[20:])
    assert is_clip(path), "what is damaged is rejected, not passed over"


def joints_bytes() -> bytes:
    stream = io.BytesIO()
    np.save(stream, floored(frames=12).astype(np.float32))
    return stream.getvalue()


@pytest.mark.parametrize("good", [humanml3d_bytes(), joints_bytes()], ids=["features", "joints"])
def test_two_hundred_damaged_files_are_read_or_rejected(good: bytes, tmp_path: Path) -> None:
    rng, path, reasons = np.random.default_rng(3), tmp_path / "a.npy", []
    for number in range(200):
        path.write_bytes(DAMAGES[number % len(DAMAGES)](good, rng))
        try:
            for clip in read_clips(path):
                assert np.isfinite(solve(clip).positions).all()
        except ClipError as error:
            reasons.append(str(error))
    assert 60 < len(reasons) < 200
    assert all(3 < len(reason) < 300 and "\n" not in reason for reason in reasons)
    assert not [reason for reason in reasons if "Error:" in reason]


def test_a_header_that_promises_too_much_is_turned_away(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.npy", np.zeros((1_001, 263), np.float16))
    with pytest.raises(ClipError, match=r"has 1001 frames; \[limits\] frames = 1000"):
        read_clips(path, allowed=Limits(frames=1_000))
    wide = saved(tmp_path / "b.npy", np.zeros((2, 5_000_000), np.float16))
    with pytest.raises(ClipError, match=r"MiB of memory; \[limits\] memory_megabytes = 32"):
        read_clips(wide, allowed=Limits(memory_megabytes=32))
    data = path.read_bytes().replace(b"(1001, 263)", b"(9e99, 263)")
    path.write_bytes(data)
    with pytest.raises(ClipError, match="damaged header"):
        read_clips(path)


def test_parents_of_the_oracle_are_smpl_s() -> None:
    assert {joint: chain[at] for chain in oracle.CHAINS for at, joint in enumerate(chain[1:])} == dict(
        enumerate(PARENTS[1:BODY_JOINTS], start=1)
    )
