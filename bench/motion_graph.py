"""Motion graphs of cmu_dance with and without the constraint by signatures: `python -m bench.motion_graph`.

The lake is made afresh; labels (salsa, indian, martial) are only used to count transitions between classes. Three
seeds for training and clustering, means; candidates do not depend on them. "own" are words trained on the lake itself
without labels, which are the default's for a lake of so many, "pretrained" the same training on other sets. "nearest"
takes as many transitions as the constraint leaves, by distance alone. Walks of a minute start with the same clips in
both graphs, drawn by seed from each class in turn: salsa is two thirds of the set, and walks from it have little
chance to leave it. How feet slide, in blends and elsewhere, is measured with feet held where they stand and without.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping, Sequence
from itertools import pairwise, product
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.deep_motifs.motion_graph.blend import Steps, poses_of, steps
from motionlake.deep_motifs.motion_graph.graph import (
    CONTEXT_QUANTILE,
    DISTANCE_QUANTILE,
    MotionGraph,
    NoWalkError,
    build_graph,
    in_context,
    summarise,
)
from motionlake.evaluation.synthesis.contact import bearing
from motionlake.jobs.run import run
from motionlake.jobs.session import session
from motionlake.lake.catalog import reading
from motionlake.lake.layout import Lake
from motionlake.motion.canonicalise import canonicalise
from motionlake.motion.ground import ground_of
from motionlake.motion.kinematics import solve
from motionlake.motion.rigs import identify, load_rigs
from motionlake.retrieval.compose import Composition, compose, read_graph

from bench.lakes import make_lake, run_all
from bench.pretrained_words import pretrained_for
from bench.record import hash_files, record, recordings

DATASET: Final = "cmu_dance"
SEEDS: Final = (0, 1, 2)
ORIGINS: Final = ("own", "pretrained")  # of words
DISTANCES: Final = (0.25, 0.5, 0.75, 1.0)
CONTEXTS: Final = (0.1, 0.25, 0.5)
WALKED: Final = (DISTANCE_QUANTILE, 1.0)
WALKS: Final = range(10)
SECONDS: Final = 60.0
Figures = dict[str, float]


def graph_figures(graph: MotionGraph) -> Figures:
    """Size and share of transitions between classes, in all of a graph and in its largest component."""
    labels = np.array([c.label for c in graph.clips])
    t, found = graph.transitions, summarise(graph)
    changes = labels[t.from_clip] != labels[t.to_clip]
    largest = graph.inner & (graph.component[graph.leave] == graph.largest())
    return {
        "transitions": found.transitions,
        "between_classes": float(changes.mean()),
        "largest_points": found.largest_points,
        "largest_points_share": found.largest_points / found.points,
        "largest_transitions": found.largest_transitions,
        "largest_clips": found.largest_clips,
        "largest_seconds": found.largest_seconds,
        "largest_seconds_share": found.largest_seconds / found.seconds,
        "between_classes_in_largest": float(changes[largest].mean()) if largest.any() else 0.0,
    }


def compare(lake: Lake) -> dict[str, Figures]:
    """Graphs by share of transitions taken, without the constraint, with it, and as many of the nearest."""
    found = {}
    with reading(lake) as con:
        for distance in DISTANCES:
            free = read_graph(con, lake, DATASET, constrained=False, distance_quantile=distance).graph
            found[f"distance {distance:g}"] = graph_figures(free)
            for context in CONTEXTS:
                held = in_context(free.transitions, context)
                found[f"distance {distance:g}, context {context:g}"] = graph_figures(build_graph(free.clips, held))
                order = np.lexsort((np.arange(len(free.transitions)), free.transitions.distance))[: len(held)]
                nearest = build_graph(free.clips, free.transitions.at(np.sort(order)))
                found[f"distance {distance:g}, nearest as many as context {context:g}"] = graph_figures(nearest)
    return found


def walk_figures(lake: Lake) -> dict[str, Figures]:
    """Walks with the default share of transitions by distance and with all of them, free and constrained."""
    figures = {}
    with reading(lake) as con:
        for distance in WALKED:
            graphs = {
                name: read_graph(con, lake, DATASET, constrained=name == "constrained", distance_quantile=distance)
                for name in ("free", "constrained")
            }
            first = _starts([g.graph for g in graphs.values()])
            for name, graph in graphs.items():
                made, free = [], []
                for seed, clip in zip(WALKS, first, strict=True):
                    try:
                        made.append(compose(con, lake, graph, clip, SECONDS, seed))
                        free.append(compose(con, lake, graph, clip, SECONDS, seed, plant=False))
                    except NoWalkError as error:
                        print(error, flush=True)
                figures[f"walks, distance {distance:g}, {name}"] = _walks(made) | _slides(made, free)
    return figures


def _slides(held: Sequence[Composition], free: Sequence[Composition]) -> Figures:
    """Metres a second at which feet near the ground go, in blends and elsewhere, held and not; means of walks."""
    found: Figures = {}
    for name, motions in (("held", held), ("free", free)):
        slid = np.array([slides(motion) for motion in motions])
        found |= {
            f"{name}_slide_in_blends": float(slid[:, 0].mean()),
            f"{name}_slide_elsewhere": float(slid[:, 1].mean()),
        }
    return found


def slides(motion: Composition) -> tuple[float, float]:
    """Metres a second at which what bears the body travels: in blended frames, and in the others."""
    clip = motion.clip
    rig = identify(clip.hierarchy.joints, load_rigs())
    made = canonicalise(clip, solve(clip), rig, up="y", metres_per_unit=clip.metres_per_unit)
    speeds = bearing(made.positions, made.fps, ground_of(made.positions))
    blended = np.zeros(len(speeds), dtype=np.bool_)
    for before, source in pairwise(motion.sources):
        blended[source.out_start : before.out_stop] = True
    inside, outside = (float(np.nanmean(speeds[rows])) for rows in (blended, ~blended))
    return inside, outside


def _starts(graphs: Sequence[MotionGraph]) -> list[str]:
    """A clip for each walk that can be left for good in every graph; the classes take turns."""
    can = set.intersection(*({int(i) for i in np.unique(g.transitions.from_clip[g.inner])} for g in graphs))
    clips = graphs[0].clips
    classes = sorted({clips[i].label or "" for i in can})
    chosen = []
    for seed in WALKS:
        among = sorted(i for i in can if (clips[i].label or "") == classes[seed % len(classes)])
        chosen.append(clips[among[int(np.random.default_rng(seed).integers(len(among)))]].clip)
    return chosen


def _walks(made: Sequence[Composition]) -> Figures:
    changes, taken, blends = 0, 0, []
    for motion in made:
        labels = [source.label for source in motion.sources]
        changes += sum(a != b for a, b in pairwise(labels))
        taken += len(labels) - 1
        blends.append(_blend_jump(motion))
    lengths = [len(motion.clip.channels) / motion.clip.fps for motion in made]
    return {
        "walks": len(WALKS),
        "reached": sum(length >= SECONDS for length in lengths),
        "transitions_taken": taken,
        "class_changes": changes / taken,
        "walks_that_change_class": sum(len({s.label for s in motion.sources}) > 1 for motion in made),
        "clips_in_a_walk": float(np.mean([len({s.clip for s in motion.sources}) for motion in made])),
        "largest_step": max(motion.jump for motion in made),
        "largest_step_while_blended": max(blends),
    }


def _blend_jump(motion: Composition) -> float:
    """The largest step within blended frames, as a share of the joint's largest step in the whole motion."""
    poses = poses_of(motion.clip, "y", motion.clip.metres_per_unit or 1.0)
    whole = steps(poses)
    inside: Steps | None = None
    for before, source in pairwise(motion.sources):
        own = steps(poses.cut(source.out_start - 1, before.out_stop + 1))
        inside = own if inside is None else inside.with_(own)
    return inside.excess(whole) if inside else 0.0


