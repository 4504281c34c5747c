"""Where clips lie in the graph of those trained on, against naive ridge regression and alignment of all with all."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from motionlake.arrays import Float64Array
from motionlake.deephums import training
from motionlake.deephums.batches import resampled
from motionlake.deephums.config import DescriptorsConfig
from motionlake.deephums.neighbourhood import BREADTH, RIDGE, Neighbourhood, neighbourhoods
from motionlake.deephums.network import TrainedDescriptor, load_descriptor
from motionlake.deephums.recipes import WITHOUT
from motionlake.deephums.sequence import alignment_distances
from motionlake.deephums.sketch import sketches
from motionlake.deephums.training import TrainingClip, train_descriptor
from motionlake.motion.diffusion import way_between
from torch import Tensor

from tests.test_descriptor_network import toy_clips

CONFIG = DescriptorsConfig(supervision="none")
RECIPE = replace(WITHOUT, neighbours=3)


def trained(clips: list[TrainingClip]) -> TrainedDescriptor:
    return train_descriptor(clips, CONFIG, recipe=RECIPE)


def instants(seed: int) -> Tensor:
    return torch.from_numpy(np.stack([resampled(clip.sequence, 48, 0.5) for clip in toy_clips(seed)]))


def test_neighbourhoods_are_those_of_all_alignments() -> None:
    clips = [clip.sequence for clip in toy_clips()]
    told: list[tuple[int, int]] = []
    near = neighbourhoods(clips, 3, lambda *done: told.append(done))
    np.testing.assert_allclose(near, way_between(alignment_distances(clips), 3), atol=1e-3)
    assert told == [(done, 16) for done in range(1, 17)]
    np.fill_diagonal(near, 0)
    assert (near.argmax(axis=1) // 4 == np.arange(16) // 4).all()  # speed and size do not count


def test_a_new_clip_lies_where_kernel_ridge_regression_has_it() -> None:
    clips, others = instants(0), instants(1)
    near = neighbourhoods([clip.sequence for clip in toy_clips()], 3)
    encoder = Neighbourhood(64)
    encoder.learn(clips, torch.from_numpy(near))
    known = sketches(clips).numpy().astype(float)
    weights = np.linalg.inv(np.exp((known @ known.T - 1) / BREADTH) + RIDGE * np.eye(16)) @ near
    # Sketches are kept in the directions of the clips trained on, which others may leave.
    for these, rounding in ((clips, 1e-5), (others, 0.05)):
        lie = np.exp((sketches(these).numpy().astype(float) @ known.T - 1) / BREADTH) @ weights
        np.testing.assert_allclose(cosines(encoder(these).numpy()), cosines(lie), atol=rounding)


def cosines(rows: Float64Array) -> Float64Array:
    unit = rows / np.linalg.norm(rows, axis=1, keepdims=True)
    return np.asarray(unit @ unit.T)


def test_clips_of_a_kind_lie_together_though_they_were_not_trained_on() -> None:
    model = trained(toy_clips())
    asked = model.embed([clip.sequence for clip in toy_clips(1)])
    known = model.embed([clip.sequence for clip in toy_clips()])
    assert ((asked @ known.T).argmax(axis=1) // 4 == np.arange(16) // 4).all()


def test_a_clip_like_none_of_the_examples_has_a_descriptor() -> None:
    model = trained(toy_clips())
    far = np.random.default_rng(0).standard_normal((40, 15, 3)).astype(np.float32)
    assert np.isfinite(model.embed([far, np.zeros_like(far)])).all()


def test_it_is_read_as_it_was_kept_and_the_same_each_time(tmp_path: Path) -> None:
    sequences = [clip.sequence for clip in toy_clips(1)]
    model = trained(toy_clips())
    model.save(tmp_path / "model.safetensors")
    read = load_descriptor(tmp_path / "model.safetensors")
    np.testing.assert_array_equal(read.embed(sequences), model.embed(sequences))
    np.testing.assert_array_equal(trained(toy_clips()).embed(sequences), model.embed(sequences))
    assert model.metrics == {"clips": 16, "classes": None, "supervision": "none"}


def test_of_many_clips_some_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "MOST_EXAMPLES", 9)
    encoder = trained(toy_clips()).network.encoders[1]
    assert isinstance(encoder, Neighbourhood)
    assert len(encoder.examples) == len(encoder.ways) == 9


def test_two_clips_are_enough() -> None:
    assert np.isfinite(trained(toy_clips()[:2]).embed([clip.sequence for clip in toy_clips()])).all()
