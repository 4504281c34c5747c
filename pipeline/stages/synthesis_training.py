"""Training a generator of motion on the clips of known class of a lake, all or those of a dataset or of a split."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from motionlake.arrays import Progress
from motionlake.errors import UserError
from motionlake.glogen.config import SynthesisConfig
from motionlake.glogen.generator import TrainingMotion
from motionlake.glogen.generator_training import train_generator
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.lake.models import checkpoint_file, save_model
from motionlake.stages.frames import clips_key
from motionlake.stages.synthesis import long_enough
from motionlake.stages.training_clips import chosen_clips, drawn_clips, frames_of_clips

# Of more frames than these, motions are drawn at random: a GiB of positions.
MOST_FRAMES = 2_000_000


@dataclass(frozen=True)
class MotionSet:
    """Motions of known class in order of their clips and frames, and what a generator's figures tell of them."""

    motions: list[TrainingMotion]
    figures: Mapping[str, Any]


def motion_set(
    con: Connection, lake: Lake, config: SynthesisConfig, split: str | None = None, dataset: str | None = None
) -> MotionSet | None:
    """The motions to train on: recorded clips with a label, and the labelled ranges of those without; None in a lake
    without clips.

    Args:
        con: to the lake.
        lake: whose frames are read.
        config: its seed draws where there are too many frames.
        split: as the column `split` of labels.csv has it; None takes every clip.
        dataset: None takes all.

    Raises:
        UserError: there is no such dataset or split, nothing in it has a label, or all that has is too short.
    """
    rows = chosen_clips(con, lake, split, dataset, "classed_motions")
    if not rows:
        _refuse_unlabelled(con, lake, split, dataset)
        return None
    long = [row for row in rows if long_enough(row)]
    if not long:
        raise UserError(f"{lake.root}: the {len(rows)} motions of known class are too short to train on")
    drawn = drawn_clips(long, [row["stop"] - row["start"] for row in long], config.seed, MOST_FRAMES)
    figures = {
        "split": split,
        "dataset": dataset,
        "datasets": sorted({row["dataset"] for row in drawn}),
        "licences": sorted({row["licence"] for row in drawn if row["licence"]}),
        "filled": sorted({joint for row in drawn for joint in row["filled"]}),
        "motions_there": len(rows),
        "data_sha256": clips_key([(_name(row), row["content_hash"]) for row in drawn]),
    }
    return MotionSet(_motions(lake, drawn), figures)


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
    wanted: dict[str, list[int]] = {}
    for index, row in enumerate(rows):
        wanted.setdefault(row["clip"], []).append(index)
    found: dict[int, TrainingMotion] = {}
    for clip in frames_of_clips(lake, rows):
        for index in wanted[clip.clip]:
            row = rows[index]
            positions = clip.positions[row["start"] : row["stop"]].astype(float)
            found[index] = TrainingMotion(positions, clip.fps, row["label"])
    return [found[index] for index in range(len(rows))]


def train(
    lake: Lake, material: MotionSet, config: SynthesisConfig, file: str, progress: Progress | None = None
) -> dict[str, Any]:
    """Train a generator, save it as `file`; returns its figures.

    A training that was interrupted goes on from its checkpoint in the lake.

    Raises:
        UserError: the motions are too few or too short.
    """
    checkpoint = checkpoint_file(lake, "synthesis")
    try:
        trained = train_generator(material.motions, config, checkpoint=checkpoint, progress=progress)
    except ValueError as error:
        raise UserError(f"{lake.root}: no generator can be trained: {error}") from error
    figures = {**material.figures, **trained.figures, "class_names": sorted(trained.classes)}
    save_model(lake, file, replace(trained, figures=figures).save)
    return figures