def mean(runs: Sequence[Mapping[str, Mapping[str, float]]]) -> dict[str, Figures]:
    return {
        name: {figure: float(np.mean([run[name][figure] for run in runs])) for figure in runs[0][name]}
        for name in runs[0]
    }


def chance(graph: MotionGraph) -> float:
    """Share of pairs of frames, drawn at random, that belong to two classes."""
    seconds: dict[str | None, float] = {}
    for clip in graph.clips:
        seconds[clip.label] = seconds.get(clip.label, 0.0) + clip.frames / clip.fps
    shares = np.array(list(seconds.values())) / sum(seconds.values())
    return float(1 - np.sum(shares**2))


def main() -> None:
    source = recordings() / DATASET
    graphs: dict[str, list[dict[str, Figures]]] = {origin: [] for origin in ORIGINS}
    walks: dict[str, list[dict[str, Figures]]] = {origin: [] for origin in ORIGINS}
    costs: dict[str, float] = {}
    with tempfile.TemporaryDirectory(prefix="bench-motion-graph-") as folder:
        lake = make_lake(Path(folder), [source])
        others = pretrained_for(DATASET, Path(folder))
        for seed, origin in product(SEEDS, ORIGINS):
            run_all(lake, seed, others if origin == "pretrained" else None)
            began = time.perf_counter()
            with session(lake, "bench", lambda stage, done, total: None, lambda line: None) as job:
                run(job, ["transitions"], dataset=DATASET)
                outcome = job.outcomes["transitions"]
            if outcome.failed:
                raise RuntimeError(outcome.reason)
            costs.setdefault("new_motifs_seconds" if costs else "stage_seconds", time.perf_counter() - began)
            graphs[origin].append(compare(lake))
            walks[origin].append(walk_figures(lake))
            for name, row in walks[origin][-1].items():
                print(f"seed {seed}, {origin}, {name}: {_line(row)}", flush=True)
        with reading(lake) as con:
            free = read_graph(con, lake, DATASET, constrained=False).graph
            seconds = con.execute("SELECT sum(seconds) FROM manifest WHERE stage = 'transitions'").fetchall()[0][0]
    clips = len(free.clips)
    costs |= {"worker_seconds": seconds, "worker_ms_a_clip_pair": seconds * 1e3 / (clips * (clips + 1) / 2)}
    figures: dict[str, Any] = {
        "set": DATASET, "seeds": list(SEEDS), "walk_seeds": list(WALKS), "chance_between_classes": chance(free),
        "default": {"distance_quantile": DISTANCE_QUANTILE, "context_quantile": CONTEXT_QUANTILE},
        "graphs": {origin: mean(each) for origin, each in graphs.items()},
        "walks": {origin: mean(each) for origin, each in walks.items()}, "cost": costs,
    }  # fmt: skip
    print(f"\nchance of a change of class {figures['chance_between_classes']:.3f}; means of {len(SEEDS)} seeds")
    for origin in ORIGINS:
        for name, row in (figures["graphs"][origin] | figures["walks"][origin]).items():
            print(f"  {origin:10} {name:47} {_line(row)}")
    print(f"  cost {_line(costs)}")
    data = hash_files([p for p in source.rglob("*") if p.is_file()], source)
    print(record("motion-graph", figures, data))


def _line(row: Mapping[str, float]) -> str:
    return "  ".join(f"{name} {value:.4g}" for name, value in row.items())


if __name__ == "__main__":
    main()
