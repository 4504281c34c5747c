"""USD in: stages that usd-core writes, of real clips by forward kinematics, and what a stage may not do."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from motionlake.errors import ClipError
from motionlake.formats import read_clips
from motionlake.formats.clip_checks import check_clip
from motionlake.formats.limits_config import Limits
from motionlake.formats.parse import usd_library
from motionlake.formats.parse.scene_nodes import SceneNodes
from motionlake.motion.clip import SolvedMotion, SourceClip
from motionlake.motion.kinematics import solve
from motionlake.motion.rotations import conjugate, multiply, rotate, to_matrix

from tests.damage import DAMAGES
from tests.samples import lacking, usda_text

if reason := lacking(".usda"):
    pytest.skip(reason, allow_module_level=True)
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, UsdUtils, Vt


def test_bones_are_where_the_file_says(tmp_path: Path) -> None:
    path = tmp_path / "walk.usda"
    path.write_text(usda_text())
    [clip] = read_clips(path)
    positions = solve(clip).positions
    assert clip.hierarchy.joints == ("Hips", "Spine", "Head")
    assert (clip.fps, clip.up, clip.metres_per_unit, clip.body, len(positions)) == (30.0, "z", 0.01, "", 12)
    np.testing.assert_allclose(positions[:, 0, 0], 2.0 * np.arange(12), atol=1e-4)
    turn = np.radians(3.0 * np.arange(12))
    np.testing.assert_allclose(positions[:, 2, 0] - positions[:, 1, 0], 30 * np.sin(turn), atol=1e-4)
    np.testing.assert_allclose(positions[:, 2, 2] - positions[:, 1, 2], 30 * np.cos(turn), atol=1e-4)


def paths_of(clip: SourceClip) -> list[str]:
    """Joints as USD names them, by their paths."""
    found: list[str] = []
    for joint, parent in enumerate(clip.hierarchy.parents):
        name = f"j{joint}_" + "".join(c if c.isalnum() else "_" for c in clip.hierarchy.joints[joint])
        found.append(name if parent < 0 else f"{found[parent]}/{name}")
    return found


def matrix(turn: np.ndarray, place: np.ndarray) -> Any:
    """A matrix of USD, for row vectors, of a rotation and a place."""
    own = np.eye(4)
    own[:3, :3] = to_matrix(turn).T
    own[3, :3] = place
    return Gf.Matrix4d(own.tolist())


def write_skeleton(stage: Any, path: str, clip: SourceClip, motion: SolvedMotion, seed: int, step: float = 1.0) -> None:
    """A skeleton of a clip's joints, and an animation that has them in another order, bound from above."""
    hierarchy, joints = clip.hierarchy, paths_of(clip)
    root = UsdSkel.Root.Define(stage, path)
    skeleton = UsdSkel.Skeleton.Define(stage, f"{path}/Skel")
    still = solve(SourceClip(hierarchy, np.zeros((2, clip.channels.shape[1])), 30.0)).positions[0]
    above = [max(parent, 0) for parent in hierarchy.parents]
    bones = still - still[above]
    bones[0] = still[0]
    level = np.array([1.0, 0.0, 0.0, 0.0])
    skeleton.CreateJointsAttr(joints)
    skeleton.CreateRestTransformsAttr(Vt.Matrix4dArray([matrix(level, bone) for bone in bones]))
    skeleton.CreateBindTransformsAttr(Vt.Matrix4dArray([matrix(level, place) for place in still]))
    animation = UsdSkel.Animation.Define(stage, f"{path}/Anim")
    order = np.random.default_rng(seed).permutation(len(joints))
    animation.CreateJointsAttr([joints[joint] for joint in order])
    animation.CreateScalesAttr(Vt.Vec3hArray([Gf.Vec3h(1, 1, 1)] * len(joints)))
    turns, places = animation.CreateRotationsAttr(), animation.CreateTranslationsAttr()
    assert motion.world is not None
    for frame, (world, position) in enumerate(zip(motion.world, motion.positions, strict=True)):
        local = multiply(conjugate(world[above]), world)
        seen = rotate(conjugate(world[above]), position - position[above])
        local[0], seen[0] = world[0], position[0]
        quaternions = [Gf.Quatf(*map(float, local[joint])) for joint in order]
        turns.Set(Vt.QuatfArray(quaternions), frame * step)
        places.Set(Vt.Vec3fArray([Gf.Vec3f(*map(float, seen[joint])) for joint in order]), frame * step)
    UsdSkel.BindingAPI.Apply(root.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])


