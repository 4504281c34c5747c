"""Binary USD layers that are read without the library: as it reads them, or not at all."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.errors import ClipError
from motionlake.formats import read_clips
from motionlake.formats.limits_config import Limits, within
from motionlake.formats.parse import usd_nodes
from motionlake.formats.parse.scene_nodes import SceneNodes
from motionlake.formats.parse.usd_library import sent_by_library
from motionlake.formats.parse.usd_packed import Bytes, NotPlainError, unpacked
from motionlake.formats.parse.usd_plain import plain_nodes
from motionlake.formats.parse.usd_values import Values
from motionlake.motion.kinematics import solve

from tests.damage import DAMAGES
from tests.samples import lacking

if reason := lacking(".usda"):
    pytest.skip(reason, allow_module_level=True)
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

JOINTS = ("Hips", "Hips/Spine", "Hips/Spine/Head", "Hips/Leg")
FRAMES = 9


def matrices(seed: int) -> Any:
    """Rest or bind transforms, turned and moved."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in JOINTS:
        turn = Gf.Rotation(Gf.Vec3d(*rng.normal(size=3)), float(rng.uniform(0, 180)))
        found.append(Gf.Matrix4d(turn, Gf.Vec3d(*rng.normal(size=3))))
    return Vt.Matrix4dArray(found)


def walk(path: Path, *, seed: int = 0, first: float = 0.0, still: bool = False) -> Any:
    """A layer with two bodies of one animation each, that move at every time code from the first on."""
    rng = np.random.default_rng(seed)
    stage = Usd.Stage.CreateNew(str(path))
    stage.SetTimeCodesPerSecond(30)
    for name in ("Anna", "Bert"):
        UsdSkel.Root.Define(stage, f"/World/{name}")
        skeleton = UsdSkel.Skeleton.Define(stage, f"/World/{name}/Skel")
        skeleton.CreateJointsAttr(JOINTS)
        skeleton.CreateRestTransformsAttr(matrices(seed))
        skeleton.CreateBindTransformsAttr(matrices(seed + 1))
        animation = UsdSkel.Animation.Define(stage, f"/World/{name}/Anim")
        order = rng.permutation(len(JOINTS))
        animation.CreateJointsAttr([JOINTS[joint] for joint in order])
        turns, moves, sizes = (
            animation.CreateRotationsAttr(), animation.CreateTranslationsAttr(), animation.CreateScalesAttr(),
        )  # fmt: skip
        for frame in range(FRAMES):
            numbers = rng.normal(size=(len(JOINTS), 4)).tolist()
            turns.Set(Vt.QuatfArray([Gf.Quatf(*each) for each in numbers]), first + frame)
            places = Vt.Vec3fArray.FromNumpy((rng.normal(size=(len(JOINTS), 3)) * 10).astype(np.float32))
            if not still:
                moves.Set(places, first + frame)
        if still:
            moves.Set(places)
        else:
            sizes.Set(Vt.Vec3hArray([Gf.Vec3h(1, 1, 1)] * len(JOINTS)))
        UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    return stage


def same(some: SceneNodes, others: SceneNodes) -> None:
    """Two readings say the same to the last digit, but for what turns of prims lose in rounding."""
    for name, value in vars(some.head).items():
        assert np.array(value, object).tolist() == np.array(getattr(others.head, name), object).tolist(), name
    np.testing.assert_array_equal(some.bound, others.bound)
    for ours, theirs in zip((some.rest, *some.moved), (others.rest, *others.moved), strict=True):
        for name, part in vars(ours).items():
            np.testing.assert_allclose(part, getattr(theirs, name), rtol=0, atol=1e-13)


def by_library(data: bytes) -> SceneNodes:
    return SceneNodes.received(sent_by_library(data))


def place(kind: str) -> Any:
    """How the prim above both bodies is placed."""

    def placed(stage: Any) -> None:
        world = UsdGeom.Xform.Define(stage, "/World")
        if kind == "matrix":
            turn = Gf.Rotation(Gf.Vec3d(1, 2, 3), 40.0)
            world.AddTransformOp().Set(Gf.Matrix4d(turn, Gf.Vec3d(5, 6, 7)))
            return
        world.AddTranslateOp().Set(Gf.Vec3d(1, 2, 3) if kind == "whole numbers" else Gf.Vec3d(0.1, 2.5, -3.25))
        if kind == "orient":
            world.AddOrientOp().Set(Gf.Quatf(0.5, 0.5, -0.5, 0.5))
        elif kind == "whole numbers":
            world.AddRotateYOp().Set(90)
        else:
            getattr(world, f"AddRotate{kind}Op")().Set(Gf.Vec3f(10.5, 20.25, -30) if len(kind) == 3 else 33.3)
        world.AddScaleOp().Set(Gf.Vec3f(2, 2, 2) if kind == "whole numbers" else Gf.Vec3f(1.5, 1.5, 1.5))

    return placed


