"""Recordings as canonical clips, postures of them, and the segments of their frames."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Final

from motionlake.arrays import Float32Array
from motionlake.formats import read_clips
from motionlake.motion.canonicalise import canonicalise
from motionlake.motion.features import WordConfig
from motionlake.motion.kinematics import solve
from motionlake.motion.rigs import identify, load_rigs

from bench.canonical_sets import SETS, LabelledClip, features, load
from bench.record import hash_files, recordings

# Sets with segments in the place of one label a clip: how their clips end.
TAKES: Final = {"cmu_exercises": "*.amc", "cmu_bvh": "*.bvh"}
Segments = tuple[tuple[int, int, str], ...]


@cache
def clips_of(name: str) -> list[LabelledClip]:
    """The clips of a set; those of `TAKES`, by file name, have no label."""
    return load(name) if name in SETS else [_take(path) for path in take_files(name)]


def _take(path: Path) -> LabelledClip:
    clip = read_clips(path)[0]
    motion = canonicalise(clip, solve(clip), identify(clip.hierarchy.joints, load_rigs()))
    return LabelledClip(motion.positions, motion.rotations, motion.fps, "", "")


def take_files(name: str) -> list[Path]:
    """The clips of a set of `TAKES`, by file name."""
    return sorted((recordings() / name / "clips").rglob(TAKES[name]))


@cache
def segments_of(name: str) -> list[Segments]:
    """(start, stop, label) of each clip of a set of `TAKES`, in their order."""
    folder = recordings() / name
    with (folder / "segments.csv").open(newline="", encoding="utf-8") as handle:
        rows = list(csv.DictReader(handle))
    return [
        tuple(
            (int(row["start"]), int(row["stop"]), row["label"])
            for row in rows
            if row["file"] == path.relative_to(folder).as_posix()
        )
        for path in take_files(name)
    ]


@cache
def postures_of(name: str, config: WordConfig) -> list[Float32Array]:
    """Features of every clip of a set."""
    return features(clips_of(name), config)


def labels_of(name: str) -> list[str]:
    """The label of each clip of a set."""
    return [clip.label for clip in clips_of(name)]


def hash_sets(names: Sequence[str]) -> str:
    """Of all files of some sets."""
    folders = [recordings() / (SETS[name].folder if name in SETS else name) for name in names]
    return hash_files([p for folder in folders for p in folder.rglob("*") if p.is_file()], recordings())
