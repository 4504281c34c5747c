"""Constants of the default search, chosen with one set of recordings left out in turn: `python -m bench.generalise`.

Every set becomes a lake with the default configuration and a seed of its motifs. Each labelled clip is searched for
among all others. For every set the constants are those with the greatest mean average precision, mean over the seeds of
the other sets; what they reach on the set itself is what to expect of recordings that nobody tuned on. Beside
them stand each method, alone and along the graph, all of them without a graph, and dynamic time warping of the joints
that moves see.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Final
from unittest import mock

import numpy as np
from motionlake.arrays import Float64Array, Int64Array
from motionlake.errors import UserError
from motionlake.evaluation.ranking import Questions, SearchScores, score_search
from motionlake.jobs.run import run
from motionlake.jobs.session import session
from motionlake.lake.catalog import reading
from motionlake.lake.config import load_config
from motionlake.lake.layout import Lake
from motionlake.motion import diffusion
from motionlake.motion.diffusion import NeighbourGraph, diffused, scale
from motionlake.motion.dtw import dtw_matrix
from motionlake.retrieval.fused import DIRECT, EVERY, REACH, WEIGHTS
from motionlake.retrieval.protocol import Query, Scope
from motionlake.retrieval.registry import searcher
from motionlake.retrieval.views import TURNS, View, near_again
from motionlake.stages.graph import KEPT
from motionlake.stages.moves import read_tracks
from motionlake.stages.reader import LakeReader
from motionlake.stages.registry import ALL

from bench.canonical_sets import SETS, LabelledSet
from bench.lakes import make_lake
from bench.record import hash_files, record, recordings

SEEDS: Final = (0, 1, 2)
METHODS: Final = ("signature", "alignment", "moves", "descriptor")
# How much each of them counts.
SHARES: Final = ((1, 1, 4, 2), (2, 1, 4, 2), (1, 1, 2, 1), (1, 1, 2, 2))
RECIPROCALS: Final = (16, 24)
DIRECTS: Final = (0.1, 0.3, 1.0)
TURNS_TRIED: Final = (0, 1, 2)
# Two more that no bar names, of other kinds of motion: a lake as small as people begin with, and long walks.
TASKS: Final = {
    **SETS, "dance": LabelledSet("cmu_dance", "label"), "cmu_bvh": LabelledSet("cmu_bvh", "description")
}  # fmt: skip


@dataclass(frozen=True)
class Constants:
    """Of the default search.

    Attributes:
        reciprocal: `diffusion.RECIPROCAL`.
        direct: `fused.DIRECT`.
        turns: `views.TURNS`; 0 leaves the way by all methods out.
        shares: what each method counts.
    """

    reciprocal: int
    direct: float
    turns: int
    shares: tuple[float, ...]


NOW: Final = Constants(diffusion.RECIPROCAL, DIRECT, TURNS, tuple(WEIGHTS.get(method, 0.0) for method in METHODS))


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

    def scores(self, near: Float64Array) -> SearchScores:
        """Of how near [n, n] clips are."""
        same = ~np.eye(len(self.rows), dtype=np.bool_)
        questions = Questions.of(self.labels, self.labels, same)
        return score_search(-near[np.ix_(self.rows, self.rows)], questions, self.subjects, self.subjects)


def every_constants() -> Iterator[Constants]:
    return itertools.starmap(Constants, itertools.product(RECIPROCALS, DIRECTS, TURNS_TRIED, SHARES))


def measured(folder: Path, name: str, seed: int) -> Measured:
    """A set as a lake with every stage, and the distances of its clips."""
    chosen = TASKS[name]
    lake = make_lake(folder, [recordings() / chosen.folder])
    lake.config_file.write_text(f"[motifs]\nseed = {seed}\n", encoding="utf-8")
    with session(lake, "bench", lambda stage, done, total: None, lambda line: None) as job:
        run(job, tuple(stage for stage in ALL if stage not in ("submotions", "graph")))
    with reading(lake) as con:
        every = [row[0] for row in con.execute("SELECT clip FROM clips ORDER BY clip").fetchall()]
        tracks = read_tracks(
            LakeReader(con, lake, load_config(lake.config_file)),
            dict(con.execute("SELECT clip, part FROM clips").fetchall()),
        )
    found = {method: _distances(lake, method, every) for method in METHODS}
    found["dtw"] = dtw_matrix([tracks[clip].turned().joints.astype(np.float32) for clip in every])
    labels, subjects = labels_of(chosen)
    rows = [row for row, clip in enumerate(every) if clip in labels]
    known = [subjects.get(every[row]) if name != "salsa" else None for row in rows]
    return Measured(found, np.array(rows), [labels[every[row]] for row in rows], known)


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


@dataclass(frozen=True)
class Near:
    """Of all clips [n, n], by one method or by several."""

    direct: Float64Array
    along: Float64Array


def views(one: Measured, reciprocal: int) -> list[dict[str, View[int]]]:
    """What each method makes of each clip, as the default search does."""
    with mock.patch.object(diffusion, "RECIPROCAL", reciprocal):
        of_each = {method: _views(distances) for method, distances in one.distances.items()}
    return [{method: found[row] for method, found in of_each.items()} for row in range(one.clips)]


def _views(distances: Float64Array) -> list[View[int]]:
    count = len(distances)
    others = [np.flatnonzero(np.arange(count) != row) for row in range(count)]
    order = [clips[np.argsort(distances[row, clips], kind="stable")] for row, clips in enumerate(others)]
    kept = np.stack([clips[:KEPT] for clips in order])
    apart = distances[np.arange(count)[:, None], kept]
    graph = NeighbourGraph(np.where(np.isfinite(apart), kept, -1), apart, count)
    found = []
    for row, clips in enumerate(order):
        there = clips[np.isfinite(distances[row, clips])]
        near = 1 / (1 + distances[row, there] / scale(distances[row, there]))
        nodes = there[:REACH]
        ways = diffused(graph, nodes, distances[row, nodes], row) if len(nodes) else None
        found.append(View(there.tolist(), distances[row, there], near, ways))
    return found


def near_of(one: Measured, rows: Sequence[Mapping[str, View[int]]], shares: Mapping[str, float], turns: int) -> Near:
    """How near clips are by some methods: by distances, and along the graph, with `turns` by all together too."""
    direct, along = np.zeros((2, one.clips, one.clips))
    total = sum(shares.values())
    for row, of_each in enumerate(rows):
        nearest = {}
        for method, share in shares.items():
            view = of_each[method]
            direct[row, list(view.clips)] += share / total * view.near
            if view.ways is not None:
                nodes = list(view.clips[: len(view.ways) - 1])
                along[row, nodes] += share / total * view.ways[-1, :-1]
                nearest[method] = replace(view, clips=nodes)
        if turns:
            again = near_again(nearest, shares, one.clips, turns)
            along[row, list(again)] += list(again.values())
    return Near(direct, along)


def best(scores: Mapping[Constants, Mapping[str, float]], sets: Sequence[str]) -> Constants:
    """The constants with the greatest mean over some sets; of equal ones the first."""
    return max(scores, key=lambda how: float(np.mean([scores[how][name] for name in sets])))


def measure(names: Sequence[str], seeds: Sequence[int]) -> dict[str, object]:
    """Scores of every choice of constants and of each method alone."""
    maps: dict[Constants, dict[str, list[SearchScores]]] = {}
    alone: dict[str, dict[str, list[SearchScores]]] = {}
    for name, seed in itertools.product(names, seeds):
        with tempfile.TemporaryDirectory(prefix="bench-generalise-") as folder:
            one = measured(Path(folder), name, seed)
        for reciprocal in sorted({*RECIPROCALS, NOW.reciprocal}):
            rows = views(one, reciprocal)
            for shares, turns in {(how.shares, how.turns) for how in (NOW, *every_constants())}:
                counted = {method: share for method, share in zip(METHODS, shares, strict=True) if share}
                near = near_of(one, rows, counted, turns)
                for direct in sorted({*DIRECTS, NOW.direct}):
                    how = Constants(reciprocal, direct, turns, shares)
                    scores = one.scores(near.along + direct * near.direct)
                    maps.setdefault(how, {}).setdefault(name, []).append(scores)
            if reciprocal == NOW.reciprocal:
                for method in one.distances:
                    near = near_of(one, rows, {method: 1.0}, turns=0)
                    alone.setdefault(method, {}).setdefault(name, []).append(one.scores(near.direct))
                    scores = one.scores(near.along + NOW.direct * near.direct)
                    alone.setdefault(f"{method}, graph", {}).setdefault(name, []).append(scores)
                counted = {method: share for method, share in zip(METHODS, NOW.shares, strict=True) if share}
                near = near_of(one, rows, counted, turns=0)
                alone.setdefault("all, no graph", {}).setdefault(name, []).append(one.scores(near.direct))
        print(f"{name}, seed {seed}: {_mean(maps[NOW][name])}", flush=True)
    order = {how: {name: _mean(maps[how][name])["map"] for name in names} for how in sorted(maps, key=str)}
    left_out = {}
    for name in names:
        others = [other for other in names if other != name] or [name]
        chosen = best(order, others)
        left_out[name] = {"constants": asdict(chosen), **_mean(maps[chosen][name])}
    return {
        "sets": list(names),
        "seeds": list(seeds),
        "left out": left_out,
        "best on all": {"constants": asdict(best(order, names)), **{n: order[best(order, names)][n] for n in names}},
        "by constants": {str(how): found for how, found in order.items()},
        "now": {"constants": asdict(NOW), **{name: _mean(maps[NOW][name]) for name in names}},
        "alone": {method: {name: _mean(found[name]) for name in names} for method, found in alone.items()},
    }


def _mean(runs: Sequence[SearchScores]) -> dict[str, float]:
    rows = [asdict(each) for each in runs]
    return {key: float(np.mean([row[key] for row in rows])) for key in rows[0] if rows[0][key] is not None}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sets", nargs="*", default=list(TASKS), help="which to measure (default: all)")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(SEEDS))
    given = parser.parse_args()
    figures = measure(given.sets, given.seeds)
    for part in ("left out", "best on all", "now", "alone"):
        print(part, figures[part])
    folders = [recordings() / TASKS[name].folder for name in given.sets]
    files = [path for folder in folders for path in folder.rglob("*") if path.is_file()]
    print(record("generalise", figures, hash_files(files, recordings())))


if __name__ == "__main__":
    main()