def real_clip(recordings: Path) -> tuple[SourceClip, SolvedMotion, float]:
    """90 frames of a walk of CMU, where its joints are, and its size."""
    whole = read_clips(recordings / "cmu_bvh" / "clips" / "02_01.bvh")[0]
    clip = SourceClip(whole.hierarchy, whole.channels[100:190], whole.fps)
    motion = solve(clip)
    return clip, motion, float(np.ptp(motion.positions[0], axis=0).max())


@pytest.mark.recordings
@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usd", ".usdz"])
def test_a_real_clip_is_where_forward_kinematics_puts_it(recordings: Path, tmp_path: Path, suffix: str) -> None:
    clip, motion, size = real_clip(recordings)
    path = tmp_path / f"walk{suffix}"
    inner = tmp_path / "walk.usdc" if suffix == ".usdz" else path
    stage = Usd.Stage.CreateNew(str(inner))
    stage.SetTimeCodesPerSecond(clip.fps)
    UsdGeom.SetStageUpAxis(stage, "Y")
    UsdGeom.SetStageMetersPerUnit(stage, 0.056444)
    placed = UsdGeom.Xform.Define(stage, "/World")
    placed.AddTranslateOp().Set(Gf.Vec3d(1, 2, 3))
    placed.AddRotateXYZOp().Set(Gf.Vec3f(0, 90, 0))
    placed.AddScaleOp().Set(Gf.Vec3f(2, 2, 2))
    write_skeleton(stage, "/World/Body", clip, motion, seed=3)
    stage.Save()
    if suffix == ".usdz":
        assert UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(inner)), str(path))
    [back] = read_clips(path)
    expected = 2 * motion.positions[..., [2, 1, 0]] * [1, 1, -1] + [1, 2, 3]
    assert (back.fps, back.up) == (clip.fps, "y")
    assert back.metres_per_unit == pytest.approx(0.056444)
    assert np.abs(solve(back).positions - expected).max() < 1e-3 * 2 * size
    assert sum("Xposition" in names for names in back.hierarchy.channels) == 1

    # And where USD itself puts them.
    stage = Usd.Stage.Open(str(path))
    query = UsdSkel.Cache().GetSkelQuery(UsdSkel.Skeleton(stage.GetPrimAtPath("/World/Body/Skel")))
    cache = UsdSkel.Cache()
    cache.Populate(UsdSkel.Root(stage.GetPrimAtPath("/World/Body")), Usd.PrimDefaultPredicate)
    query = cache.GetSkelQuery(UsdSkel.Skeleton(stage.GetPrimAtPath("/World/Body/Skel")))
    for frame in (0, 41, 89):
        worlds = query.ComputeJointWorldTransforms(UsdGeom.XformCache(frame))
        theirs = np.array([np.array(world)[3, :3] for world in worlds])
        assert np.abs(solve(back).positions[frame] - theirs).max() < 1e-3 * 2 * size


@pytest.mark.recordings
def test_every_instance_that_is_animated_is_a_clip(recordings: Path, tmp_path: Path) -> None:
    clip, motion, size = real_clip(recordings)
    path = tmp_path / "two.usdc"
    stage = Usd.Stage.CreateNew(str(path))
    stage.SetTimeCodesPerSecond(24.0)
    write_skeleton(stage, "/Proto", clip, motion, seed=4, step=24.0 / clip.fps)
    stage.GetPrimAtPath("/Proto").SetSpecifier(Sdf.SpecifierClass)
    for number, name in enumerate(("Anna", "Bert")):
        one = UsdGeom.Xform.Define(stage, f"/Crowd/{name}")
        one.GetPrim().GetReferences().AddInternalReference("/Proto")
        one.GetPrim().SetTypeName("SkelRoot")
        one.AddTranslateOp().Set(Gf.Vec3d(100 * number, 0, 0))
        one.GetPrim().SetInstanceable(True)
    stage.Save()
    anna, bert = read_clips(path)
    assert (anna.body, bert.body) == ("Crowd Anna Skel", "Crowd Bert Skel")
    assert (anna.fps, len(anna.channels)) == (clip.fps, 90)  # keys lie at fractions of time codes
    assert np.abs(solve(anna).positions - motion.positions).max() < 1e-3 * size
    apart = solve(bert).positions - solve(anna).positions
    np.testing.assert_allclose(apart, np.broadcast_to([100.0, 0.0, 0.0], apart.shape), atol=1e-3)


