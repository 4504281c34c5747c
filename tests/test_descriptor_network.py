"""Descriptor networks: what enters, what is minimised, how they train (DeepHuMS, sections 3.2 and 3.3.2)."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import BoolArray, Float32Array, Float64Array
from motionlake.deephums.batches import NO_AUGMENTATION, Augmentation, at_speeds, resampled, windows
from motionlake.deephums.config import DIMENSION, DescriptorsConfig
from motionlake.deephums.encoders import MissingJoints
from motionlake.deephums.network import load_descriptor
from motionlake.deephums.recipes import PRETRAINED, THESIS, WITHOUT, DescriptorRecipe, read_recipe, recipe_of
from motionlake.deephums.sequence import (
    BONES,
    MIN_HORIZONTAL,
    ROOTS,
    SIDES,
    clip_sequence,
    frames_of,
    motion_distance,
    motion_field,
    similar_by_motion,
)
from motionlake.deephums.training import TrainingClip, class_contrast, contrastive_loss, train_descriptor
from motionlake.motion.resampling import interpolated
from motionlake.motion.skeleton import COMMON, INDEX, JOINTS
from scipy.signal import savgol_filter

TINY = replace(recipe_of(DescriptorsConfig()), hidden=16, epochs=6, batch=8)


SIDE = {"clavicle": (0.05, 1.4), "shoulder": (0.2, 1.4), "elbow": (0.3, 1.15), "wrist": (0.35, 0.9)}
SIDE |= {"hip": (0.1, 0.95), "knee": (0.1, 0.5), "ankle": (0.1, 0.08), "toe": (0.1, 0.02)}
TRUNK = {"hips": 1.0, "spine": 1.1, "chest": 1.25, "neck": 1.45, "head": 1.65}


def standing() -> Float64Array:
    """[21, 3] a body that stands, facing +z."""
    places = []
    for name in JOINTS:
        side, _, part = name.partition("_")
        x, y = SIDE[part] if part else (0.0, TRUNK[name])
        places.append((-x if side == "right" else x, y, 0.15 if part == "toe" else 0.0))
    return np.array(places)


def swinging(frames: int, speed: float, joint: str = "left_wrist", size: float = 0.3) -> Float64Array:
    """[frames, 21, 3] a body in its rest pose that swings one joint up and down and drifts forward."""
    time = np.linspace(0, 1, frames)
    moved = np.repeat(standing()[None], frames, axis=0)
    moved[:, INDEX[joint], 1] += size * np.sin(2 * np.pi * speed * time)
    moved[:, :, 2] += 0.2 * time[:, None]
    return moved


def toy_clips(seed: int = 0) -> list[TrainingClip]:
    """Sixteen clips: four joints that swing, four times each, at different speeds and sizes."""
    rng = np.random.default_rng(seed)
    joints = ("left_wrist", "right_wrist", "left_ankle", "head")
    return [
        TrainingClip(clip_sequence(swinging(int(rng.integers(30, 60)), 2, joint, rng.uniform(0.2, 0.4)), 30.0), joint)
        for joint in joints
        for _ in range(4)
    ]


class TestSequence:
    def test_place_facing_and_size_do_not_count(self) -> None:
        clip = swinging(40, 2.0)
        turn = np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]])
        other = (clip @ turn) * 1.3 + [5.0, 0.2, -3.0]
        np.testing.assert_allclose(clip_sequence(clip, 30.0), clip_sequence(other, 30.0), atol=1e-5)

    def test_rates_agree_on_time(self) -> None:
        assert len(clip_sequence(swinging(241, 2.0), 120.0)) == len(clip_sequence(swinging(61, 2.0), 30.0)) == 61

    @pytest.mark.parametrize("joint", COMMON)
    def test_a_missing_joint_is_zero_and_not_looked_at(self, joint: str) -> None:
        clip = swinging(40, 2.0)
        missing = np.zeros(21, dtype=bool)
        missing[INDEX[joint]] = True
        broken = clip.copy()
        broken[:, INDEX[joint]] = np.nan
        found = clip_sequence(broken, 30.0, missing)
        assert np.isfinite(found).all()
        assert not found[:, COMMON.index(joint)].any()
        others = [i for i, name in enumerate(COMMON) if name not in (joint, "hips")]
        if joint not in ("hips",):
            np.testing.assert_allclose(found[:, others], clip_sequence(clip, 30.0)[:, others], atol=0.05)

    def test_what_cannot_be_described_is_refused(self) -> None:
        with pytest.raises(ValueError, match="without frames"):
            clip_sequence(np.zeros((0, 21, 3)), 30.0)
        with pytest.raises(ValueError, match="without frames or without joints"):
            clip_sequence(swinging(5, 1.0), 30.0, np.ones(21, dtype=bool))
        with pytest.raises(ValueError, match="finite"):
            clip_sequence(np.full((5, 21, 3), np.nan), 30.0)


def naive_sequence(positions: Float64Array, fps: float, missing: BoolArray) -> Float64Array:
    """`clip_sequence` a step at a time, by scipy's filter."""
    there = ~missing[[INDEX[name] for name in COMMON]]
    joints = positions[:, [INDEX[name] for name in COMMON]]
    joints = interpolated(joints, np.linspace(0, len(joints) - 1, frames_of(len(joints), fps)))
    joints[:, ~there] = 0
    if len(joints) >= 7:
        joints = savgol_filter(joints, 7, 3, axis=0)
    seen = {name: joints[:, at] for at, name in enumerate(COMMON) if there[at]}
    names = next((some for some in ROOTS if all(name in seen for name in some)), tuple(seen))
    root = np.mean([seen[name] for name in names], axis=0)
    pairs = [(f"left_{side}", f"right_{side}") for side in SIDES]
    across = [seen[left] - seen[right] for left, right in pairs if left in seen and right in seen][:2]
    yaw = 0.0
    if across:
        mean = np.mean([side / np.linalg.norm(side, axis=-1, keepdims=True) for side in across], axis=0)
        clear = mean[np.hypot(mean[:, 0], mean[:, 2]) > MIN_HORIZONTAL]
        yaw = float(np.median(np.unwrap(np.arctan2(-clear[:, 2], clear[:, 0])))) if len(clear) else 0.0
    bones = [(a, b) for a, b in BONES if a in seen and b in seen]
    lengths = sum(float(np.median(np.linalg.norm(seen[a] - seen[b], axis=1))) for a, b in bones)
    size = lengths / sum(BONES[bone] for bone in bones) if bones else 1.0
    turn = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    found = (joints - root[:, None]) @ turn
    found[:, 0] = (root - root[0]) @ turn
    found[:, ~there] = 0
    return np.asarray(found / size)


