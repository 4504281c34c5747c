"""Stage "synth": a generator of new motion, pretrained or made of clips of known class; and which makes what."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TYPE_CHECKING, Final, NoReturn

from motionlake.errors import UserError
from motionlake.glogen.config import AUTO, MATCHING, NETWORKS, PRETRAINED_GENERATOR, SynthesisConfig
from motionlake.lake.catalog import Connection
from motionlake.lake.config import LakeConfig
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model, current_model, file_hash, keyed_model
from motionlake.stages.generator_model import GENERATOR, labelled_counts, recipe_of
from motionlake.stages.reader import LakeReader
from motionlake.stages.stage import Stage

if TYPE_CHECKING:
    from motionlake.motion.generation import MotionGenerator

SHOWN = 3  # classes offered in place of an unknown one
OF_PACKAGE: Final = "pretrained"  # name of the networks that come with the package, where the lake has no copy of them


class Synth(Stage):
    """The generator of a lake; it makes no parts."""

    name = "synth"
    about = "a generator of motion, made of labelled clips or pretrained (then motionlake synthesize)"
    model = GENERATOR
    by_name = True

    def due(self, at: LakeReader) -> int:
        """1 where the lake has a generator, but none for this configuration and its labels."""
        return int(current_model(at.con, GENERATOR.name) is not None and GENERATOR.fitting(at) is None)


SYNTH: Final = Synth()


@dataclass(frozen=True)
class Chosen:
    """The generator that makes a request, by which recipe, and why this one."""

    model: Model
    recipe: str
    why: str

    @property
    def said(self) -> str:
        """One line for people."""
        title = {MATCHING: "motion matching", NETWORKS: "networks"}.get(self.recipe, self.recipe)
        return f"by {title} ({self.model.model}), {self.why}"


def served_generator(con: Connection, lake: Lake, config: LakeConfig) -> Model:
    """The generator that `run synth` has got for this configuration.

    Raises:
        UserError: the lake has none, or one that was made for another configuration.
    """
    fitting = GENERATOR.fitting(LakeReader(con, lake, config))
    if fitting is not None:
        return fitting
    other = current_model(con, GENERATOR.name)
    if other is None:
        raise UserError(
            f"{lake.root}: has no generator yet; get one with `motionlake run synth`, made of clips of known class or, "
            "where there are none, pretrained"
        )
    wanted = config.synthesis.resolved(bool(labelled_counts(con))).recipe
    if config.synthesis.recipe == AUTO and wanted == MATCHING != recipe_of(other):
        raise UserError(
            f"{lake.root}: {other.model} is of networks, and recordings of the lake are labelled, which motion "
            "matching plays: get it with `motionlake run synth`, which takes seconds, or keep to networks with "
            f'[synthesis] recipe = "{NETWORKS}" in config.toml'
        )
    raise UserError(
        f"{lake.root}: {other.model} was made for other values of [synthesis] than config.toml has now, for other "
        "labels or by an earlier version; make one for these with `motionlake train synthesis`"
    )


def generators(con: Connection, lake: Lake, config: LakeConfig) -> Iterator[Model]:
    """What may make motion, the first that knows the classes asked for: what serves, then with recipe "auto" networks
    that the lake trained before, then those of the package.

    Raises:
        UserError: as `served_generator`.
    """
    first = served_generator(con, lake, config)
    yield first
    if config.synthesis.recipe != AUTO or recipe_of(first) != MATCHING:
        return
    trained = keyed_model(con, GENERATOR.name, GENERATOR.keyed(config.synthesis.networks()))
    if trained is not None and lake.path(trained.file).exists():
        yield trained
    if PRETRAINED_GENERATOR.fits(config.synthesis):
        yield _of_package()


def chosen_generator(con: Connection, lake: Lake, config: LakeConfig, classes: Sequence[str]) -> Chosen:
    """The generator that makes motion of some classes.

    Raises:
        UserError: none knows them all, or as `served_generator`.
    """
    found = list(generators(con, lake, config))
    first, settings = found[0], config.synthesis
    counts = labelled_counts(con) if settings.recipe == AUTO and recipe_of(first) == MATCHING else {}
    late = next((name for name in classes if name in counts and name not in class_names(first)), None)
    if late is not None:
        raise UserError(
            f"{late}: {first.model} was made without the {counts[late]} recordings that are labelled so; make one of "
            "all that are labelled now with `motionlake train synthesis`"
        )
    model = next((model for model in found if set(classes) <= set(class_names(model))), None)
    if model is None:
        _refuse(found, classes)
    assert model is not None, "a class that none knows is refused"
    return Chosen(model, recipe_of(model), _why(settings, recipe_of(model), classes, counts))


def _why(config: SynthesisConfig, recipe: str, classes: Sequence[str], counts: dict[str, int]) -> str:
    names = list(dict.fromkeys(classes))
    if config.recipe != AUTO:
        return f'as config.toml says (recipe = "{config.recipe}")'
    if recipe == MATCHING:
        told = ", ".join(f"{counts.get(name, 0)} {name}" for name in names)
        return f"since the lake has recordings that are labelled so ({told})"
    if config.weights == "pretrained":
        return 'as config.toml says (weights = "pretrained")'
    return f"since no recording of the lake is labelled {' or '.join(n for n in names if n not in counts)}"


def _of_package() -> Model:
    """The networks that come with the package."""
    about = PRETRAINED_GENERATOR.about()
    metrics = {"pretrained": True, **{name: about[name] for name in ("data_sha256", *GENERATOR.kept) if name in about}}
    return Model(OF_PACKAGE, GENERATOR.name, about["data_sha256"], "", metrics)


def generator_hash(at: LakeReader, model: Model) -> str:
    """sha256 of a generator's file."""
    return at.file_hash(model.file) if model.file else file_hash(PRETRAINED_GENERATOR.file)


