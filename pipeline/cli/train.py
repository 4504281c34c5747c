"""motionlake train."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any

import typer
from motionlake.cli.common import SETTINGS, JsonOption, LakeOption, notice, stage_progress, tell
from motionlake.deephums.config import SUPERVISIONS
from motionlake.errors import UserError
from motionlake.jobs import models
from motionlake.jobs.session import session
from motionlake.lake.layout import Lake, open_lake
from motionlake.lake.models import Model
from motionlake.stages.descriptor_network import DESCRIPTOR_NETWORK
from motionlake.stages.generator_model import GENERATOR
from motionlake.stages.model_kind import ModelKind, Selection
from motionlake.stages.posture_dictionary import POSTURE_DICTIONARY
from motionlake.stages.submotion_encoder import SUBMOTION_ENCODER
from motionlake.stages.word_network import WORD_NETWORK

SplitOption = Annotated[
    str | None,
    typer.Option(help="Train on the clips of this split of labels.csv (default: on all).", show_default=False),
]
DatasetOption = Annotated[
    str | None, typer.Option(help="Train on clips of this dataset (default: of all).", show_default=False)
]


train = typer.Typer(
    help="Train a model on a lake's own clips.\n\n"
    "No labels are needed but for descriptors by labels and for synthesis.\n\n"
    "Example: motionlake train words --json --lake mylake",
    no_args_is_help=True,
    **SETTINGS,
)


@train.command()
def words(
    lake: LakeOption,
    fine_tune: Annotated[
        bool, typer.Option("--fine-tune", help="Go on from the lake's network or the pretrained weights.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Train the word network that config.toml names; `motionlake run all` then embeds with it.

    Interrupted, the same command goes on where it stopped. [network] in config.toml says which architecture
    ("linear", "conv", "inception736"), how many steps, and from which seed.

    Example: motionlake train words --lake mylake

    Example: motionlake train words --fine-tune --lake mylake
    """
    target = open_lake(lake)
    model = _train(target, WORD_NETWORK, Selection(fine_tune=fine_tune))
    if model is None:
        raise UserError(f"{target.root}: has no words to train on yet; make them with `motionlake run words`")
    _tell(model, f"trained on {model.metrics['words']} words; embed with it: motionlake run all --lake {lake}", as_json)


@train.command()
def postures(lake: LakeOption, as_json: JsonOption = False) -> None:
    """Train the posture dictionary that config.toml names; `motionlake run all` then codes with it.

    Interrupted, the same command goes on where it stopped. [postures] in config.toml says which dictionary ("aae",
    "kmeans", "som"), how many symbols, from which seed, and by which recipe ("default", "pesta").

    Example: motionlake train postures --lake mylake
    """
    target = open_lake(lake)
    model = _train(target, POSTURE_DICTIONARY, Selection())
    if model is None:
        raise _no_frames(target)
    _tell(model, f"{model.metrics['occupied']} symbols in use; code with it: motionlake run all --lake {lake}", as_json)


@train.command()
def descriptor(
    lake: LakeOption,
    split: SplitOption = None,
    dataset: DatasetOption = None,
    supervision: Annotated[
        str | None,
        typer.Option(help=f"{', '.join(SUPERVISIONS)} (default: as config.toml says).", show_default=False),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Train the descriptor network that config.toml names; `motionlake run all` then describes every clip with it.

    "labels" trains on motion and on the classes of labels.csv, "none" on motion alone, "auto" by labels where there
    are some. [descriptors] in config.toml says by which recipe ("default", "deephums") and from which seed.
    Interrupted, the same command goes on where it stopped.

    Example: motionlake train descriptor --lake mylake

    Example: motionlake train descriptor --split train --supervision labels --json --lake mylake
    """
    if supervision is not None and supervision not in SUPERVISIONS:
        raise UserError(f"--supervision {supervision}: is none of {', '.join(SUPERVISIONS)}")
    target = open_lake(lake)
    model = _train(target, DESCRIPTOR_NETWORK, Selection(split, dataset), supervision)
    if model is None:
        raise _no_frames(target)
    about = f"trained on {model.metrics['clips']} clips, supervision {model.metrics['supervision']}"
    _tell(model, f"{about}; describe clips with it: motionlake run all --lake {lake}", as_json)


@train.command()
def submotion(
    lake: LakeOption,
    split: SplitOption = None,
    dataset: DatasetOption = None,
    as_json: JsonOption = False,
) -> None:
    """Train the network that finds the clip a piece of motion is from; `motionlake run all` then reads with it.

    [submotion] in config.toml says by which recipe ("default", "deephums"), how many steps, and from which seed.
    Interrupted, the same command goes on where it stopped.

    Example: motionlake train submotion --split train --lake mylake
    """
    target = open_lake(lake)
    model = _train(target, SUBMOTION_ENCODER, Selection(split, dataset))
    if model is None:
        raise _no_frames(target)
    _tell(model, f"trained on {model.metrics['clips']} clips; read with it: motionlake run all --lake {lake}", as_json)


@train.command()
def synthesis(
    lake: LakeOption,
    split: SplitOption = None,
    dataset: DatasetOption = None,
    as_json: JsonOption = False,
) -> None:
    """Train the generator that config.toml names; `motionlake synthesize` then makes motion with it.

    It learns from clips with a label, and from the labelled ranges of those without. [synthesis] in config.toml says by
    which recipe ("default", "glogen") and from which seed. Interrupted, the same command goes on where it stopped.

    Example: motionlake train synthesis --split train --lake mylake
    """
    target = open_lake(lake)
    model = _train(target, GENERATOR, Selection(split, dataset))
    if model is None:
        raise _no_frames(target)
    metrics = model.metrics
    about = f"trained on {metrics['clips']} motions of {len(metrics['class_names'])} classes"
    _tell(model, f"{about}; make motion with it: motionlake synthesize --class NAME --lake {lake}", as_json)


def _train(lake: Lake, kind: ModelKind[Any], where: Selection, supervision: str | None = None) -> Model | None:
    with stage_progress() as progress, session(lake, f"train {kind.command}", progress, notice) as job:
        config = job.config
        if supervision is not None:
            config = replace(config, descriptors=replace(config.descriptors, supervision=supervision))
        try:
            return models.train(job, kind, where, stage=kind.command, config=config)
        except ValueError as error:
            raise UserError(f"{lake.root}: {error}") from error


def _no_frames(lake: Lake) -> UserError:
    return UserError(f"{lake.root}: has no frames to train on yet; take clips in with `motionlake ingest`")


def _tell(model: Model, line: str, as_json: bool) -> None:
    tell({"model": model.model, "metrics": model.metrics}, f"{model.model}: {line}", as_json=as_json)
