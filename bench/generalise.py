"""Constants of the default search, chosen with one set of recordings left out in turn: `python -m bench.generalise`.

Every set becomes a lake with the default configuration and a seed of its motifs. Each labelled clip is searched for
among all others. For every set the constants are those with the greatest mean average precision, mean over the seeds of
the other sets; what they reach on the set itself is what to expect of recordings that nobody tuned on. The defaults are
the choice of all sets together. Beside them stand each method, alone and along the graph, and dynamic time warping of
the joints that moves see.
"""

from __future__ import annotations

import argparse
import itertools
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, Int64Array
from motionlake.errors import UserError
from motionlake.evaluation.ranking import Questions, SearchScores, score_search
from motionlake.jobs.run import run
from motionlake.jobs.session import session
from motionlake.lake.catalog import reading
from motionlake.lake.config import load_config
from motionlake.lake.layout import Lake
from motionlake.motion.diffusion import JOINED, NeighbourGraph, diffused, joined_of, scale
from motionlake.motion.dtw import dtw_matrix
from motionlake.retrieval.fused import DIRECT, EVERY, REACH, WEIGHTS
from motionlake.retrieval.protocol import Query, Scope
from motionlake.retrieval.registry import searcher
from motionlake.stages.graph import KEPT
from motionlake.stages.moves import read_tracks
from motionlake.stages.reader import LakeReader
from motionlake.stages.registry import ALL

from bench.canonical_sets import SETS
from bench.lakes import make_lake
from bench.record import hash_files, record, recordings

SEEDS: Final = (0, 1, 2)
METHODS: Final = ("signature", "alignment", "moves", "descriptor")
# How much each of them counts.
SHARES: Final = (
    (1, 1, 1, 0), (1, 1, 2, 0), (1, 1, 3, 0), (1, 1, 4, 0), (1, 0, 1, 0), (1, 0, 2, 0), (1, 0, 4, 0), (0, 1, 2, 0),
    (0, 0, 1, 0), (1, 0, 0, 0), (0, 0, 1, 1), (1, 0, 2, 2), (1, 1, 1, 1), (1, 1, 2, 2), (1, 1, 4, 1), (1, 1, 4, 2),
    (1, 1, 4, 4), (1, 1, 0, 4), (2, 1, 4, 2),
)  # fmt: skip
JOINS: Final = (6, 8, 10, 12)
DIRECTS: Final = (0.01, 0.1, 0.3, 1.0)
CHOSEN: Final = "SELECT clip, {label}, subject FROM clips WHERE label IS NOT NULL {only} ORDER BY clip"


@dataclass(frozen=True)
class Constants:
    """Of the default search."""

    joined: int
    direct: float
    shares: tuple[float, ...]


NOW: Final = Constants(JOINED, DIRECT, tuple(WEIGHTS.get(method, 0.0) for method in METHODS))


@dataclass(frozen=True)
class Measured:
    """A lake: distances [n, n] between its clips by each method, infinite where it cannot compare them; which of these
    are measured, with their classes and subjects."""

    distances: Mapping[str, Float64Array]
    rows: Int64Array
    labels: list[str]
    subjects: list[str | None]

    def scores(self, near: Float64Array) -> SearchScores:
        """Of how near [n, n] clips are."""
        same = ~np.eye(len(self.rows), dtype=np.bool_)
        questions = Questions.of(self.labels, self.labels, same)
        return score_search(-near[np.ix_(self.rows, self.rows)], questions, self.subjects, self.subjects)


def every_constants() -> Iterator[Constants]:
    return itertools.starmap(Constants, itertools.product(JOINS, DIRECTS, SHARES))


