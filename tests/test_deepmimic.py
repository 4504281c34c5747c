"""DeepMimic motions: made ones, and the published ones where `make demo` has put them into the checkout."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import numpy as np
import pytest
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats import is_clip, read_clips
from motionlake.formats.deepmimic import READER
from motionlake.motion.clip import SourceClip
from motionlake.motion.kinematics import solve
from scipy.spatial.transform import Rotation

from tests.samples import deepmimic_frames, deepmimic_text

DEMO = Path(__file__).parents[1] / "demo" / "deepmimic"


def read(text: str) -> SourceClip:
    (clip,) = READER.read(text.encode(), Path("humanoid3d_made.txt"))
    return clip


def leg_angles(forwards: Float64Array, upwards: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Hip and knee angles about z that put the ankle there as seen from the hip, the knee in front."""
    thigh, shin = 0.421546, 0.409870
    reach = np.hypot(forwards, upwards)
    knee = -np.arccos((reach**2 - thigh**2 - shin**2) / (2 * thigh * shin))
    lean = np.arccos((thigh**2 + reach**2 - shin**2) / (2 * thigh * reach))
    return np.arctan2(forwards, -upwards) + lean, knee


def made_walk() -> str:
    """A walk towards +x at 1.2 m/s: each foot rests at one place for half of a step of 1 s, then swings."""
    frames = deepmimic_frames(60)
    time = np.arange(60) / 30
    frames[:, 1], frames[:, 2] = 1.2 * time, 0.75
    for hip, knee, phase in ((16, 20, 0.0), (30, 34, 0.5)):
        step, within = np.divmod(time + phase, 1.0)
        swing = np.clip(2 * within - 1, 0, 1)
        place = 1.2 * (step + swing + 0.25 - phase)
        angle, frames[:, knee] = leg_angles(place - frames[:, 1], 0.08 + 0.1 * np.sin(np.pi * swing) - 0.75)
        frames[:, hip], frames[:, hip + 3] = np.cos(angle / 2), np.sin(angle / 2)
    return deepmimic_text(frames)


def published(pattern: str) -> dict[str, str]:
    """Motions that `make demo` has put into the checkout, if it was run, by name."""
    return {path.stem: path.read_text() for path in sorted(DEMO.glob(pattern))}


WALKS = {"made": made_walk()} | published("humanoid3d_walk.txt")
MOTIONS = {"made": deepmimic_text(deepmimic_frames(12))} | published("*.txt")


@pytest.mark.parametrize("name", WALKS)
def test_a_walk_stands_on_its_feet_and_moves_forwards(name: str) -> None:
    """A wrong offset, axis or quaternion order makes the standing foot slide or leave the ground."""
    clip = read(WALKS[name])
    positions = solve(clip).positions
    speed = np.linalg.norm(np.diff(positions, axis=0), axis=2) * clip.fps
    ankles = [clip.hierarchy.joints.index(f"{side}_ankle") for side in ("left", "right")]
    assert np.median(speed[:, 0]) > 0.9
    assert np.median(speed[:, ankles].min(axis=1)) < (1e-6 if name == "made" else 0.1)
    lower = positions[:, ankles, 1].min(axis=1)
    assert np.ptp(lower) < (1e-6 if name == "made" else 0.08)
    left, right = positions[:, clip.hierarchy.joints.index("left_hip")], positions[:, 3]
    facing = np.cross([0.0, 1.0, 0.0], (right - left).mean(axis=0))
    travelled = positions[-1, 0] - positions[0, 0]
    assert facing @ travelled > 0
    assert travelled[0] > 0


@pytest.mark.parametrize("text", MOTIONS.values(), ids=MOTIONS)
def test_a_motion_is_read_in_full_or_refused_as_another_characters(text: str, tmp_path: Path) -> None:
    (tmp_path / "x.txt").write_text(text)
    assert is_clip(tmp_path / "x.txt")
    frames = json.loads(text)["Frames"]
    if len(frames[0]) != 44:
        with pytest.raises(ClipError, match=rf"frame 0 has {len(frames[0])} numbers, a DeepMimic humanoid has 44"):
            read(text)
        return
    clip = read(text)
    durations = np.array([frame[0] for frame in frames[:-1]])
    even = np.ptp(durations) < 1e-4
    assert clip.fps in (16.0, 24.0, 30.0, 60.0)
    assert clip.fps == pytest.approx(1 / np.median(durations), rel=1e-3)
    assert len(clip.channels) == (len(frames) if even else round(durations.sum() * clip.fps) + 1)
    assert bool(clip.notes) != even


def test_channels_hold_the_numbers_of_the_file() -> None:
    rng = np.random.default_rng(3)
    frames = deepmimic_frames(6)
    frames[:, 1:] += rng.normal(0.0, 0.3, (6, 43))
    clip = read(deepmimic_text(frames))
    assert clip.fps == 30.0
    frames[:, 0] = 1 / 29.97
    assert read(deepmimic_text(frames)).fps == pytest.approx(29.97)
    column = dict(zip(clip.hierarchy.channel_names, clip.channels.T, strict=True))
    raw = [column[f"root.{axis}position"] for axis in "XYZ"]
    hinges = {"right_knee", "right_elbow", "left_knee", "left_elbow"}
    for joint in clip.hierarchy.joints:
        if joint in hinges:
            w, x, y, z = (column[f"{joint}.{axis}quaternion"] for axis in "WXYZ")
            raw.append(2.0 * np.arctan2(z, w))
            assert not x.any()
            assert not y.any()
        elif not joint.endswith("_wrist"):
            raw += [column[f"{joint}.{axis}quaternion"] for axis in "WXYZ"]
    np.testing.assert_allclose(np.stack(raw, axis=1), frames[:, 1:], atol=1e-12)