def say(stage: Any) -> None:
    UsdGeom.SetStageUpAxis(stage, "Z")
    UsdGeom.SetStageMetersPerUnit(stage, 0.0123)
    stage.SetFramesPerSecond(25)
    stage.SetStartTimeCode(2)
    stage.SetEndTimeCode(6)


def leave_out(stage: Any) -> None:
    """One body's animation has half of the joints, the other skeleton has no animation."""
    animation = UsdSkel.Animation(stage.GetPrimAtPath("/World/Anna/Anim"))
    animation.GetJointsAttr().Set(["Hips/Leg", "Hips"])
    for attribute in (animation.GetRotationsAttr(), animation.GetTranslationsAttr(), animation.GetScalesAttr()):
        for code in attribute.GetTimeSamples():
            attribute.Set(attribute.Get(code)[:2], code)
        if not attribute.GetTimeSamples():
            attribute.Set(attribute.Get()[:2])
    stage.GetPrimAtPath("/World/Bert/Skel").RemoveProperty("skel:animationSource")


PLAIN: dict[str, Callable[[Any], object]] = {
    "as written": lambda stage: None,
    "said of the stage": say,
    "joints left out": leave_out,
    "no rest": lambda stage: stage.GetPrimAtPath("/World/Anna/Skel").RemoveProperty("restTransforms"),
    "a body that is no more": lambda stage: stage.GetPrimAtPath("/World/Anna").SetSpecifier(Sdf.SpecifierOver),
    "within a scope": lambda stage: stage.GetPrimAtPath("/World").SetTypeName("Scope"),
    **{f"placed by {kind}": place(kind) for kind in ("X", "XYZ", "YZX", "ZYX", "orient", "matrix", "whole numbers")},
}


@pytest.mark.parametrize("how", PLAIN)
def test_a_layer_by_itself_is_as_the_library_reads_it(how: str, tmp_path: Path) -> None:
    path = tmp_path / "walk.usdc"
    stage = walk(path, seed=len(how))
    PLAIN[how](stage)
    stage.Save()
    same(plain_nodes(path.read_bytes()), by_library(path.read_bytes()))


@given(st.integers(0, 2**31), st.sampled_from([0.0, 1.0, -3.5]), st.booleans())
@settings(max_examples=20, deadline=None)
def test_any_numbers_are_as_the_library_reads_them(
    tmp_path_factory: pytest.TempPathFactory, seed: int, first: float, still: bool
) -> None:
    path = tmp_path_factory.mktemp("any") / "walk.usdc"
    walk(path, seed=seed, first=first, still=still).Save()
    same(plain_nodes(path.read_bytes()), by_library(path.read_bytes()))


def say_otherwise(stage: Any) -> None:
    """An animation holds numbers of another kind than it should."""
    layer, path = stage.GetRootLayer(), Sdf.Path("/World/Bert/Anim.translations")
    animation = layer.GetPrimAtPath(path.GetPrimPath())
    animation.RemoveProperty(layer.GetAttributeAtPath(path))
    Sdf.AttributeSpec(animation, path.name, Sdf.ValueTypeNames.Double3Array)
    for frame in range(FRAMES):
        layer.SetTimeSample(path, frame, Vt.Vec3dArray([Gf.Vec3d(frame, 0, 0)] * len(JOINTS)))


def move_above(stage: Any) -> None:
    op = UsdGeom.Xform.Define(stage, "/World").AddTranslateOp()
    op.Set(Gf.Vec3d(0, 0, 0), 0)
    op.Set(Gf.Vec3d(8, 0, 0), 8)


def vary(stage: Any) -> None:
    variants = stage.GetPrimAtPath("/World").GetVariantSets().AddVariantSet("v")
    variants.AddVariant("a")
    variants.SetVariantSelection("a")