def measured(folder: Path, name: str, seed: int) -> Measured:
    """A set as a lake with every stage, and the distances of its clips."""
    chosen = SETS[name]
    lake = make_lake(folder, [recordings() / chosen.folder])
    lake.config_file.write_text(f"[motifs]\nseed = {seed}\n", encoding="utf-8")
    with session(lake, "bench", lambda stage, done, total: None, lambda line: None) as job:
        run(job, tuple(stage for stage in ALL if stage not in ("submotions", "graph")))
    with reading(lake) as con:
        every = [row[0] for row in con.execute("SELECT clip FROM clips ORDER BY clip").fetchall()]
        only = "AND label = 'salsa'" if name == "salsa" else ""
        rows = con.execute(CHOSEN.format(label=chosen.label, only=only)).fetchall()
        tracks = read_tracks(
            LakeReader(con, lake, load_config(lake.config_file)),
            dict(con.execute("SELECT clip, part FROM clips").fetchall()),
        )
    found = {method: _distances(lake, method, every) for method in METHODS}
    found["dtw"] = dtw_matrix([tracks[clip].turned().joints.astype(np.float32) for clip in every])
    at = np.array([every.index(row[0]) for row in rows])
    known = [row[2] if name != "salsa" else None for row in rows]
    return Measured(found, at, [row[1] for row in rows], known)


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


def views(one: Measured, joined: int) -> dict[str, tuple[Float64Array, Float64Array]]:
    """By method, how near [n, n] clips are by their distance, and along the graph."""
    return {method: _view(distances, joined) for method, distances in one.distances.items()}


def _view(distances: Float64Array, joined: int) -> tuple[Float64Array, Float64Array]:
    order = np.argsort(distances, axis=1, kind="stable")
    kept, at = order[:, :KEPT], np.arange(len(order))[:, None]
    near = np.where(np.isfinite(distances[at, kept]), kept, -1)
    graph = NeighbourGraph(near, distances[at, kept], joined_of(len(order), joined))
    direct, along = np.zeros_like(distances), np.zeros_like(distances)
    for row, others in enumerate(order):
        there = others[np.isfinite(distances[row, others])]
        if len(there):
            unit = scale(distances[row, there], joined)
            direct[row, there] = 1 / (1 + distances[row, there] / unit)
            nodes = there[: REACH + 1]
            along[row, nodes] = diffused(graph, nodes, distances[row, nodes], row)
    return direct, along


def fused(of_each: Mapping[str, tuple[Float64Array, Float64Array]], how: Constants) -> Float64Array:
    """How near [n, n] clips are by all methods together."""
    parts = [
        share * (along + how.direct * direct)
        for share, (direct, along) in zip(how.shares, (of_each[method] for method in METHODS), strict=True)
        if share
    ]
    return np.asarray(sum(parts))


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
        for joined in sorted({*JOINS, NOW.joined}):
            of_each = views(one, joined)
            for how in {NOW, *every_constants()}:
                if how.joined == joined:
                    maps.setdefault(how, {}).setdefault(name, []).append(one.scores(fused(of_each, how)))
            if joined == NOW.joined:
                for method, (direct, along) in of_each.items():
                    alone.setdefault(method, {}).setdefault(name, []).append(one.scores(direct))
                    alone.setdefault(f"{method}, graph", {}).setdefault(name, []).append(
                        one.scores(along + NOW.direct * direct)
                    )
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
        "now": {"constants": asdict(NOW), **{name: _mean(maps[NOW][name]) for name in names}},
        "alone": {method: {name: _mean(found[name]) for name in names} for method, found in alone.items()},
    }


def _mean(runs: Sequence[SearchScores]) -> dict[str, float]:
    rows = [asdict(each) for each in runs]
    return {key: float(np.mean([row[key] for row in rows])) for key in rows[0] if rows[0][key] is not None}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sets", nargs="*", default=list(SETS), help="which to measure (default: all)")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(SEEDS))
    given = parser.parse_args()
    figures = measure(given.sets, given.seeds)
    for part in ("left out", "best on all", "now", "alone"):
        print(part, figures[part])
    folders = [recordings() / SETS[name].folder for name in given.sets]
    files = [path for folder in folders for path in folder.rglob("*") if path.is_file()]
    print(record("generalise", figures, hash_files(files, recordings())))


if __name__ == "__main__":
    main()
