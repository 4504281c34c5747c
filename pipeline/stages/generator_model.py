"""The generator of motion, made from the clips of known class of a lake (networks or motion matching) or pretrained."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar, cast

import numpy as np
from motionlake.arrays import Progress
from motionlake.errors import UserError
from motionlake.glogen.config import MATCHING, NETWORKS, PRETRAINED_GENERATOR, SynthesisConfig
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.config import LakeConfig, config_hash
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model
from motionlake.matching import DATABASE_VERSION
from motionlake.motion.generation import FPS, SHORTEST
from motionlake.stages.frames import clips_key
from motionlake.stages.model_kind import CHOSEN, ModelKind, Selection
from motionlake.stages.reader import LakeReader
from motionlake.stages.training_clips import chosen_clips, drawn_clips, frames_of_clips
from motionlake.weights import holds

if TYPE_CHECKING:
    from motionlake.glogen.generator import TrainedGenerator, TrainingMotion
    from motionlake.lake.frames import Frames
    from motionlake.matching.generator import MatchingGenerator
    from motionlake.matching.recordings import MatchingClip

M = TypeVar("M")
SHARED: Final = 3  # minutes of training that classes share, beside about a minute for each
# Of more frames than these, motions are drawn at random: a GiB of positions.
MOST_FRAMES = 2_000_000


@dataclass(frozen=True)
class MotionSet:
    """Motions of known class in order of their clips and frames, and what a generator's metrics tell of them."""

    motions: list[TrainingMotion] | list[MatchingClip]
    metrics: Mapping[str, Any]


def motion_set(
    con: Connection,
    lake: Lake,
    config: SynthesisConfig,
    split: str | None = None,
    dataset: str | None = None,
    min_quality: str | None = None,
) -> MotionSet | None:
    """The motions to train on: recorded clips with a label, and the labelled ranges of those without; None in a lake
    without clips.

    Args:
        con: to the lake.
        lake: whose frames are read.
        config: its seed draws where there are too many frames.
        split: as the column `split` of labels.csv has it; None takes every clip.
        dataset: None takes all.
        min_quality: the worst verdict that a clip may have; None takes any.

    Raises:
        UserError: there is no such dataset or split, nothing in it has a label, or all that has is too short.
    """
    rows = chosen_clips(con, lake, split, dataset, "classed_motions", min_quality=min_quality)
    if not rows:
        _refuse_unlabelled(con, lake, split, dataset)
        return None
    long = [row for row in rows if long_enough(row)]
    if not long:
        raise UserError(f"{lake.root}: the {len(rows)} motions of known class are too short to train on")
    drawn = drawn_clips(long, [row["stop"] - row["start"] for row in long], config.seed, MOST_FRAMES)
    recipe = config.resolved(labelled=True).recipe
    metrics = {
        "recipe": recipe,
        "split": split,
        "dataset": dataset,
        **({} if min_quality is None else {"min_quality": min_quality}),
        "datasets": sorted({row["dataset"] for row in drawn}),
        "licences": sorted({row["licence"] for row in drawn if row["licence"]}),
        "filled": sorted({joint for row in drawn for joint in row["filled"]}),
        "motions_there": len(rows),
        "data_sha256": clips_key([(_name(row), row["content_hash"]) for row in drawn]),
    }
    return MotionSet(_matching_clips(lake, drawn) if recipe == MATCHING else _motions(lake, drawn), metrics)


def _refuse_unlabelled(con: Connection, lake: Lake, split: str | None, dataset: str | None) -> None:
    clips = fetch(con, "training_clips", {"split": split, "dataset": dataset})
    if clips:
        raise UserError(
            f"{lake.root}: none of the {len(clips)} clips to train on has a label, and a generator learns motion by "
            "class; label them in labels.csv, or ranges of them in segments.csv"
        )


def _name(row: Mapping[str, Any]) -> str:
    return f"{row['clip']}[{row['start']}:{row['stop']}] {row['label']}"


def _motions(lake: Lake, rows: Sequence[Mapping[str, Any]]) -> list[TrainingMotion]:
    from motionlake.glogen.generator import TrainingMotion

    def motion(clip: Frames, row: Mapping[str, Any]) -> TrainingMotion:
        return TrainingMotion(clip.positions[row["start"] : row["stop"]].astype(float), clip.fps, row["label"])

    return _of_rows(lake, rows, motion)


def _matching_clips(lake: Lake, rows: Sequence[Mapping[str, Any]]) -> list[MatchingClip]:
    from motionlake.matching.recordings import MatchingClip

    def motion(clip: Frames, row: Mapping[str, Any]) -> MatchingClip:
        positions, rotations = (rows[row["start"] : row["stop"]] for rows in (clip.positions, clip.rotations))
        offsets = np.array(row["rest_offsets"], dtype=float).reshape(-1, 3)
        return MatchingClip(
            clip.clip, row["start"], row["label"], positions.astype(float), rotations.astype(float), offsets, clip.fps
        )

    return _of_rows(lake, rows, motion)


def _of_rows(lake: Lake, rows: Sequence[Mapping[str, Any]], make: Callable[[Frames, Mapping[str, Any]], M]) -> list[M]:
    """What is made of the frames of each row's clip, in their order; each clip is read once."""
    wanted: dict[str, list[int]] = {}
    for index, row in enumerate(rows):
        wanted.setdefault(row["clip"], []).append(index)
    found: dict[int, M] = {}
    for clip in frames_of_clips(lake, rows):
        for index in wanted[clip.clip]:
            found[index] = make(clip, rows[index])
    return [found[index] for index in range(len(rows))]