def test_joints_move_at_the_rate_of_the_stage_where_keys_are_few(tmp_path: Path) -> None:
    path = tmp_path / "few.usda"
    text = usda_text()
    for frame in range(1, 11):
        text = "\n".join(line for line in text.split("\n") if not line.startswith(f"{frame}: "))
    path.write_text(text.replace("timeCodesPerSecond = 30", "timeCodesPerSecond = 30\n    framesPerSecond = 60"))
    [clip] = read_clips(path)
    assert (clip.fps, len(clip.channels)) == (60.0, 23)
    assert any("keys are sparse: sampled 60 times" in note for note in clip.notes)
    np.testing.assert_allclose(solve(clip).positions[:, 0, 0], np.arange(23.0), atol=1e-4)


def test_a_part_of_the_file_that_is_referenced_with_a_delay_moves_later(tmp_path: Path) -> None:
    path = tmp_path / "twice.usda"
    path.write_text(usda_text(40))
    stage = Usd.Stage.Open(str(path))
    stage.DefinePrim("/Later", "SkelRoot").GetReferences().AddInternalReference("/Body", Sdf.LayerOffset(6))
    stage.SetStartTimeCode(6)
    stage.SetEndTimeCode(28)
    stage.Save()
    first, later = (solve(clip).positions[:, 0, 0] for clip in sorted(read_clips(path), key=lambda clip: clip.body))
    at = np.arange(6.0, 29.0)
    np.testing.assert_allclose(first, 2.0 * at, atol=1e-4)
    np.testing.assert_allclose(later, 2.0 * (at - 6), atol=1e-4)


OUTSIDE = {
    "reference": '( prepend references = @{}@ )',
    "payload": '( prepend payload = @{}@</Body> )',
    "list": '( prepend references = [</Body>, @{}@</Body>] )',
    "in a variant": '( variants = {{ string v = "a" }}\nprepend variantSets = "v" ) {{\nvariantSet "v" = {{ "a" '
    "( prepend references = @{}@ ) {{ }} }}\n}}\ndef \"Y\"",
    "below": '{{\ndef "Z" ( prepend payload = @{}@ ) {{\n}}\n}}\ndef "Y"',
    "value clips": '( clips = {{ dictionary default = {{ asset[] assetPaths = [@{}@]\nstring primPath = "/Body"\n'
    "}} }} )",
}  # fmt: skip


@pytest.mark.parametrize("how", [*OUTSIDE, "layer"])
@pytest.mark.parametrize("target", ["beside.usda", "../beside.usda", "{folder}/beside.usda", "http://127.0.0.1/x.usda"])
def test_other_files_are_never_opened(tmp_path: Path, how: str, target: str) -> None:
    (tmp_path / "in").mkdir()
    for folder in (tmp_path, tmp_path / "in"):
        (folder / "beside.usda").write_text(usda_text())
    name = target.replace("{folder}", str(tmp_path))
    path = tmp_path / "in" / "walk.usda"
    if how == "layer":
        path.write_text(usda_text().replace("(\n", f"(\n    subLayers = [@{name}@]\n", 1))
    else:
        path.write_text(usda_text() + f'\ndef "X" {OUTSIDE[how].format(name)}\n{{\n}}\n')
    with pytest.raises(ClipError, match=r"is made of other files|has value clips"):
        read_clips(path)


def test_a_package_may_be_made_of_its_own_files_only(tmp_path: Path) -> None:
    (tmp_path / "walk.usda").write_text(usda_text())
    for name, sound in (("walk.usda", True), ("../walk.usda", False), ("other.usda", False)):
        (tmp_path / "root.usda").write_text(f'#usda 1.0\ndef "Body" ( prepend references = @{name}@</Body> ) {{\n}}\n')
        package = Sdf.ZipFileWriter.CreateNew(str(tmp_path / "walk.usdz"))
        for file in ("root.usda", "walk.usda"):
            package.AddFile(str(tmp_path / file), file)
        package.Save()
        if sound:
            assert len(read_clips(tmp_path / "walk.usdz")[0].channels) == 12
        else:
            with pytest.raises(ClipError, match="is made of other files"):
                read_clips(tmp_path / "walk.usdz")


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("endTimeCode = 11", "endTimeCode = 99999999", r"has 80000000 frames; \[limits\] frames = 1000000"),
        ("endTimeCode = 11", "endTimeCode = inf", "times are no numbers"),
        ("timeCodesPerSecond = 30", "timeCodesPerSecond = 0", "0 time codes a second"),
        ("metersPerUnit = 0.01", "metersPerUnit = -1", "metersPerUnit is -1"),
        ("rel skel:animationSource", "rel skel:nothing", "has no skeleton that an animation moves"),
        ("SkelAnimation", "Scope", "has no skeleton that an animation moves"),
        ("0: [(1.0000000, 0, 0.0000000, 0)", "0: [(0, 0, 0, 0)", "a rotation of length zero at 0"),
        ("0: [(0, 0, 30), ", "0: [", "its translations at 0 are not one for each of its 2 joints"),
        ('["Hips", "Hips/Spine", "Hips/Spine/Head"]', '["Hips", "Hips", "Hips/Head"]', "two joints of one path"),
        ("(0, 0, 90, 1)", "(0, 0, 90", r"USD cannot read it: line \d+"),
    ],
)
def test_what_is_wrong_is_said(old: str, new: str, reason: str, tmp_path: Path) -> None:
    path = tmp_path / "walk.usda"
    assert old in usda_text()
    path.write_text(usda_text().replace(old, new))
    with pytest.raises(ClipError, match=reason):
        read_clips(path)


