"""motionlake train: a command for each kind of model, made from what the kind says of itself."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Annotated, Any, Final

import typer
from motionlake.cli._output import tell
from motionlake.cli._running import running
from motionlake.cli.common import SETTINGS, JsonOption, LakeOption, MinQualityOption, option
from motionlake.deephums.config import SUPERVISIONS
from motionlake.errors import UserError
from motionlake.jobs import models
from motionlake.lake.layout import open_lake
from motionlake.stages.model_kind import ModelKind, Selection
from motionlake.stages.registry import KINDS

OPTIONS: Final[dict[str, tuple[Any, Any]]] = {
    "split": (
        Annotated[str | None, option(help="Train on the clips of this split of labels.csv (default: on all).")],
        None,
    ),
    "dataset": (Annotated[str | None, option(help="Train on clips of this dataset (default: of all).")], None),
    "min_quality": (MinQualityOption, None),
    "fine_tune": (
        Annotated[bool, typer.Option("--fine-tune", help="Go on from the lake's network or the pretrained weights.")],
        False,
    ),
    "supervision": (
        Annotated[str | None, option(help=f"{', '.join(SUPERVISIONS)} (default: as config.toml says).")],
        None,
    ),
}
CHOOSING: Final = {field.name for field in fields(Selection)}

train = typer.Typer(
    help="Train a model on a lake's own clips.\n\n"
    "No labels are needed but for descriptors by labels and for synthesis.\n\n"
    "Example: motionlake train words --json --lake mylake",
    no_args_is_help=True,
    **SETTINGS,
)


def _command(kind: ModelKind[Any]) -> Callable[..., None]:
    def command(**given: Any) -> None:
        lake, as_json = given.pop("lake"), given.pop("as_json")
        target = open_lake(lake)
        where = Selection(**{name: value for name, value in given.items() if name in CHOOSING})
        shaping = {name: value for name, value in given.items() if name not in CHOOSING and value is not None}
        with running(target, f"train {kind.command}") as job:
            try:
                config = job.config.replacing(replace(job.config.of(kind.config), **shaping))
                model = models.train(job, kind, where, config=config)
            except ValueError as error:
                raise UserError(f"{target.root}: {error}") from error
        if model is None:
            raise UserError(f"{target.root}: has no {kind.lacks}")
        said = kind.said.format(lake=lake, **model.metrics)
        tell({"model": model.model, "metrics": model.metrics}, f"{model.model}: {said}", as_json=as_json)

    options = {"lake": (LakeOption, ...), **{n: OPTIONS[n] for n in kind.options}, "as_json": (JsonOption, False)}
    command.__annotations__ = {name: of for name, (of, _) in options.items()}
    command.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=of)
            for name, (of, default) in options.items()
        ]
    )
    return command


for trained in (kind for kind in KINDS.values() if kind.command):
    train.command(trained.command, help=inspect.cleandoc(trained.help))(_command(trained))