COMPOSED: dict[str, Callable[[Any], object]] = {
    "reference": lambda stage: stage.DefinePrim("/Later").GetReferences().AddInternalReference("/World"),
    "class": lambda stage: stage.GetPrimAtPath("/World").GetInherits().AddInherit("/World/Bert"),
    "specialised": lambda stage: stage.GetPrimAtPath("/World").GetSpecializes().AddSpecialize("/World/Bert"),
    "not active": lambda stage: stage.GetPrimAtPath("/World/Anna").SetActive(False),
    "variants": vary,
    "a key left out": lambda stage: stage.GetPrimAtPath("/World/Bert/Anim").GetAttribute("translations").ClearAtTime(3),
    "other numbers": say_otherwise,
    "moved from above": move_above,
    "two animations": lambda stage: (
        stage.GetPrimAtPath("/World/Bert/Skel").GetRelationship("skel:animationSource").AddTarget("/World/Anna/Anim")
    ),
    "blocked": lambda stage: stage.GetPrimAtPath("/World/Bert/Skel").GetAttribute("restTransforms").Block(),
}


@pytest.mark.parametrize("how", COMPOSED)
def test_a_composed_layer_is_for_the_library(how: str, tmp_path: Path) -> None:
    path = tmp_path / "walk.usdc"
    stage = walk(path)
    COMPOSED[how](stage)
    stage.Save()
    with pytest.raises(NotPlainError):
        plain_nodes(path.read_bytes())
    same(usd_nodes.read_nodes(path.read_bytes()), by_library(path.read_bytes()))


def test_a_plain_layer_needs_no_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "walk.usdc"
    walk(path).Save()

    def fail(data: bytes) -> None:
        raise AssertionError("was asked")

    monkeypatch.setattr(usd_nodes, "sent_by_library", fail)
    assert [clip.body for clip in read_clips(path)] == ["World Anna Skel", "World Bert Skel"]


def test_prims_that_are_named_twice_are_not_gone_through_without_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "walk.usdc"
    walk(path).Save()
    words = Values.words
    monkeypatch.setattr(Values, "words", lambda values, value: 2 * words(values, value))
    with pytest.raises(NotPlainError, match="twice"):
        plain_nodes(path.read_bytes())


def test_paths_that_are_as_deep_as_there_are_prims_are_held_back(tmp_path: Path) -> None:
    stage = walk(tmp_path / "deep.usdc")
    stage.DefinePrim("/" + "/".join(f"a_prim_with_a_long_name_{n}" for n in range(1500)))
    stage.Save()
    with pytest.raises(NotPlainError, match="too long"):
        plain_nodes((tmp_path / "deep.usdc").read_bytes())


def test_a_body_that_rests_as_it_was_bound_is_as_one_that_nearly_does(tmp_path: Path) -> None:
    """The shorter way where both poses are the same, and joints do not turn at rest, beside the longer one."""
    found = []
    for number, off in enumerate((0.0, 1e-7)):
        path = tmp_path / f"{number}.usdc"
        stage = walk(path)
        for name in ("Anna", "Bert"):
            skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath(f"/World/{name}/Skel"))
            rest = np.tile(np.eye(4), (len(JOINTS), 1, 1))
            if name == "Anna":
                rest = np.array(matrices(3))
            rest[:, 3, :3] += np.arange(3 * len(JOINTS)).reshape(-1, 3) + off
            rest[:, 0, 1] += off
            bind = rest.copy()  # row vectors: a joint's own before its parent's
            for joint, parent in ((1, 0), (2, 1), (3, 0)):
                bind[joint] = rest[joint] @ bind[parent]
            bind[:, 3, :3] += off
            skeleton.GetRestTransformsAttr().Set(Vt.Matrix4dArray([Gf.Matrix4d(each.tolist()) for each in rest]))
            skeleton.GetBindTransformsAttr().Set(Vt.Matrix4dArray([Gf.Matrix4d(each.tolist()) for each in bind]))
        stage.Save()
        found.append(read_clips(path))
    for exact, near in zip(*found, strict=True):
        np.testing.assert_allclose(exact.hierarchy.offsets, near.hierarchy.offsets, atol=1e-5)
        np.testing.assert_allclose(solve(exact).positions, solve(near).positions, atol=1e-4)


def test_a_body_that_was_bound_in_another_pose_rests_in_that(tmp_path: Path) -> None:
    path = tmp_path / "walk.usdc"
    walk(path, seed=5).Save()
    bound = np.array(matrices(6))[:, 3, :3]
    for clip in read_clips(path):
        bones = bound - bound[[max(parent, 0) for parent in clip.hierarchy.parents]]
        np.testing.assert_allclose(clip.hierarchy.offsets[1:], bones[1:], atol=1e-9)


