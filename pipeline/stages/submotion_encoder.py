"""The sub-motion encoder (DeepHuMS, section 3.3.5), trained on clips of a lake or taken pretrained."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from motionlake.arrays import Float32Array, Progress
from motionlake.deephums.config import PRETRAINED_SUBMOTION, DescriptorsConfig, SubmotionConfig
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection
from motionlake.lake.config import LakeConfig
from motionlake.lake.layout import Lake
from motionlake.lake.loaded import loaded
from motionlake.lake.models import Model
from motionlake.stages.descriptor_network import TrainingSet, training_set
from motionlake.stages.descriptors import DESCRIPTORS
from motionlake.stages.model_kind import CHOSEN, ModelKind, Selection
from motionlake.stages.reader import LakeReader

if TYPE_CHECKING:
    from motionlake.deephums.submotions import TrainedSubmotion


@dataclass(frozen=True)
class SubmotionSet:
    """Clips to train on; for recipe "deephums" the descriptor network that pieces of them are to agree with."""

    clips: TrainingSet
    first: Model | None = None


class SubmotionEncoder(ModelKind[SubmotionSet]):
    """What maps windows of a clip near the clip that they are part of."""

    name = "submotion"
    config = SubmotionConfig
    title = "sub-motion encoder"
    use = "makes vectors of the windows of clips"
    command = "submotion"
    help = """Train the network that finds the clip a piece of motion is from; `motionlake run all` then reads with it.

    [submotion] in config.toml says by which recipe ("default", "deephums"), how many steps, and from which seed.
    Interrupted, the same command goes on where it stopped.

    Example: motionlake train submotion --split train --lake mylake
    """
    said = "trained on {clips} clips; read with it: motionlake run all --lake {lake}"
    options = CHOSEN
    pretrained = PRETRAINED_SUBMOTION
    kept = ("clips", "loss")

    def announce(self, at: LakeReader) -> str:
        return f"will train a sub-motion encoder ({at.config.submotion.recipe})"

    def data(self, at: LakeReader, where: Selection) -> SubmotionSet | None:
        config = at.config.submotion
        alike = DescriptorsConfig(supervision="none", seed=config.seed)
        clips = training_set(at.con, at.lake, alike, where.split, where.dataset, where.min_quality)
        if clips is None:
            return None
        return SubmotionSet(clips, _first(at.con, at.lake) if config.recipe == "deephums" else None)

    def fit(
        self, lake: Lake, config: LakeConfig, data: SubmotionSet, checkpoint: Path, progress: Progress
    ) -> TrainedSubmotion:
        from motionlake.deephums.submotions import TrainedSubmotion, train_submotion

        wanted, sequences = config.submotion, [clip.sequence for clip in data.clips.clips]
        targets = None if data.first is None else _descriptors(lake, data.first, sequences)
        network, losses = train_submotion(sequences, wanted, targets=targets, checkpoint=checkpoint, progress=progress)
        named = {"descriptors": data.first.model} if data.first else {}
        metrics = {**data.clips.metrics, **named, "clips": len(sequences), "loss": round(losses[-1], 5)}
        return TrainedSubmotion(wanted, network, metrics)

    def load(self, path: Path) -> TrainedSubmotion:
        from motionlake.deephums.submotions import load_submotion

        return load_submotion(path)


SUBMOTION_ENCODER: Final = SubmotionEncoder()


def _first(con: Connection, lake: Lake) -> Model:
    network = DESCRIPTORS.served(con)
    if network is None:
        raise UserError(
            f'{lake.root}: has no descriptors yet, and recipe "deephums" trains pieces to agree with them; make them '
            "with `motionlake run descriptors`"
        )
    return network


def _descriptors(lake: Lake, network: Model, sequences: list[Float32Array]) -> Float32Array:
    from motionlake.deephums.network import load_descriptor

    return loaded(load_descriptor, lake, network.file).embed(sequences)