def classed_motions(con: Connection, split: str | None = None, label: str | None = None) -> list[dict[str, Any]]:
    """Recorded motion of known class: of a split, of a class; of any where these are None."""
    return fetch(con, "classed_motions", {"dataset": None, "split": split, "label": label})


def labelled_counts(con: Connection) -> dict[str, int]:
    """How many recorded clips and ranges, long enough to start from and to learn from, are of each class."""
    return {row["label"]: row["motions"] for row in labelled_rows(con)}


def labelled_rows(con: Connection) -> list[dict[str, Any]]:
    """The same with the usual seconds of each."""
    return fetch(con, "labelled_counts", {"fps": FPS, "shortest": SHORTEST})


def recipe_of(model: Model) -> str:
    """The recipe that a generator was made by; models that do not say so are of earlier versions."""
    return str(model.metrics.get("recipe") or (MATCHING if "speeds" in model.metrics else NETWORKS))


def long_enough(row: Mapping[str, Any]) -> bool:
    """Whether frames [start, stop) of a clip are enough to start from, and to learn from."""
    return bool(round((row["stop"] - row["start"] - 1) / row["fps"] * FPS) + 1 >= SHORTEST)


class GeneratorModel(ModelKind[MotionSet]):
    """What makes motion of known classes."""

    name = "synthesis"
    version = 6  # 6: a network predicts the onset beside kernels
    config = SynthesisConfig
    title = "generator"
    use = "makes motion"
    command = "synthesis"
    help = """Train the generator that config.toml names; `motionlake synthesize` then makes motion with it.

    It learns from clips with a label, and from the labelled ranges of those without. [synthesis] in config.toml says by
    which recipe and from which seed: "auto" and "matching" play recorded frames, which takes seconds; "networks" and
    "glogen" train networks, which takes minutes. Interrupted, the same command goes on where it stopped.

    Example: motionlake train synthesis --split train --lake mylake
    """
    said = (
        "trained on {clips} motions of {classes} classes; make motion with it: "
        "motionlake synthesize --class NAME --lake {lake}"
    )
    options = CHOSEN
    pretrained = PRETRAINED_GENERATOR
    kept = ("clips", "class_names", "datasets", "licences", "filled", "split", "dataset")

    def key(self, at: LakeReader) -> str:
        return self.keyed(at.config.synthesis.resolved(bool(self._counts(at))))

    def keyed(self, config: SynthesisConfig) -> str:
        """The key of a generator of a recipe."""
        made_as = [DATABASE_VERSION] if config.recipe == MATCHING else []
        return config_hash(self.name, self.version, config.kept(), *made_as)

    def _counts(self, at: LakeReader) -> dict[str, int]:
        return at.once("labelled", self.name, lambda: labelled_counts(at.con))

    def takes_pretrained(self, at: LakeReader) -> bool:
        if not self.fits(at.config):
            return False
        return at.config.synthesis.weights == "pretrained" or not self._counts(at)

    def announce(self, at: LakeReader) -> str:
        counts = self._counts(at)
        config = at.config.synthesis.resolved(bool(counts))
        other = '; to take the pretrained one: [synthesis] weights = "pretrained" in config.toml'
        why = f", since the lake has {sum(counts.values())} labelled clips or ranges" + other * self._could_take(config)
        takes = self._takes(config, len(counts))
        return f"will train a generator of motion ({config.recipe}){takes}{why if counts else ''}"

    def _takes(self, config: SynthesisConfig, classes: int) -> str:
        """How long training takes, about."""
        if config.recipe == MATCHING:
            return ", which takes seconds"
        if not classes or config.epochs:
            return ""
        return f', which takes up to {classes + SHARED} minutes on one core (recipe = "{MATCHING}" takes seconds)'

    def _could_take(self, config: SynthesisConfig) -> bool:
        return self.pretrained.fits(replace(config, weights="pretrained"))

    def data(self, at: LakeReader, where: Selection) -> MotionSet | None:
        return motion_set(at.con, at.lake, at.config.synthesis, where.split, where.dataset, where.min_quality)

    def fit(
        self, lake: Lake, config: LakeConfig, data: MotionSet, checkpoint: Path, progress: Progress
    ) -> TrainedGenerator | MatchingGenerator:
        if data.metrics["recipe"] == MATCHING:
            return self._matching(config.synthesis, cast("list[MatchingClip]", data.motions), data.metrics)
        from motionlake.glogen.generator_training import train_generator

        trained = train_generator(
            cast("list[TrainingMotion]", data.motions),
            config.synthesis.resolved(labelled=True),
            checkpoint=checkpoint,
            progress=progress,
        )
        return replace(trained, metrics={**data.metrics, **trained.metrics, "class_names": sorted(trained.classes)})

    def _matching(
        self, config: SynthesisConfig, clips: list[MatchingClip], metrics: Mapping[str, Any]
    ) -> MatchingGenerator:
        from motionlake.matching.building import build_database
        from motionlake.matching.generator import MatchingGenerator

        database = build_database(clips, config.seed)
        return MatchingGenerator(
            replace(database, metrics={**metrics, **database.metrics, "class_names": database.classes})
        )

    def load(self, path: Path) -> TrainedGenerator | MatchingGenerator:
        from motionlake.matching.database import METADATA_KEY

        if holds(path, METADATA_KEY):
            from motionlake.matching.generator import load_generator as load_matching

            return load_matching(path)
        from motionlake.glogen.generator import load_generator

        return load_generator(path)


GENERATOR: Final = GeneratorModel()
