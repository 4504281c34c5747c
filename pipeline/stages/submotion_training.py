"""Training the second network on clips of a lake, all or those of a dataset or of a split."""

from __future__ import annotations

from typing import Any

from motionlake.arrays import Progress
from motionlake.deephums.config import DescriptorsConfig, SubmotionConfig
from motionlake.deephums.submotions import TrainedSubmotion, train_submotion
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model, checkpoint_file, save_model
from motionlake.stages import descriptors
from motionlake.stages.descriptor_training import TrainingSet, training_set


def submotion_set(
    con: Connection, lake: Lake, config: SubmotionConfig, split: str | None = None, dataset: str | None = None
) -> TrainingSet | None:
    """The clips to train on, as for descriptors without labels; None where the lake has none.

    Raises:
        UserError: there is no such dataset or split.
    """
    return training_set(con, lake, DescriptorsConfig(supervision="none", seed=config.seed), split, dataset)


def first_network(con: Connection, lake: Lake, config: SubmotionConfig) -> Model | None:
    """The descriptor network that pieces are to agree with, which recipe "deephums" needs.

    Raises:
        UserError: it needs one, and the lake serves none.
    """
    if config.recipe != "deephums":
        return None
    network = descriptors.served_network(con)
    if network is None:
        raise UserError(
            f'{lake.root}: has no descriptors yet, and recipe "deephums" trains pieces to agree with them; make them '
            "with `motionlake run descriptors`"
        )
    return network


def train(
    lake: Lake,
    material: TrainingSet,
    config: SubmotionConfig,
    first: Model | None,
    file: str,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Train a network, save it as `file`; returns its figures.

    A training that was interrupted goes on from its checkpoint in the lake.

    Raises:
        UserError: the clips are too few.
    """
    sequences = [clip.sequence for clip in material.clips]
    targets = None
    if first is not None:
        from motionlake.deephums.trained import load_descriptor

        targets = load_descriptor(lake.path(first.file)).embed(sequences)
    checkpoint = checkpoint_file(lake, "submotion")
    try:
        network, losses = train_submotion(sequences, config, targets=targets, checkpoint=checkpoint, progress=progress)
    except ValueError as error:
        raise UserError(f"{lake.root}: no sub-motion network can be trained: {error}") from error
    named = {"descriptors": first.model} if first else {}
    figures = {**material.figures, **named, "clips": len(sequences), "loss": round(losses[-1], 5)}
    save_model(lake, file, TrainedSubmotion(config, network, figures).save)
    return figures
