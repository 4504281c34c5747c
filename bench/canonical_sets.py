"""Labelled sets of recordings as canonical motion."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from motionlake.arrays import Float32Array, Float64Array
from motionlake.formats import read_clips
from motionlake.motion.calibration import held, recorded_range
from motionlake.motion.canonicalise import canonicalise
from motionlake.motion.features import WordConfig, word_features
from motionlake.motion.kinematics import solve
from motionlake.motion.rigs import identify, load_rigs

from bench.record import recordings

Row = dict[str, str]


@dataclass(frozen=True)
class LabelledClip:
    """A clip with its class; positions [F, 21, 3], rotations [F, 21, 4] local."""

    positions: Float64Array
    rotations: Float64Array
    fps: float
    label: str
    subject: str
    split: str = ""
    name: str = ""
    rest_offsets: Float64Array | None = None  # [21, 3] metres, of the canonical rest pose


@dataclass(frozen=True)
class LabelledSet:
    """Which clips of a folder, and the column that labels them."""

    folder: str
    label: str
    chosen: Callable[[Row], bool] = lambda row: True


SETS: Final = {
    "hdm05": LabelledSet("hdm05", "label"),
    "salsa": LabelledSet("cmu_dance", "subject", lambda row: row["label"] == "salsa"),
    "bandai1": LabelledSet("bandai1", "label"),
    "utd_mhad": LabelledSet("utd_mhad", "label"),
}


def load(name: str) -> list[LabelledClip]:
    """Every labelled clip of a set, canonical, in the order of its labels file, without calibration poses (as a lake
    derives from its frames)."""
    return [_recorded(clip) for clip in read(SETS[name])]


def _recorded(clip: LabelledClip) -> LabelledClip:
    kept = recorded_range(clip.positions, clip.fps)
    return replace(clip, positions=held(clip.positions, kept), rotations=held(clip.rotations, kept))


def read(chosen: LabelledSet) -> list[LabelledClip]:
    """Every clip of a set, canonical, in the order of its labels file."""
    folder = recordings() / chosen.folder
    rigs = load_rigs()
    with (folder / "labels.csv").open(newline="", encoding="utf-8") as handle:
        rows = [row for row in csv.DictReader(handle) if chosen.chosen(row)]
    clips = []
    for row in rows:
        clip = read_clips(folder / row["file"])[0]
        motion = canonicalise(clip, solve(clip), identify(clip.hierarchy.joints, rigs))
        subject = row.get("subject") or ""
        split = row.get("split") or ""
        clips.append(
            LabelledClip(
                motion.positions, motion.rotations, motion.fps, row[chosen.label], subject, split,
                Path(row["file"]).stem, motion.rest_offsets,
            )
        )  # fmt: skip
    return clips


def features(clips: list[LabelledClip], config: WordConfig) -> list[Float32Array]:
    """`word_features` of each clip."""
    return [word_features(clip.positions, clip.rotations, clip.fps, config) for clip in clips]
