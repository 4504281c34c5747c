"""motionlake train."""

from __future__ import annotations

from typing import Annotated

import typer

from jobs import embed
from jobs import postures as postures_job
from jobs.session import session
from pipeline.cli.common import JsonOption, LakeOption, notice, print_json, stage_progress
from pipeline.errors import UserError
from pipeline.lake.layout import open_lake


def add_to(app: typer.Typer) -> None:
    about = (
        "Train a model on a lake's own clips, without labels.\n\nExample: motionlake train words --json --lake mylake"
    )
    train = typer.Typer(name="train", help=about, no_args_is_help=True)
    train.callback()(lambda: None)
    train.command()(words)
    train.command()(postures)
    app.add_typer(train)


def words(
    lake: LakeOption,
    fine_tune: Annotated[
        bool, typer.Option("--fine-tune", help="Go on from the lake's network or the ready-made weights.")
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
    with stage_progress() as progress, session(target, "train words", progress, notice) as job:
        try:
            model = embed.train(job, fine_tune=fine_tune)
        except ValueError as error:
            raise UserError(f"{target.root}: {error}") from error
    if model is None:
        raise UserError(f"{target.root}: has no words to train on yet; make them with `motionlake run words`")
    if as_json:
        print_json({"model": model.model, "figures": model.figures})
    else:
        print(
            f"{model.model}: trained on {model.figures['words']} words; embed with it: motionlake run all --lake {lake}"
        )


def postures(lake: LakeOption, as_json: JsonOption = False) -> None:
    """Train the posture dictionary that config.toml names; `motionlake run all` then codes with it.

    Interrupted, the same command goes on where it stopped. [postures] in config.toml says which dictionary ("aae",
    "kmeans", "som"), how many symbols, from which seed, and by which recipe ("default", "pesta").

    Example: motionlake train postures --lake mylake
    """
    target = open_lake(lake)
    with stage_progress() as progress, session(target, "train postures", progress, notice) as job:
        model = postures_job.train(job)
    if model is None:
        raise UserError(f"{target.root}: has no frames to train on yet; take clips in with `motionlake ingest`")
    if as_json:
        print_json({"model": model.model, "figures": model.figures})
    else:
        print(
            f"{model.model}: {model.figures['occupied']} symbols in use; code with it: motionlake run all --lake {lake}"
        )
