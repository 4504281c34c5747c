"""FBX in: a skeleton written by hand as text, against what it says and against the scene that ufbx itself evaluates."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from motionlake.errors import ClipError
from motionlake.formats import read_clips
from motionlake.motion.kinematics import solve

from tests.samples import fbx_text

pytest.importorskip("ufbx")


def test_bones_are_where_the_file_says(tmp_path: Path) -> None:
    path = tmp_path / "walk.fbx"
    path.write_text(fbx_text())
    [clip] = read_clips(path)
    positions = solve(clip).positions
    assert clip.hierarchy.joints == ("Hips", "Spine", "Head")
    assert (clip.fps, clip.up, clip.metres_per_unit, len(positions)) == (30.0, "y", 1.0, 12)
    np.testing.assert_allclose(positions[:, 0, 0], 0.02 * np.arange(12), atol=1e-6)
    np.testing.assert_allclose(positions[:, 0, 1], 0.9, atol=1e-6)  # z up in the file
    turn = np.radians(3.0 * np.arange(12))
    np.testing.assert_allclose(positions[:, 2, 0] - positions[:, 1, 0], 0.3 * np.sin(turn), atol=1e-6)
    np.testing.assert_allclose(positions[:, 2, 1] - positions[:, 1, 1], 0.3 * np.cos(turn), atol=1e-6)


POSED = """
import json, os, sys, ufbx
scene = ufbx.load_file(sys.argv[1], target_axes=ufbx.axes_right_handed_y_up, target_unit_meters=1.0)
anim, found = scene.anim_stacks[0].anim, []
for frame in (0, 5, 11):
    posed = ufbx.evaluate_scene(scene, anim, frame / 30)
    worlds = {node.name: node.node_to_world.c3 for node in posed.nodes}
    found.append([[worlds[name].x, worlds[name].y, worlds[name].z] for name in ("Hips", "Spine", "Head")])
print(json.dumps(found), flush=True)
os._exit(0)
"""


def test_the_scene_that_ufbx_evaluates_agrees(tmp_path: Path) -> None:
    path = tmp_path / "walk.fbx"
    path.write_text(fbx_text())
    [clip] = read_clips(path)
    ran = subprocess.run([sys.executable, "-c", POSED, path], capture_output=True, text=True, check=True)
    np.testing.assert_allclose(solve(clip).positions[[0, 5, 11]], json.loads(ran.stdout), atol=1e-6)


def test_two_stacks_are_two_clips(tmp_path: Path) -> None:
    text = fbx_text()
    stack = text[text.index("AnimationStack: 50") : text.index("AnimationLayer: 51")]
    again = stack.replace("50", "80", 1).replace("AnimStack::walk", "AnimStack::stand")
    layer = 'AnimationLayer: 81, "AnimLayer::base", "" {\n}\n'
    text = text.replace("AnimationLayer: 51", again + layer + "AnimationLayer: 51", 1)
    path = tmp_path / "two.fbx"
    path.write_text(text.replace('C: "OO",51,50', 'C: "OO",51,50\nC: "OO",81,80'))
    walk, stand = sorted(read_clips(path), key=lambda clip: clip.body, reverse=True)
    assert (walk.body, stand.body) == ("walk", "stand")
    assert np.ptp(solve(walk).positions[:, 0, 0]) > 0.1
    assert np.ptp(solve(stand).positions) > 0  # bones are apart
    assert np.ptp(solve(stand).positions, axis=0).max() < 1e-9  # and do not move


@pytest.mark.parametrize("end", ["kill -SEGV $$", "echo nothing that anybody reads >&2; exit 1"])
def test_a_library_that_ends_its_process_rejects_the_file_and_nothing_else(
    end: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "walk.fbx"
    path.write_text(fbx_text())
    ends = tmp_path / "python"
    ends.write_text(f"#!/bin/sh\n{end}\n")
    ends.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(ends))
    with pytest.raises(ClipError, match="it ended while it read the file"):
        read_clips(path)


def test_more_frames_than_the_limit_are_not_made_room_for(tmp_path: Path) -> None:
    path = tmp_path / "long.fbx"
    path.write_text(fbx_text().replace(str(round(11 * 46186158000 / 30)), str(10**6 * 46186158000)))
    with pytest.raises(ClipError, match=r"has 30000001 frames; \[limits\] frames = 1000000 in config.toml"):
        read_clips(path)


def test_a_file_without_bones_says_so(tmp_path: Path) -> None:
    path = tmp_path / "walk.fbx"
    path.write_text(fbx_text().replace("LimbNode", "Null"))
    with pytest.raises(ClipError, match="has no bones"):
        read_clips(path)


BAKED = """
import json, os, sys, numpy as np, ufbx
from motionlake.formats.parse import fbx_nodes
scene = ufbx.load_file(sys.argv[1], inherit_mode_handling=ufbx.InheritModeHandling.COMPENSATE_NO_FALLBACK)
nodes, stacks = list(scene.nodes), list(scene.anim_stacks)
found = []
for rate in (30.0, 75.0):  # at every key, and between them
    times = np.arange(int(11 / 30 * rate) + 1) / rate
    baked = fbx_nodes._moved(ufbx, scene, stacks[0].anim, nodes, times, rate)
    for at, node in enumerate(nodes):
        asked = fbx_nodes._placing([ufbx.evaluate_transform(stacks[0].anim, node, time) for time in times.tolist()])
        [kept] = baked.of_nodes([at])
        sign = np.sign((asked.rotation * kept.rotation).sum(axis=1, keepdims=True))
        apart = (asked.translation - kept.translation, asked.rotation * sign - kept.rotation, asked.scale - kept.scale)
        found += [float(np.abs(each).max()) for each in apart]
print(json.dumps(found), flush=True)
os._exit(0)
"""


@pytest.mark.parametrize("flags", [2, 4, 8])  # constant, linear, cubic
@pytest.mark.parametrize("inherit", [0, 1, 2])
def test_baked_keys_are_what_ufbx_evaluates(flags: int, inherit: int, tmp_path: Path) -> None:
    path = tmp_path / "walk.fbx"
    properties = (
        'Properties70: {\nP: "RotationActive", "bool", "", "",1\nP: "PreRotation", "Vector3D", "Vector", "",10,20,30\n'
        f'P: "InheritType", "enum", "", "",{inherit}\nP: "RotationOrder", "enum", "", "",3\n'
        'P: "Lcl Scaling", "Lcl Scaling", "", "A",1,2,1.5\nP: "Lcl Translation"'
    )
    text = fbx_text().replace('Properties70: {\nP: "Lcl Translation"', properties)
    text = text.replace("KeyAttrFlags: *1 {\na: 4\n}", f"KeyAttrFlags: *1 {{\na: {flags}\n}}")
    if inherit:  # scales that move
        text = text.replace('60,1, "Lcl Translation"', '60,1, "Lcl Scaling"')
    path.write_text(text)
    ran = subprocess.run([sys.executable, "-c", BAKED, path], capture_output=True, text=True, check=True)
    assert max(json.loads(ran.stdout)) < 1e-9