@given(seed=st.integers(0, 10_000), frames=st.integers(1, 90), fps=st.sampled_from([24.0, 30.0, 59.94, 120.0]),
       gone=st.sets(st.sampled_from(COMMON), max_size=9))  # fmt: skip
def test_the_kernel_is_the_filter_and_the_view_a_step_at_a_time(
    seed: int, frames: int, fps: float, gone: set[str]
) -> None:
    rng = np.random.default_rng(seed)
    positions = rng.normal(0, 0.5, (1, 21, 3)) + rng.normal(0, 0.05, (frames, 21, 3)).cumsum(axis=0)
    missing = np.array([joint in gone for joint in JOINTS])
    wanted = naive_sequence(positions, fps, missing)
    np.testing.assert_allclose(clip_sequence(positions, fps, missing), wanted, atol=1e-4 * max(1, abs(wanted).max()))


class TestSimilarity:
    def test_motion_field_and_distance_follow_the_equations(self) -> None:
        clip = np.random.default_rng(0).standard_normal((7, 15, 3)).astype(np.float32)
        field = [clip[-1][j] - clip[0][j] for j in range(15)]
        distance: list[Any] = [sum(np.linalg.norm(clip[i + 1][j] - clip[i][j]) for i in range(6)) for j in range(15)]
        np.testing.assert_allclose(motion_field(clip), field, rtol=1e-6)
        np.testing.assert_allclose(motion_distance(clip), distance, rtol=1e-5)

    def test_speed_changes_neither(self) -> None:
        clip = clip_sequence(swinging(61, 2.0), 30.0)
        for other in at_speeds(clip):
            np.testing.assert_allclose(motion_field(other), motion_field(clip), atol=1e-5)
            np.testing.assert_allclose(motion_distance(other), motion_distance(clip), rtol=0.05, atol=0.02)

    def test_pairs_are_similar_where_both_agree(self) -> None:
        clips = [clip.sequence for clip in toy_clips()]
        similar = similar_by_motion(clips, 0.3)
        same = np.equal.outer(np.arange(16) // 4, np.arange(16) // 4)
        assert similar.diagonal().all()
        assert (similar == similar.T).all()
        assert similar[same].mean() > 2 * similar[~same].mean()


class TestLosses:
    def test_similar_pairs_attract_and_dissimilar_ones_repel_up_to_the_margin(self) -> None:
        """What equation 3.1 says in words, not as it is printed."""
        for similar, apart, slope in ((True, 0.5, 1), (False, 0.5, -1), (False, 1.5, 0)):
            descriptors = torch.tensor([[0.0, 0.0], [apart, 0.0]], requires_grad=True)
            loss = contrastive_loss(descriptors, torch.tensor([[True, similar], [similar, True]]), margin=1.0)
            loss.backward()  # type: ignore[no-untyped-call]
            assert descriptors.grad is not None
            assert np.sign(float(descriptors.grad[1, 0])) == slope

    @settings(max_examples=25, deadline=None)
    @given(st.integers(2, 7), st.integers(0, 10**6))
    def test_against_loops(self, count: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        rows, labels = rng.standard_normal((count, 3)), rng.integers(0, 3, count)
        similar: list[float] = []
        apart: list[float] = []
        for i in range(count):
            for j in range(i + 1, count):
                d = float(np.linalg.norm(rows[i] - rows[j]))
                (similar if labels[i] == labels[j] else apart).append(
                    d**2 if labels[i] == labels[j] else max(0.0, 1.5 - d) ** 2
                )
        expected = sum(np.mean(part) for part in (similar, apart) if part) / 2
        found = contrastive_loss(torch.from_numpy(rows), torch.from_numpy(labels[:, None] == labels[None]), 1.5)
        assert float(found) == pytest.approx(expected, rel=1e-5, abs=1e-9)
        unit = rows / np.linalg.norm(rows, axis=1, keepdims=True)
        total = 0.0
        for i in range(count):
            others = [j for j in range(count) if j != i]
            logs = unit[i] @ unit[others].T / 0.2
            logs = logs - np.log(np.exp(logs).sum())
            wanted = [log for j, log in zip(others, logs, strict=True) if labels[j] == labels[i]]
            total -= float(np.mean(wanted)) if wanted else 0.0
        contrast = class_contrast(torch.from_numpy(rows), torch.from_numpy(labels), 0.2)
        assert float(contrast) == pytest.approx(total / count, rel=1e-4, abs=1e-6)


class TestAugmentation:
    clips = torch.from_numpy(np.stack([resampled(clip.sequence, 32) for clip in toy_clips()]))

    def test_nothing_asked_changes_nothing(self) -> None:
        assert torch.allclose(NO_AUGMENTATION(self.clips, np.random.default_rng(0)), self.clips, atol=1e-6)

    def test_missing_joints_are_gone_in_all_frames(self) -> None:
        varied = replace(NO_AUGMENTATION, missing=0.3)(self.clips + 1, np.random.default_rng(0))
        gone = (varied == 0).all(dim=3)[:, :, 1:]  # the root's path starts at zero
        assert gone.any()
        assert (gone.any(dim=1) == gone.all(dim=1)).all()

    def test_mirrored_twice_is_the_same(self) -> None:
        mirror = replace(NO_AUGMENTATION, mirror=1.0)
        once = mirror(self.clips, np.random.default_rng(0))
        assert torch.allclose(mirror(once, np.random.default_rng(1)), self.clips, atol=1e-6)
        left, right = COMMON.index("left_wrist"), COMMON.index("right_wrist")
        assert torch.allclose(once[:, :, left, 0], -self.clips[:, :, right, 0], atol=1e-6)

    def test_limbs_come_whole_from_the_partner(self) -> None:
        mixed = replace(NO_AUGMENTATION, limbs=1.0)(self.clips, np.random.default_rng(0), self.clips + 9)
        shift: Any = (mixed - self.clips).mean(dim=(1, 3))
        arm = [COMMON.index(f"left_{joint}") for joint in ("shoulder", "elbow", "wrist")]
        assert set(shift[:, arm].round().unique().tolist()) == {0.0, 9.0}
        assert torch.allclose(shift[:, arm].std(dim=1), torch.zeros(len(shift)), atol=1e-4)
        assert (shift[:, COMMON.index("neck")].abs() < 1e-4).all()

    def test_crop_and_warp_keep_the_order_of_time(self) -> None:
        ramp = torch.arange(32.0)[None, :, None, None].repeat(40, 1, 15, 3)
        varied = replace(NO_AUGMENTATION, crop=0.2, warp=0.6)(ramp, np.random.default_rng(0))[:, :, 1]
        assert (varied[:, 1:] >= varied[:, :-1]).all()
        assert varied[:, 0].max() > 1


class TestMissingJoints:
    def fitted(self, clips: torch.Tensor) -> MissingJoints:
        fill = MissingJoints()
        fill.learn(clips.flatten(0, 1))
        return fill

    def test_a_joint_that_follows_from_others_comes_back(self) -> None:
        clips = torch.from_numpy(np.random.default_rng(0).standard_normal((4, 50, 15, 3)).astype(np.float32))
        clips[:, :, 5] = 0.6 * clips[:, :, 4] + 0.4 * clips[:, :, 3] + 1.0
        broken = clips.clone()
        broken[1, :, 5] = 0
        filled = self.fitted(clips)(broken)
        assert torch.allclose(filled[1, :, 5], clips[1, :, 5], atol=0.05)
        assert torch.equal(filled[[0, 2, 3]], clips[[0, 2, 3]])
        assert torch.equal(filled[1, :, :5], clips[1, :, :5])

    def test_against_the_mean_of_a_gaussian(self) -> None:
        clips = torch.from_numpy(np.stack([resampled(clip.sequence, 32) for clip in toy_clips()]))
        fill = self.fitted(clips)
        broken = clips.clone()
        broken[0, :, [4, 11]] = 0
        gone = np.repeat(np.isin(np.arange(1, 15), [4, 11]), 3)
        mean, covariance = fill.mean.numpy().astype(float), fill.covariance.numpy().astype(float)
        seen = clips[0, :, 1:].flatten(1).numpy()[:, ~gone] - mean[~gone]
        slope = covariance[np.ix_(gone, ~gone)] @ np.linalg.inv(covariance[np.ix_(~gone, ~gone)])
        expected = mean[gone] + seen @ slope.T
        np.testing.assert_allclose(fill(broken)[0, :, 1:].flatten(1).numpy()[:, gone], expected, atol=2e-3)

    def test_nothing_seen_is_left_alone(self) -> None:
        clips = torch.zeros((2, 10, 15, 3))
        assert torch.equal(self.fitted(clips + 1)(clips), clips)


def spread(descriptors: Float32Array) -> tuple[float, float]:
    """Mean cosine within the four toy classes, and between them."""
    cosines = descriptors @ descriptors.T
    same = np.equal.outer(np.arange(16) // 4, np.arange(16) // 4)
    return float(cosines[same].mean()), float(cosines[~same].mean())


class TestTraining:
    @pytest.mark.parametrize("supervision", ["labels", "none"])
    @pytest.mark.parametrize("recipe", ["default", "deephums"])
    def test_classes_draw_together(self, recipe: str, supervision: str) -> None:
        named = recipe_of(DescriptorsConfig(recipe=recipe), labels=supervision == "labels")
        chosen = replace(named, hidden=24, epochs=min(40, named.epochs), batch=8, neighbours=3)
        clips = toy_clips()
        model = train_descriptor(clips, DescriptorsConfig(supervision=supervision, recipe=recipe), recipe=chosen)
        descriptors = model.embed([clip.sequence for clip in clips])
        assert descriptors.shape == (16, DIMENSION)
        np.testing.assert_allclose(np.linalg.norm(descriptors, axis=1), 1, rtol=1e-5)
        within, between = spread(descriptors)
        assert 1 - between > 3 * (1 - within)
        if chosen.epochs:
            assert model.metrics["loss"][-1] < model.metrics["loss"][0]
        assert model.metrics["classes"] == (4 if supervision == "labels" else None)

    def test_interrupted_training_ends_as_if_it_was_not(self, tmp_path: Path) -> None:
        clips, config = toy_clips(), DescriptorsConfig(seed=3)

        def stop(epoch: int, epochs: int, loss: float) -> None:
            if epoch == 5:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            train_descriptor(clips, config, recipe=TINY, checkpoint=tmp_path / "c", progress=stop)
        resumed = train_descriptor(clips, config, recipe=TINY, checkpoint=tmp_path / "c")
        whole = train_descriptor(clips, config, recipe=TINY)
        assert not (tmp_path / "c").exists()
        sequences = [clip.sequence for clip in clips]
        np.testing.assert_array_equal(resumed.embed(sequences), whole.embed(sequences))
        assert resumed.metrics == whole.metrics

    def test_kept_and_read_it_is_the_same(self, tmp_path: Path) -> None:
        clips = toy_clips()
        model = train_descriptor(clips, DescriptorsConfig(), recipe=TINY, validation=clips[:3])
        model.save(tmp_path / "model.safetensors")
        read = load_descriptor(tmp_path / "model.safetensors")
        sequences = [clip.sequence for clip in clips]
        np.testing.assert_array_equal(read.embed(sequences), model.embed(sequences))
        assert (read.config, read.recipe, read.classes) == (model.config, model.recipe, model.classes)
        assert model.metrics["validation"][-1][0] == 6

    def test_descriptors_do_not_depend_on_their_neighbours(self) -> None:
        clips = [clip.sequence for clip in toy_clips()]
        model = train_descriptor(toy_clips(), DescriptorsConfig(), recipe=TINY)
        np.testing.assert_array_equal(model.embed(clips)[3], model.embed([clips[3]])[0])

    @pytest.mark.parametrize("frames", [1, 2, 15, 600, 601, 2000])
    @pytest.mark.parametrize(
        "recipe", [recipe_of(DescriptorsConfig()), WITHOUT, THESIS, PRETRAINED], ids=lambda r: "-".join(r.encoders)
    )
    def test_clips_of_any_length(self, frames: int, recipe: DescriptorRecipe) -> None:
        recipe = replace(recipe, hidden=8, epochs=min(1, recipe.epochs))
        by = "none" if recipe == WITHOUT else "auto"
        model = train_descriptor(toy_clips(), DescriptorsConfig(supervision=by), recipe=recipe)
        assert np.isfinite(model.embed([clip_sequence(swinging(frames, 3.0), 30.0)])).all()

    def test_too_little_is_refused(self) -> None:
        with pytest.raises(ValueError, match="too few"):
            train_descriptor(toy_clips()[:1], DescriptorsConfig(), recipe=TINY)
        with pytest.raises(ValueError, match="two classes"):
            train_descriptor(toy_clips()[:4], DescriptorsConfig(supervision="labels"), recipe=TINY)
        with pytest.raises(ValueError, match="no class has two clips"):
            train_descriptor(toy_clips(), DescriptorsConfig(supervision="none"), recipe=TINY)


def test_clips_are_resampled_to_one_length() -> None:
    ramp = np.arange(7, dtype=np.float32)[:, None, None] * np.ones((15, 3), dtype=np.float32)
    for clip in (ramp, ramp[::3]):
        np.testing.assert_allclose(resampled(clip, 13)[:, 0, 0], np.arange(13) / 2, atol=1e-6)
    assert not resampled(ramp[:1], 4).any()


def test_windows_cover_a_long_clip_evenly() -> None:
    clip = np.arange(1000, dtype=np.float32)[:, None, None] * np.ones((1, 15, 3), dtype=np.float32)
    parts = windows(clip, 300)
    assert {len(part) for part in parts} == {300}
    assert parts[0][0, 1, 0] == 0
    assert parts[-1][-1, 1, 0] == 999
    assert all(part[0, 0, 0] == 0 for part in parts)
    assert [part[0, 1, 0] for part in parts] == sorted(part[0, 1, 0] for part in parts)


def test_recipes_by_name() -> None:
    thesis = recipe_of(DescriptorsConfig(recipe="deephums"))
    assert (thesis.encoders, thesis.objective, thesis.speeds, thesis.learning_rate) == (("lstm",), "pairs", True, 1e-3)
    assert recipe_of(DescriptorsConfig(), labels=False).encoders == ("sketch", "neighbourhood")
    assert recipe_of(DescriptorsConfig(epochs=7)).epochs == 7
    assert recipe_of(DescriptorsConfig(epochs=7), labels=False).epochs == 0
    assert Augmentation().missing > 0
    assert read_recipe(asdict(TINY)) == TINY


def test_a_recipe_of_an_earlier_file_is_read() -> None:
    kept = asdict(TINY) | {"encoder": "conv_gru", "sharpness": 2.0}
    for name in ("encoders", "convolutions", "paced"):
        del kept[name]
    assert read_recipe(kept) == TINY
    assert read_recipe(kept | {"encoder": "lstm"}).encoders == ("lstm",)
