"""The sub-motion encoder (DeepHuMS, section 3.3.5), trained on clips of a lake or taken pretrained."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from motionlake.arrays import Float32Array
from motionlake.deephums.config import PRETRAINED_SUBMOTION, DescriptorsConfig
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection
from motionlake.lake.config import LakeConfig
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model, checkpoint_file, save_model
from motionlake.stages.descriptor_network import TrainingSet, training_set
from motionlake.stages.descriptors import served_network
from motionlake.stages.model_kind import ModelKind, Selection, Steps
from motionlake.stages.reader import LakeReader


@dataclass(frozen=True)
class SubmotionSet:
    """Clips to train on; for recipe "deephums" the descriptor network that pieces of them are to agree with."""

    clips: TrainingSet
    first: Model | None = None


class SubmotionEncoder(ModelKind[SubmotionSet]):
    """What maps windows of a clip near the clip that they are part of."""

    name = "submotion"
    table = "submotion"
    title = "sub-motion encoder"
    command = "submotion"
    use = "makes vectors of the windows of clips"
    pretrained = PRETRAINED_SUBMOTION
    kept = ("clips", "loss")

    def announce(self, at: LakeReader) -> str:
        return f"will train a sub-motion encoder ({at.config.submotion.recipe})"

    def data(self, at: LakeReader, where: Selection) -> SubmotionSet | None:
        config = at.config.submotion
        alike = DescriptorsConfig(supervision="none", seed=config.seed)
        clips = training_set(at.con, at.lake, alike, where.split, where.dataset)
        if clips is None:
            return None
        return SubmotionSet(clips, _first(at.con, at.lake) if config.recipe == "deephums" else None)

    def train(
        self, lake: Lake, config: LakeConfig, data: SubmotionSet, file: str, progress: Steps
    ) -> Mapping[str, Any]:
        from motionlake.deephums.submotions import TrainedSubmotion, train_submotion

        wanted, sequences = config.submotion, [clip.sequence for clip in data.clips.clips]
        targets = None if data.first is None else _descriptors(lake, data.first, sequences)
        try:
            network, losses = train_submotion(
                sequences, wanted, targets=targets, checkpoint=checkpoint_file(lake, "submotion"), progress=progress
            )
        except ValueError as error:
            raise UserError(f"{lake.root}: no sub-motion encoder can be trained: {error}") from error
        named = {"descriptors": data.first.model} if data.first else {}
        metrics = {**data.clips.metrics, **named, "clips": len(sequences), "loss": round(losses[-1], 5)}
        save_model(lake, file, TrainedSubmotion(wanted, network, metrics).save)
        return metrics

    def metrics_of(self, weights: Path) -> Mapping[str, Any]:
        from motionlake.deephums.submotions import load_submotion

        return load_submotion(weights).metrics


SUBMOTION_ENCODER: Final = SubmotionEncoder()


def _first(con: Connection, lake: Lake) -> Model:
    network = served_network(con)
    if network is None:
        raise UserError(
            f'{lake.root}: has no descriptors yet, and recipe "deephums" trains pieces to agree with them; make them '
            "with `motionlake run descriptors`"
        )
    return network


def _descriptors(lake: Lake, network: Model, sequences: list[Float32Array]) -> Float32Array:
    from motionlake.deephums.trained import load_descriptor

    return load_descriptor(lake.path(network.file)).embed(sequences)
