"""Learning curves: loss, and top-1 of the clips of a training subject that is held out, over the epochs."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from motionlake.deephums.batches import resampled
from motionlake.deephums.config import DescriptorsConfig
from motionlake.deephums.recipes import recipe_of
from motionlake.deephums.training import train_descriptor

from bench.deephums.choices import left_out
from bench.deephums.fit import Clips, fit
from bench.deephums.retrieval import BASELINES, DESCRIPTORS, FRAMES, augmented, training_clips
from bench.deephums.sets import Split, split_of
from bench.fitting import Budget


def measure(set_name: str, epochs: int) -> dict[str, Any]:
    """{method: {loss [epochs], validation [(epoch, top-1)]}} with the last training subject held out, seed 0."""
    split = split_of(set_name, "train")
    held, known = left_out(split, max(split.subjects))
    found: dict[str, Any] = {}
    for method, (recipe, supervision) in DESCRIPTORS.items():
        config = DescriptorsConfig(recipe=recipe, supervision=supervision, epochs=epochs)
        if not recipe_of(config, labels=supervision == "labels").epochs:  # nothing is learned by gradients
            continue
        figures = train_descriptor(training_clips(known), config, validation=training_clips(held)).metrics
        found[method] = {"loss": figures["loss"], "validation": figures["validation"]}
        print(f"  {method}: top-1 held out {figures['validation'][-1][1]:.3f}", flush=True)
    recipe_default = recipe_of(DescriptorsConfig(epochs=epochs))
    for method, build in BASELINES.items():
        clips, asked = _clips(known, known), _clips(held, known)
        classes = len(set(known.labels))
        fitted = fit(
            partial(build, classes),
            clips,
            Budget(recipe_default.epochs),
            seed=0,
            held_out=asked,
            augment=augmented(recipe_default.augmentation, clips.x, clips.labels, 0),
        )
        found[method] = {
            "loss": [round(epoch.loss, 5) for epoch in fitted.epochs],
            "validation": [(i, epoch.retrieval) for i, epoch in enumerate(fitted.epochs, 1) if i % 10 == 0],
        }
        print(f"  {method}: top-1 held out {found[method]['validation'][-1][1]:.3f}", flush=True)
    return found


def _clips(split: Split, known: Split) -> Clips:
    classes = {label: i for i, label in enumerate(sorted(set(known.labels)))}
    x = np.stack([resampled(sequence, FRAMES) for sequence in split.sequences])
    return Clips(x, np.array([classes[label] for label in split.labels]), tuple(split.subjects))
