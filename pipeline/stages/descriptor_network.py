"""The descriptor network (DeepHuMS, section 3.2), trained on clips of a lake or taken pretrained."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from motionlake.arrays import Float32Array, Progress
from motionlake.deephums.config import PRETRAINED_DESCRIPTORS, DescriptorsConfig
from motionlake.deephums.sequence import FPS, clip_sequence
from motionlake.errors import UserError
from motionlake.lake import frames
from motionlake.lake.catalog import Connection
from motionlake.lake.config import LakeConfig
from motionlake.lake.layout import Lake
from motionlake.stages.frames import clips_key
from motionlake.stages.model_kind import CHOSEN, ModelKind, Selection
from motionlake.stages.part_clips import shared
from motionlake.stages.reader import LakeReader
from motionlake.stages.training_clips import chosen_clips, drawn_clips, frames_of_clips

if TYPE_CHECKING:
    from motionlake.deephums.network import TrainedDescriptor
    from motionlake.deephums.training import TrainingClip

# Of more than these, clips are drawn at random.
MOST_FRAMES = 10_000_000  # at 30 a second: 93 hours
MOST_UNLABELLED = 5_000  # clips; without labels the time goes by their square


@dataclass(frozen=True)
class TrainingSet:
    """Clips in order of their names, with their labels, and what a network's metrics tell of them."""

    clips: list[TrainingClip]
    metrics: Mapping[str, Any]


def training_set(
    con: Connection,
    lake: Lake,
    config: DescriptorsConfig,
    split: str | None = None,
    dataset: str | None = None,
    min_quality: str | None = None,
) -> TrainingSet | None:
    """The clips to train on; None where the lake has none.

    Args:
        con: to the lake.
        lake: whose frames are read.
        config: says whether labels are needed; its seed draws where there are too many frames.
        split: as the column `split` of labels.csv has it; None takes every clip.
        dataset: None takes all.
        min_quality: the worst verdict that a clip may have; None takes any.

    Raises:
        UserError: there is no such dataset or split, or labels are asked for and no clip has any.
    """
    from motionlake.deephums.training import TrainingClip

    rows = chosen_clips(con, lake, split, dataset, min_quality=min_quality)
    if not rows:
        return None
    if config.supervision == "labels" and not any(row["label"] for row in rows):
        raise UserError(
            f"{lake.root}: none of the {len(rows)} clips to train on has a label, and supervision by labels needs "
            "them; label them in labels.csv, or train without (--supervision none)"
        )
    labelled = config.supervision != "none" and any(row["label"] for row in rows)
    drawn = _drawn(rows, config.seed, len(rows) if labelled else MOST_UNLABELLED)
    sequences = {clip.clip: sequence_of(clip.recorded()) for clip in frames_of_clips(lake, drawn)}
    metrics = {
        "split": split,
        "dataset": dataset,
        **({} if min_quality is None else {"min_quality": min_quality}),
        "clips_there": len(rows),
        "data_sha256": clips_key([(row["clip"], row["content_hash"]) for row in drawn]),
    }
    return TrainingSet([TrainingClip(sequences[row["clip"]], row["label"]) for row in drawn], metrics)


def _drawn(rows: list[dict[str, Any]], seed: int, most: int) -> list[dict[str, Any]]:
    lengths = np.array([row["frames"] / row["fps"] * FPS for row in rows])
    return drawn_clips(rows, lengths, seed, MOST_FRAMES, most)


def sequence_of(clip: frames.Frames) -> Float32Array:
    """[T, J, 3] a clip of the lake as the network reads it."""
    return shared(("sequence", clip.clip), lambda: clip_sequence(clip.positions.astype(float), clip.fps))


class DescriptorNetwork(ModelKind[TrainingSet]):
    """What turns a clip into a vector."""

    name = "descriptors"
    version = 2  # sketches by other constants
    config = DescriptorsConfig
    title = "descriptor network"
    use = "describes the clips"
    command = "descriptor"
    help = """Train the descriptor network that config.toml names; `motionlake run all` then describes clips with it.

    "labels" trains on motion and on the classes of labels.csv, "none" on motion alone, "auto" by labels where there
    are some. [descriptors] in config.toml says by which recipe ("default", "deephums") and from which seed.
    Interrupted, the same command goes on where it stopped.

    Example: motionlake train descriptor --lake mylake

    Example: motionlake train descriptor --split train --supervision labels --json --lake mylake
    """
    said = (
        "trained on {clips} clips, supervision {supervision}; describe clips with it: motionlake run all --lake {lake}"
    )
    options = (*CHOSEN, "supervision")
    pretrained = PRETRAINED_DESCRIPTORS
    kept = ("clips", "classes", "supervision")

    def announce(self, at: LakeReader) -> str:
        return f"will train a descriptor network ({at.config.descriptors.recipe})"

    def data(self, at: LakeReader, where: Selection) -> TrainingSet | None:
        return training_set(at.con, at.lake, at.config.descriptors, where.split, where.dataset, where.min_quality)

    def fit(
        self, lake: Lake, config: LakeConfig, data: TrainingSet, checkpoint: Path, progress: Progress
    ) -> TrainedDescriptor:
        from motionlake.deephums.training import train_descriptor

        trained = train_descriptor(data.clips, config.descriptors, checkpoint=checkpoint, progress=progress)
        return replace(trained, metrics={**data.metrics, **trained.metrics})

    def load(self, path: Path) -> TrainedDescriptor:
        from motionlake.deephums.network import load_descriptor

        return load_descriptor(path)


DESCRIPTOR_NETWORK: Final = DescriptorNetwork()
