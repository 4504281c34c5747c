"""Labelled sets of recordings as lakes, and how far their clips are from one another by every method of search."""

from __future__ import annotations

import csv
import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from unittest import mock

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.errors import UserError
from motionlake.evaluation.ranking import Questions, SearchScores, score_search
from motionlake.jobs.run import run
from motionlake.jobs.session import session
from motionlake.lake.catalog import reading
from motionlake.lake.layout import Lake
from motionlake.motion import moves
from motionlake.motion.dtw import dtw_matrix
from motionlake.motion.moves import DISPLACEMENT_COUNT
from motionlake.retrieval.fused import EVERY
from motionlake.retrieval.protocol import Query, Scope
from motionlake.retrieval.registry import searcher
from motionlake.stages.moves import read_tracks
from motionlake.stages.registry import ALL

from bench.canonical_sets import SETS, LabelledSet
from bench.lakes import make_lake
from bench.record import recordings, revision

METHODS: Final = ("signature", "alignment", "moves", "descriptor")
SEEDED: Final = "signature"  # the one that another seed of motifs changes
WINDOWS: Final = "windows"
DISPLACEMENTS: Final = (0.2, 0.3, 0.5)  # what displacement counts in moves, beside velocity
# Two more that no bar names, of other kinds of motion: a lake as small as people begin with, and long walks.
TASKS: Final = {
    **SETS, "dance": LabelledSet("cmu_dance", "label"), "cmu_bvh": LabelledSet("cmu_bvh", "description")
}  # fmt: skip
_SUBMOTIONS: Final = "SELECT clip, descriptor FROM submotions ORDER BY clip, start"


@dataclass(frozen=True)
class Measured:
    """A lake: distances [n, n] between its clips by each method, infinite where it cannot compare them; which of these
    are measured, with their classes and subjects."""

    distances: Mapping[str, Float64Array]
    rows: Int64Array
    labels: list[str]
    subjects: list[str | None]

    @property
    def clips(self) -> int:
        return len(self.distances["moves"])

    def write(self, path: Path) -> None:
        """Keep it in a file (`read`)."""
        said = json.dumps({"methods": list(self.distances), "labels": self.labels, "subjects": self.subjects})
        arrays: dict[str, Any] = {f"of_{number}": far for number, far in enumerate(self.distances.values())}
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez(path, rows=self.rows, said=np.array(said), **arrays)

    @staticmethod
    def read(path: Path) -> Measured:
        with np.load(path, allow_pickle=False) as arrays:
            said = json.loads(str(arrays["said"]))
            distances = {name: arrays[f"of_{number}"] for number, name in enumerate(said["methods"])}
            return Measured(distances, arrays["rows"], said["labels"], said["subjects"])

    def scores(self, near: Float64Array) -> SearchScores:
        """Of how near [n, n] clips are."""
        same = ~np.eye(len(self.rows), dtype=np.bool_)
        questions = Questions.of(self.labels, self.labels, same)
        return score_search(-near[np.ix_(self.rows, self.rows)], questions, self.subjects, self.subjects)


def kept(keep: Path | None, name: str, seeds: Sequence[int]) -> list[Measured]:
    """A set as a lake for each seed of its motifs (`measured`); what this very code has left in a folder is taken."""
    files = [] if keep is None else [keep / f"{name}-{seed}-{revision()}.npz" for seed in seeds]
    if files and all(path.is_file() for path in files):
        return [Measured.read(path) for path in files]
    with tempfile.TemporaryDirectory(prefix="bench-lakes-") as folder:
        lakes = list(measured(Path(folder), name, seeds))
    for path, one in zip(files, lakes, strict=False):
        one.write(path)
    return lakes


