"""Stage "synth": a generator of new motion, pretrained or made from clips of known class."""

from __future__ import annotations

from difflib import get_close_matches
from typing import TYPE_CHECKING, Final

from motionlake.errors import UserError
from motionlake.lake.catalog import Connection
from motionlake.lake.config import LakeConfig
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model, current_model
from motionlake.stages.generator_model import GENERATOR
from motionlake.stages.reader import LakeReader
from motionlake.stages.stage import Stage

if TYPE_CHECKING:
    from motionlake.motion.generation import MotionGenerator

SHOWN = 3  # classes offered in place of an unknown one


class Synth(Stage):
    """The generator of a lake; it makes no parts."""

    name = "synth"
    about = "a generator of motion, trained on labelled clips or pretrained (then motionlake synthesize)"
    model = GENERATOR
    by_name = True

    def due(self, at: LakeReader) -> int:
        """1 where the lake has a generator, but none for this configuration."""
        return int(current_model(at.con, GENERATOR.name) is not None and GENERATOR.fitting(at) is None)


SYNTH: Final = Synth()


def served_generator(con: Connection, lake: Lake, config: LakeConfig) -> Model:
    """The generator that makes motion.

    Raises:
        UserError: the lake has none, or one that was made for another configuration.
    """
    fitting = GENERATOR.fitting(LakeReader(con, lake, config))
    if fitting is not None:
        return fitting
    other = current_model(con, GENERATOR.name)
    if other is not None:
        raise UserError(
            f"{lake.root}: {other.model} was trained for other values of [synthesis] than config.toml has now, or by "
            "an earlier version; train one for these with `motionlake train synthesis`"
        )
    raise UserError(
        f"{lake.root}: has no generator yet; get one with `motionlake run synth`, trained on clips of known "
        "class or, where there are none, pretrained"
    )


def open_generator(lake: Lake, model: Model) -> MotionGenerator:
    """The generator itself.

    Raises:
        UserError: its file holds something else, or a generator of another skeleton.
    """
    try:
        return GENERATOR.load(sound(lake, model.file))
    except ValueError as error:
        raise UserError(f"{lake.root}: {model.model} makes no motion here: {error}") from error


def class_names(model: Model) -> list[str]:
    """The classes that a generator knows, sorted."""
    return list(model.metrics["class_names"])


def check_classes(model: Model, classes: tuple[str, ...]) -> None:
    """Raises `UserError` for no class, or one that a generator does not know: it names those most like it."""
    known = class_names(model)
    if not classes:
        raise UserError("name one class at least, --class NAME; `motionlake synthesize --classes` lists them")
    unknown = next((name for name in classes if name not in known), None)
    if unknown is not None:
        folded = {k.casefold(): k for k in reversed(known)}
        near = [folded[k] for k in get_close_matches(unknown.casefold(), sorted(folded), SHOWN, 0.5)]
        closest = f"closest are {', '.join(near)}; " if near else ""
        raise UserError(
            f"{unknown}: {model.model} knows no such class; {closest}"
            f"all {len(known)} are listed by `motionlake synthesize --classes`"
        )