def test_long_lists_of_names_are_held_against_the_limits(tmp_path: Path) -> None:
    path = tmp_path / "walk.usdc"
    stage = walk(path)
    stage.GetPrimAtPath("/World/Anna/Skel").GetAttribute("joints").Set(["Hips"] * 40_000)
    stage.Save()
    with within(Limits(memory_megabytes=1)), pytest.raises(ClipError, match="memory"):
        plain_nodes(path.read_bytes())


def test_what_is_wrong_is_said_as_the_library_says_it(tmp_path: Path) -> None:
    path = tmp_path / "walk.usdc"
    stage = walk(path)
    stage.SetTimeCodesPerSecond(0)
    stage.Save()
    for read in (plain_nodes, by_library):
        with pytest.raises(ClipError, match="0 time codes a second"):
            read(path.read_bytes())
    stage.SetTimeCodesPerSecond(30)
    stage.Save()
    asked = {Limits(joints=3): "4 joints", Limits(frames=8): "9 frames", Limits(bodies=1): "2 skeletons"}
    for read in (plain_nodes, by_library):
        for allowed, reason in asked.items():
            with within(allowed), pytest.raises(ClipError, match=reason):
                read(path.read_bytes())


@pytest.mark.parametrize("seed", range(4))
def test_damaged_layers_are_read_as_the_library_reads_them_or_left_to_it(seed: int, tmp_path: Path) -> None:
    path = tmp_path / "walk.usdc"
    walk(path, seed=seed).Save()
    good, rng = path.read_bytes(), np.random.default_rng(seed)
    read = left = 0
    for number in range(250):
        damaged = DAMAGES[number % len(DAMAGES)](good, rng)
        if number % 2:  # few bytes, in every other one of the numbers
            at = int(rng.integers(0, len(good) // (2 if number % 4 == 1 else 1)))
            other = rng.integers(0, 256, int(rng.integers(1, 9)), np.uint8).tobytes()
            damaged = good[:at] + other + good[at + len(other) :]
        try:
            found = plain_nodes(damaged)
        except (NotPlainError, ClipError):
            left += 1
            continue
        read += 1
        try:
            theirs = by_library(damaged)
        except ClipError:
            continue
        same(found, theirs)
    assert left > 100
    assert read > 5


def packed(numbers: list[int], usual: int) -> bytes:
    """Integers as USD packs them: the usual difference, codes, and differences of as few bytes as hold them."""
    codes, rest = [], b""
    for number, before in zip(numbers, [0, *numbers], strict=False):
        difference = (number - before + 2**31) % 2**32 - 2**31
        width = next(w for w in (1, 2, 4) if -(1 << 8 * w - 1) <= difference < 1 << 8 * w - 1)
        codes.append(0 if difference == usual else {1: 1, 2: 2, 4: 3}[width])
        rest += b"" if difference == usual else difference.to_bytes(width, "little", signed=True)
    codes += [0] * (-len(codes) % 4)
    bits = bytes(
        sum(code << 2 * place for place, code in enumerate(codes[at : at + 4])) for at in range(0, len(codes), 4)
    )
    return usual.to_bytes(4, "little", signed=True) + bits + rest


def block(data: bytes) -> bytes:
    return b"\0" + bytes(pa.compress(data, codec="lz4_raw", asbytes=True))


@given(st.lists(st.integers(-(2**31), 2**31 - 1) | st.integers(-200, 200), min_size=1), st.integers(-3, 300))
@settings(deadline=None)
def test_packed_integers(numbers: list[int], usual: int) -> None:
    inner = block(packed(numbers, usual))
    part = Bytes(memoryview(len(inner).to_bytes(8, "little") + inner + b"after"))
    assert part.integers(len(numbers)) == numbers
    assert bytes(part.take(5)) == b"after"


def test_a_block_that_holds_less_than_it_promises_is_damage() -> None:
    data = block(b"words" * 20)
    assert unpacked(memoryview(data), 100) == b"words" * 20
    for size in (99, 101, 10**12):
        with pytest.raises(NotPlainError):
            unpacked(memoryview(data), size)
    inner = block(packed([5, 700, -9], 1)[:-1])
    with pytest.raises(NotPlainError):
        Bytes(memoryview(len(inner).to_bytes(8, "little") + inner)).integers(3)
