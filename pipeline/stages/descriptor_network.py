"""The descriptor network (DeepHuMS, section 3.2), trained on clips of a lake or taken pretrained."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from motionlake.arrays import Float32Array
from motionlake.deephums.config import PRETRAINED_DESCRIPTORS, DescriptorsConfig
from motionlake.deephums.sequence import FPS, clip_sequence
from motionlake.errors import UserError
from motionlake.lake import frames
from motionlake.lake.catalog import Connection
from motionlake.lake.config import LakeConfig
from motionlake.lake.layout import Lake
from motionlake.lake.models import checkpoint_file, save_model
from motionlake.stages.frames import clips_key
from motionlake.stages.model_kind import ModelKind, Selection, Steps
from motionlake.stages.reader import LakeReader
from motionlake.stages.training_clips import chosen_clips, drawn_clips, frames_of_clips

if TYPE_CHECKING:
    from motionlake.deephums.training import TrainingClip

# Of more than these, clips are drawn at random.
MOST_FRAMES = 10_000_000  # at 30 a second: 93 hours
MOST_UNLABELLED = 5_000  # clips; without labels every clip is compared with every other


@dataclass(frozen=True)
class TrainingSet:
    """Clips in order of their names, with their labels, and what a network's metrics tell of them."""

    clips: list[TrainingClip]
    metrics: Mapping[str, Any]


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
    from motionlake.deephums.training import TrainingClip

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
    sequences = {clip.clip: sequence_of(clip) for clip in frames_of_clips(lake, drawn)}
    metrics = {
        "split": split,
        "dataset": dataset,
        "clips_there": len(rows),
        "data_sha256": clips_key([(row["clip"], row["content_hash"]) for row in drawn]),
    }
    return TrainingSet([TrainingClip(sequences[row["clip"]], row["label"]) for row in drawn], metrics)


def _drawn(rows: list[dict[str, Any]], seed: int, most: int) -> list[dict[str, Any]]:
    lengths = np.array([row["frames"] / row["fps"] * FPS for row in rows])
    return drawn_clips(rows, lengths, seed, MOST_FRAMES, most)


def sequence_of(clip: frames.Frames) -> Float32Array:
    """[T, J, 3] a clip of the lake as the network reads it."""
    return clip_sequence(clip.positions.astype(float), clip.fps)


class DescriptorNetwork(ModelKind[TrainingSet]):
    """What turns a clip into a vector."""

    name = "descriptors"
    table = "descriptors"
    title = "descriptor network"
    command = "descriptor"
    use = "describes the clips"
    pretrained = PRETRAINED_DESCRIPTORS
    kept = ("clips", "classes", "supervision")

    def announce(self, at: LakeReader) -> str:
        return f"will train a descriptor network ({at.config.descriptors.recipe})"

    def data(self, at: LakeReader, where: Selection) -> TrainingSet | None:
        return training_set(at.con, at.lake, at.config.descriptors, where.split, where.dataset)

    def train(self, lake: Lake, config: LakeConfig, data: TrainingSet, file: str, progress: Steps) -> Mapping[str, Any]:
        from motionlake.deephums.training import train_descriptor

        checkpoint = checkpoint_file(lake, "descriptors")
        try:
            trained = train_descriptor(data.clips, config.descriptors, checkpoint=checkpoint, progress=progress)
        except ValueError as error:
            raise UserError(f"{lake.root}: no descriptor network can be trained: {error}") from error
        trained = replace(trained, metrics={**data.metrics, **trained.metrics})
        save_model(lake, file, trained.save)
        return dict(trained.metrics)

    def metrics_of(self, weights: Path) -> Mapping[str, Any]:
        from motionlake.deephums.trained import load_descriptor

        return load_descriptor(weights).metrics


DESCRIPTOR_NETWORK: Final = DescriptorNetwork()