def test_references_within_a_file_that_multiply_without_end_are_stopped(tmp_path: Path) -> None:
    levels = [
        f'class "L{level}" {{\n'
        + "".join(f'def "c{n}" ( prepend references = </L{level + 1}> ) {{\n}}\n' for n in range(30))
        + "}\n"
        for level in range(12)
    ]
    path = tmp_path / "bomb.usda"
    path.write_text(usda_text() + "".join(levels) + 'class "L12" {\n}\ndef "X" ( prepend references = </L0> ) {\n}\n')
    started = time.monotonic()
    with pytest.raises(ClipError, match=r"memory|took more than 5 s|ended while it read"):
        read_clips(path, allowed=Limits(seconds=5, memory_megabytes=256))
    assert time.monotonic() - started < 60


def test_a_file_that_needs_the_library_says_which_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(ClipError, match=r"needs usd-core: pip install 'motionlake\[usd\]'"):
        usd_library._sent(usda_text().encode(), tmp_path)


# Reads each file of a folder in a fork of one process that has the library: as `serve` does, a hundred times a second.
READING = """
import os, pathlib, resource, signal, sys, tempfile
from motionlake.errors import ClipError
from motionlake.formats.limits_config import Limits, within
from motionlake.formats.parse import usd_library
import pxr.UsdSkel, pxr.UsdGeom, scipy.spatial.transform
os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
for path in sorted(pathlib.Path(sys.argv[1]).iterdir()):
    child = os.fork()
    if not child:
        signal.alarm(60)
        resource.setrlimit(resource.RLIMIT_AS, (3 << 30, 3 << 30))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        code = 2
        try:
            with within(Limits()), tempfile.TemporaryDirectory() as folder:
                sent = usd_library._sent(path.read_bytes(), pathlib.Path(folder))
                path.with_suffix(".sent").write_bytes(b"".join(sent))
                code = 0
        except ClipError as error:
            path.with_suffix(".reason").write_text(error.reason)
            code = 0
        except BaseException as error:
            path.with_suffix(".fault").write_text(repr(error))
        os._exit(code)
    print(path.stem, os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@pytest.mark.parametrize("suffix", [".usda", ".usdc"])
def test_200_damaged_files_are_read_or_rejected_with_a_reason(suffix: str, tmp_path: Path) -> None:
    (tmp_path / "good.usda").write_text(usda_text())
    assert Sdf.Layer.FindOrOpen(str(tmp_path / "good.usda")).Export(str(tmp_path / "good.usdc"))
    good = (tmp_path / f"good{suffix}").read_bytes()
    rng = np.random.default_rng(22)
    (tmp_path / "damaged").mkdir()
    for number in range(200):
        damaged = DAMAGES[number % len(DAMAGES)](good, rng)
        (tmp_path / "damaged" / f"{number:03d}{suffix}").write_bytes(damaged)
    folder = tmp_path / "damaged"
    ran = subprocess.run([sys.executable, "-c", READING, folder], capture_output=True, text=True, check=True)
    ended = dict(line.split() for line in ran.stdout.splitlines())
    assert len(ended) == 200
    faults = {path.stem: path.read_text() for path in folder.glob("*.fault")}
    assert not faults  # a fault of Python is one of this program
    crashed = {name: code for name, code in ended.items() if code not in ("0", "-6", "-11", "-7", "-8")}
    assert not crashed  # a signal is one of the library, for which the process of its own is there; -14 is a hang
    rejected = [path.read_text() for path in folder.glob("*.reason")]
    assert all(3 < len(text) < 300 and text.isprintable() for text in rejected)
    read = 0
    for path in folder.glob("*.sent"):
        try:
            for clip in SceneNodes.received(np.fromfile(path, np.uint8)).clips(None):
                check_clip(clip)
                assert np.isfinite(solve(clip).positions).all()
                read += 1
        except ClipError as error:
            rejected.append(error.reason)
    assert len(rejected) > 60
    assert read  # few of .usdc: most of its bytes lie in compressed blocks
