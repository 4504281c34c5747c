"""DeepMimic motions: the published ones where pybullet's data is installed, and made ones for the faults."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.clip import SourceClip
from pipeline.errors import ClipError
from pipeline.formats import is_clip
from pipeline.formats.deepmimic import CHARACTER, READER
from pipeline.kinematics import solve
from tests.samples import FloatArray, deepmimic_frames, deepmimic_text

URDF_SCALE = 4.0


@pytest.fixture(scope="module")
def published() -> Path:
    """The data folder of the PyPI package pybullet, which carries DeepMimic's motions and character."""
    spec = importlib.util.find_spec("pybullet_data")
    if spec is None or not spec.submodule_search_locations:
        pytest.skip("pybullet_data is not installed: no published DeepMimic motions here")
    return Path(spec.submodule_search_locations[0])


def read(text: str) -> SourceClip:
    (clip,) = READER.read(text.encode(), Path("humanoid3d_made.txt"))
    return clip


def test_rest_offsets_are_those_of_the_published_character(published: Path) -> None:
    tree = ElementTree.fromstring((published / "humanoid" / "humanoid.urdf").read_bytes().strip(b"\0 \n"))
    found = {}
    for joint in tree.iter("joint"):
        link, origin = joint.find("parent"), joint.find("origin")
        assert link is not None
        assert origin is not None
        offset = np.array([float(value) for value in origin.attrib["xyz"].split()])
        found[joint.attrib["name"]] = (link.attrib["link"], offset / URDF_SCALE)
    for name, index, _, offset in CHARACTER[1:]:
        parent_name, published_offset = found[name]
        assert parent_name == CHARACTER[index][0]
        np.testing.assert_allclose(offset, published_offset, atol=1e-9)


def test_published_walk_stands_on_its_feet_and_moves_forwards(published: Path) -> None:
    """A wrong offset, axis or quaternion order makes the standing foot slide or leave the ground."""
    path = published / "data" / "motions" / "humanoid3d_walk.txt"
    (clip,) = READER.read(path.read_bytes(), path)
    positions = solve(clip).positions
    speed = np.linalg.norm(np.diff(positions, axis=0), axis=2) * clip.fps
    ankles = [clip.hierarchy.joints.index(f"{side}_ankle") for side in ("left", "right")]
    assert np.median(speed[:, 0]) > 0.9
    assert np.median(speed[:, ankles].min(axis=1)) < 0.1
    lower = positions[:, ankles, 1].min(axis=1)
    assert np.ptp(lower) < 0.08
    left, right = positions[:, clip.hierarchy.joints.index("left_hip")], positions[:, 3]
    facing = np.cross([0.0, 1.0, 0.0], (right - left).mean(axis=0))
    travelled = positions[-1, 0] - positions[0, 0]
    assert facing @ travelled > 0
    assert travelled[0] > 0


def test_published_motions_are_read_and_another_character_is_not(published: Path) -> None:
    folder = published / "data" / "motions"
    for path in sorted(folder.rglob("humanoid3d_*.txt")):
        assert is_clip(path)
        (clip,) = READER.read(path.read_bytes(), path)
        frames = json.loads(path.read_text())["Frames"]
        assert clip.fps in (16.0, 24.0, 30.0, 60.0)
        assert clip.fps == pytest.approx(1 / frames[0][0], rel=1e-3)
        # One dropped frame in the roll: its next one lasts twice as long.
        assert len(clip.channels) == len(frames) + (path.stem == "humanoid3d_roll")
        assert bool(clip.notes) == (path.stem == "humanoid3d_roll")
    dog = folder / "laikago_walk.txt"
    with pytest.raises(ClipError, match="frame 0 has 20 numbers, a DeepMimic humanoid has 44 a frame"):
        READER.read(dog.read_bytes(), dog)


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


def changed(row: int, column: int, value: float) -> FloatArray:
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
        "notes.txt": 'Frames of the "Loop" are kept in {curly} brackets',
        "settings.json": '{"frames": 3}',
        "empty.txt": "",
    }
    for name, content in contents.items():
        (tmp_path / name).write_text(content)
    assert {name for name in contents if is_clip(tmp_path / name)} == {"motion.txt", "motion.json"}