def open_generator(lake: Lake, model: Model) -> MotionGenerator:
    """The generator itself.

    Raises:
        UserError: its file holds something else, or a generator of another skeleton.
    """
    try:
        return GENERATOR.load(sound(lake, model.file) if model.file else PRETRAINED_GENERATOR.file)
    except ValueError as error:
        raise UserError(f"{lake.root}: {model.model} makes no motion here: {error}") from error


def class_names(model: Model) -> list[str]:
    """The classes that a generator knows, sorted."""
    return list(model.metrics["class_names"])


def makers(con: Connection, lake: Lake, config: LakeConfig) -> dict[str, Model]:
    """Of every class that can be made, sorted, what makes it."""
    found: dict[str, Model] = {}
    for model in generators(con, lake, config):
        found |= {name: model for name in class_names(model) if name not in found}
    return dict(sorted(found.items()))


def check_classes(model: Model, classes: Sequence[str]) -> None:
    """Raises `UserError` for no class, or one that a generator does not know: it names those most like it."""
    if not classes:
        raise UserError("name one class at least, --class NAME; `motionlake synthesize --classes` lists them")
    if not set(classes) <= set(class_names(model)):
        _refuse([model], classes)


def _refuse(models: Sequence[Model], classes: Sequence[str]) -> NoReturn:
    """Say why none of some generators makes motion of all these classes."""
    known = sorted({name for model in models for name in class_names(model)})
    unknown = next((name for name in classes if name not in known), None)
    if unknown is None:
        wanted = list(dict.fromkeys(classes))
        own = {model.model: [name for name in wanted if name in class_names(model)] for model in models}
        told = "; ".join(f"{model} knows {', '.join(names)}" for model, names in own.items() if names)
        raise UserError(
            f"{', '.join(wanted)}: no generator knows them all ({told}); make them one by one, or label recordings of "
            "each, then `motionlake train synthesis`"
        )
    folded = {k.casefold(): k for k in reversed(known)}
    near = [folded[k] for k in get_close_matches(unknown.casefold(), sorted(folded), SHOWN, 0.5)]
    closest = f"closest are {', '.join(near)}; " if near else ""
    names = " and ".join(model.model for model in models)
    raise UserError(
        f"{unknown}: {names} know{'s' * (len(models) == 1)} no such class; {closest}"
        f"all {len(known)} are listed by `motionlake synthesize --classes`"
    )