def test_knees_bend_backwards_and_elbows_forwards() -> None:
    clip = read(deepmimic_text(deepmimic_frames(8)))
    assert len(clip.channels) == 8
    place = dict(zip(clip.hierarchy.joints, solve(clip).positions[0], strict=True))
    for side, across in (("left", -1.0), ("right", 1.0)):
        assert place[f"{side}_ankle"][0] < place[f"{side}_knee"][0] - 0.01
        assert place[f"{side}_wrist"][0] > place[f"{side}_elbow"][0] + 0.1
        # Facing +x with y up, the body's right is +z.
        assert across * place[f"{side}_shoulder"][2] > 0.1


def test_uneven_durations_are_resampled_along_the_shortest_turn() -> None:
    frames = deepmimic_frames(9)
    frames[:, 0] = 0.05
    angles = np.linspace(0.0, 1.6, 9)
    frames[:, 4], frames[:, 6] = np.cos(angles / 2), np.sin(angles / 2)
    thinned = np.delete(frames, [3, 4], axis=0)
    thinned[2, 0] = 0.15
    thinned[-1, 0] = 0.0
    thinned[4, 4:8] *= -1.0
    clip = read(deepmimic_text(thinned))
    assert clip.fps == pytest.approx(20.0)
    assert clip.channels.shape[0] == 9
    assert "resampled to 20 frames a second" in clip.notes[0]
    turns = Rotation.from_quat(clip.channels[:, 3:7], scalar_first=True).magnitude()
    np.testing.assert_allclose(turns, angles, atol=1e-9)
    np.testing.assert_allclose(clip.channels[:, 0], frames[:, 1], atol=1e-9)


def changed(row: int, column: int, value: float) -> Float64Array:
    frames = deepmimic_frames(5)
    frames[row, column] = value
    return frames


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{", "line 1: is not JSON"),
        ('{"Loop": "wrap"}', 'is JSON without a list "Frames"'),
        ("[1, 2]", 'is JSON without a list "Frames"'),
        ('{"Frames": [[1]]}', "has 1 frame"),
        ('{"Frames": [1, 2]}', "frame 0 is no list"),
        (deepmimic_text(deepmimic_frames(3)[:, :43]), "frame 0 has 43 numbers"),
        (deepmimic_text(deepmimic_frames(3)).replace("0.85", '"0.85"', 1), "frame 0 holds something that is"),
        (deepmimic_text(changed(2, 1, np.nan)), "frame 2 holds a number that is not finite"),
        (deepmimic_text(changed(3, 2, 1e300)), "frame 3 holds a number that is not finite or absurdly"),
        (deepmimic_text(deepmimic_frames(3)).replace("0.85", "9" * 400, 1), "out of range"),
        (deepmimic_text(changed(1, 0, 0.0)), "frame 1 lasts 0 s"),
        (deepmimic_text(changed(1, 0, 1e4)), "frames last from"),
        (deepmimic_text(changed(4, 8, 0.0)), "frame 4: the quaternion of chest is no rotation"),
        ("[" * 100_000, "is not JSON"),
    ],
)
def test_a_fault_is_rejected_with_its_reason(text: str, reason: str) -> None:
    with pytest.raises(ClipError) as caught:
        read(text)
    assert reason in str(caught.value)


def test_only_texts_that_look_like_a_motion_are_clips(tmp_path: Path) -> None:
    contents = {
        "motion.txt": deepmimic_text(deepmimic_frames(3)),
        "motion.json": json.dumps({"Frames": deepmimic_frames(3).tolist()}),
        "other.json": '{"name": "hop",\n "Frames" : [[0.1, 2]]}',
        "cut.txt": deepmimic_text(deepmimic_frames(30))[200:],
        "scrambled.txt": "\ufffd" * 4096 + deepmimic_text(deepmimic_frames(30))[4096:],
        "notes.txt": 'Frames of the "Loop" are kept in {curly} brackets',
        "settings.json": '{"frames": 3, "Frames": 7, "Loop": true, "loops": ["wrap"]}',
        "matrices.json": json.dumps({"camera": np.eye(4).ravel().tolist(), "words": [[0.5] * 43, [0.5] * 45]}),
        "table.txt": "\n".join(" ".join(["0.5"] * 44) for _ in range(9)),
        "empty.txt": "",
    }
    for name, content in contents.items():
        (tmp_path / name).write_text(content)
    clips = {name for name in contents if is_clip(tmp_path / name)}
    assert clips == {"motion.txt", "motion.json", "other.json", "cut.txt", "scrambled.txt"}
    for name in ("other.json", "cut.txt", "scrambled.txt"):
        with pytest.raises(ClipError, match=r"JSON|has 1 frame"):
            read_clips(tmp_path / name)


def test_a_compressed_text_is_looked_into_and_a_damaged_one_is_not_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "x.txt.gz"
    for text, expected in ((deepmimic_text(deepmimic_frames(3)), True), ("notes " * 9, False)):
        stream = gzip.compress(text.encode())
        path.write_bytes(stream)
        assert is_clip(path) is expected
        path.write_bytes(stream[:-9])
        assert is_clip(path) is expected
        path.write_bytes(stream[9:])
        assert is_clip(path)
        with pytest.raises(ClipError, match="gzip"):
            read_clips(path)