def measured(folder: Path, name: str, seeds: Sequence[int]) -> Iterator[Measured]:
    """A set as a lake with every stage, and the distances of its clips, for each seed of its motifs.

    Beside the methods of search stand dynamic time warping of the joints that moves see ("dtw"), late interaction of
    the windows that stage `submotions` keeps ("windows"), and moves in which displacement counts more or less
    (`counting`).
    """
    chosen = TASKS[name]
    lake = make_lake(folder, [recordings() / chosen.folder])
    fixed: dict[str, Float64Array] = {}
    for seed in seeds:
        _bring_up(lake, seed)
        with reading(lake) as con:
            every = [row[0] for row in con.execute("SELECT clip FROM clips ORDER BY clip").fetchall()]
        if not fixed:
            fixed = {method: _distances(lake, method, every) for method in METHODS if method != SEEDED}
            fixed |= {"dtw": _of_joints(lake, every), WINDOWS: _of_windows(lake, every)}
            for count in DISPLACEMENTS:
                with mock.patch.object(moves, "DISPLACEMENT_COUNT", count):
                    same = count == DISPLACEMENT_COUNT
                    fixed[counting(count)] = fixed["moves"] if same else _distances(lake, "moves", every)
        labels, subjects = labels_of(chosen)
        rows = [row for row, clip in enumerate(every) if clip in labels]
        known = [subjects.get(every[row]) if name != "salsa" else None for row in rows]
        found = {SEEDED: _distances(lake, SEEDED, every), **fixed}
        yield Measured(found, np.array(rows), [labels[every[row]] for row in rows], known)


def counting(displacement: float) -> str:
    """The name of moves in which displacement counts so much."""
    return f"moves, displacement {displacement:g}"


def _bring_up(lake: Lake, seed: int) -> None:
    lake.config_file.write_text(f"[motifs]\nseed = {seed}\n", encoding="utf-8")
    with session(lake, "bench", lambda stage, done, total: None, lambda line: None) as job:
        run(job, tuple(stage for stage in ALL if stage not in ("frames", "mirrored", "graph")))


def labels_of(chosen: LabelledSet) -> tuple[dict[str, str], dict[str, str]]:
    """Class and subject by clip of the lake; of a description what stands before a stroke ("walk/stride")."""
    with (recordings() / chosen.folder / "labels.csv").open(newline="", encoding="utf-8") as handle:
        rows = [row for row in csv.DictReader(handle) if chosen.chosen(row) and row[chosen.label]]
    clips = {f"{chosen.folder}/{row['file']}": row for row in rows}
    subjects = {clip: row["subject"] for clip, row in clips.items() if row.get("subject")}
    return {clip: row[chosen.label].split("/")[0] for clip, row in clips.items()}, subjects


def _distances(lake: Lake, method: str, clips: Sequence[str]) -> Float64Array:
    places = {clip: place for place, clip in enumerate(clips)}
    found, by = np.full((len(clips), len(clips)), np.inf), searcher("clip", method, lake)
    for row, clip in zip(found, clips, strict=True):
        try:
            (hits,) = by.search([Query(clip)], EVERY, Scope())
        except UserError:  # a posture that is held is no string
            continue
        for hit in hits:
            row[places[hit.clip]] = hit.distance
    return found


def _of_joints(lake: Lake, clips: Sequence[str]) -> Float64Array:
    with reading(lake) as con:
        parts = dict(con.execute("SELECT clip, part FROM clips").fetchall())
        tracks = read_tracks(lake, parts)
    return dtw_matrix([tracks[clip].turned().joints.astype(np.float32) for clip in clips])


def _of_windows(lake: Lake, clips: Sequence[str]) -> Float64Array:
    """Late interaction: each window of one clip with the nearest of the other, the mean of both ways."""
    with reading(lake) as con:
        rows = con.execute(_SUBMOTIONS).fetchall()
    vectors: dict[str, list[Float32Array]] = {}
    for clip, vector in rows:
        vectors.setdefault(clip, []).append(np.asarray(vector, np.float32))
    of_clips = [np.stack(vectors[clip]) for clip in clips]
    found = np.zeros((len(clips), len(clips)))
    for i, one in enumerate(of_clips):
        for j, other in enumerate(of_clips[:i]):
            apart = np.sqrt(np.maximum(2 - 2 * one @ other.T, 0.0))  # they have length one
            found[i, j] = found[j, i] = (apart.min(axis=1).mean() + apart.min(axis=0).mean()) / 2
    return found
