"""Training a descriptor network on clips of a lake, all or those of a dataset or of a split."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from motionlake.arrays import Float32Array, Progress
from motionlake.deephums.config import DescriptorsConfig
from motionlake.deephums.sequence import FPS
from motionlake.deephums.training import TrainingClip, train_descriptor
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection
from motionlake.lake.layout import Lake
from motionlake.lake.models import checkpoint_file, save_model
from motionlake.stages.descriptors import sequence_of
from motionlake.stages.frames import clips_key
from motionlake.stages.training_clips import chosen_clips, drawn_clips, frames_of_clips

# Of more than these, clips are drawn at random.
MOST_FRAMES = 10_000_000  # at 30 a second: 93 hours
MOST_UNLABELLED = 5_000  # clips; without labels every clip is compared with every other


@dataclass(frozen=True)
class TrainingSet:
    """Clips in order of their names, with their labels, and what a network's figures tell of them."""

    clips: list[TrainingClip]
    figures: Mapping[str, Any]


def training_set(
    con: Connection, lake: Lake, config: DescriptorsConfig, split: str | None = None, dataset: str | None = None
) -> TrainingSet | None:
    """The clips to train on; None where the lake has none.

    Args:
        con: to the lake.
        lake: whose frames are read.
        config: says whether labels are needed; its seed draws where there are too many frames.
        split: as the column `split` of labels.csv has it; None takes every clip.
        dataset: None takes all.

    Raises:
        UserError: there is no such dataset or split, or labels are asked for and no clip has any.
    """
    rows = chosen_clips(con, lake, split, dataset)
    if not rows:
        return None
    if config.supervision == "labels" and not any(row["label"] for row in rows):
        raise UserError(
            f"{lake.root}: none of the {len(rows)} clips to train on has a label, and supervision by labels needs "
            "them; label them in labels.csv, or train without (--supervision none)"
        )
    labelled = config.supervision != "none" and any(row["label"] for row in rows)
    drawn = _drawn(rows, config.seed, len(rows) if labelled else MOST_UNLABELLED)
    sequences = _sequences(lake, drawn)
    figures = {
        "split": split,
        "dataset": dataset,
        "clips_there": len(rows),
        "data_sha256": clips_key([(row["clip"], row["content_hash"]) for row in drawn]),
    }
    return TrainingSet([TrainingClip(sequences[row["clip"]], row["label"]) for row in drawn], figures)


def _drawn(rows: list[dict[str, Any]], seed: int, most: int) -> list[dict[str, Any]]:
    lengths = np.array([row["frames"] / row["fps"] * FPS for row in rows])
    return drawn_clips(rows, lengths, seed, MOST_FRAMES, most)


def _sequences(lake: Lake, rows: Sequence[Mapping[str, Any]]) -> dict[str, Float32Array]:
    return {clip.clip: sequence_of(clip) for clip in frames_of_clips(lake, rows)}


def train(
    lake: Lake, material: TrainingSet, config: DescriptorsConfig, file: str, progress: Progress | None = None
) -> dict[str, Any]:
    """Train a network, save it as `file`; returns its figures.

    A training that was interrupted goes on from its checkpoint in the lake.

    Raises:
        UserError: the clips are too few, or labels are asked for and too few clips have one.
    """
    checkpoint = checkpoint_file(lake, "descriptors")
    try:
        trained = train_descriptor(material.clips, config, checkpoint=checkpoint, progress=progress)
    except ValueError as error:
        raise UserError(f"{lake.root}: no descriptor network can be trained: {error}") from error
    trained = replace(trained, figures={**material.figures, **trained.figures})
    save_model(lake, file, trained.save)
    return dict(trained.figures)
