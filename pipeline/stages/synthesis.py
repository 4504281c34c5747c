"""Stage "synth": a generator of new motion, ready-made or trained on clips of known class (GloGen and LocGen)."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motionlake.errors import UserError
from motionlake.glogen.config import PRETRAINED_GENERATOR
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.config import LakeConfig, config_hash
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model, copy_weights, current_model, fitting_model

if TYPE_CHECKING:
    from motionlake.glogen.generator import TrainedGenerator

NAME = "synth"
VERSION = 4
GENERATOR = "synthesis"
SHOWN = 3  # classes offered in place of an unknown one


def generator_key(config: LakeConfig) -> str:
    """Covers all that shapes a generator but the clips it is trained on."""
    return config_hash(GENERATOR, VERSION, config.synthesis)


def fitting_generator(con: Connection, config: LakeConfig) -> Model | None:
    """The current generator if it was made for this configuration."""
    return fitting_model(con, GENERATOR, generator_key(config))


def takes_ready_made(con: Connection, config: LakeConfig) -> bool:
    """Whether the lake starts with the ready-made generator, and does not train one."""
    if not PRETRAINED_GENERATOR.fits(config.synthesis):
        return False
    return config.synthesis.weights == "shipped" or not classed_motions(con)


def classed_motions(con: Connection, split: str | None = None, label: str | None = None) -> list[dict[str, Any]]:
    """Recorded motion of known class: of a split, of a class; of any where these are None."""
    return fetch(con, "classed_motions", {"dataset": None, "split": split, "label": label})


def take_weights(lake: Lake, _config: LakeConfig, weights: Path, file: str) -> dict[str, Any]:
    """Copy a ready-made generator into the lake as `file`; returns its figures."""
    from motionlake.glogen.generator import load_generator

    kept = ("clips", "class_names", "datasets", "licences", "filled", "split", "dataset")
    return copy_weights(lake, weights, file, load_generator(weights).figures, *kept)


def outdated(con: Connection, config: LakeConfig) -> bool:
    """Whether the lake has a generator, but none for this configuration."""
    return current_model(con, GENERATOR) is not None and fitting_generator(con, config) is None


def served_generator(con: Connection, lake: Lake, config: LakeConfig) -> Model:
    """The generator that makes motion.

    Raises:
        UserError: the lake has none, or one that was made for another configuration.
    """
    fitting = fitting_generator(con, config)
    if fitting is not None:
        return fitting
    other = current_model(con, GENERATOR)
    if other is not None:
        raise UserError(
            f"{lake.root}: {other.model} was trained for other values of [synthesis] than config.toml has now, or by "
            "an earlier version; train one for these with `motionlake train synthesis`"
        )
    raise UserError(
        f"{lake.root}: has no generator yet; get one with `motionlake run synth`, trained on clips of known "
        "class or, where there are none, ready-made"
    )


def open_generator(lake: Lake, model: Model) -> TrainedGenerator:
    """The generator itself.

    Raises:
        UserError: its file holds something else, or a generator of another skeleton.
    """
    from motionlake.glogen.generator import load_generator

    try:
        return load_generator(lake.path(model.file))
    except ValueError as error:
        raise UserError(f"{lake.root}: {model.model} makes no motion here: {error}") from error


def class_names(model: Model) -> list[str]:
    """The classes that a generator knows, sorted."""
    return list(model.figures["class_names"])


def check_classes(model: Model, classes: tuple[str, ...]) -> None:
    """Raises `UserError` for no class, or one that a generator does not know."""
    known = class_names(model)
    if not classes:
        raise UserError("name one class at least, --class NAME; `motionlake synthesize --classes` lists them")
    for name in classes:
        if name not in known:
            raise UserError(
                f"{name}: {model.model} knows no such class; {_nearest(name, known)}all {len(known)} are listed by "
                "`motionlake synthesize --classes`"
            )


def long_enough(row: Mapping[str, Any]) -> bool:
    """Whether frames [start, stop) of a clip are enough to start from, and to learn from."""
    from motionlake.glogen.trajectories import FPS
    from motionlake.glogen.wishes import SHORTEST

    return bool(round((row["stop"] - row["start"] - 1) / row["fps"] * FPS) + 1 >= SHORTEST)


def _nearest(name: str, known: list[str]) -> str:
    """The classes whose names are most like another, in words."""
    folded = {k.casefold(): k for k in reversed(known)}
    near = get_close_matches(name.casefold(), sorted(folded), SHOWN, 0.5)
    return f"closest are {', '.join(folded[k] for k in near)}; " if near else ""
