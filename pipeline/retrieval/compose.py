"""New motions out of a dataset's clips: walks through its motion graph, in the clips' rig, with their lineage."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, reduce
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from motionlake.columns import numbers
from motionlake.deep_motifs.motion_graph import graph as graphs
from motionlake.deep_motifs.motion_graph.blend import (
    RigPoses,
    Steps,
    assemble,
    can_pose,
    placements,
    poses_of,
    resampled,
    steps,
)
from motionlake.deep_motifs.motion_graph.graph import (
    GraphClip,
    GraphSummary,
    MotionGraph,
    Transitions,
    WalkPiece,
    build_graph,
    component_of,
    random_walk,
    summarise,
)
from motionlake.deep_motifs.motion_graph.planting import Legs, planted, standing
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch, fetch_table
from motionlake.lake.layout import Lake
from motionlake.lake.raw import canonical_rig, own_rig
from motionlake.lake.settings import served_config
from motionlake.lake.verdicts import good_rows
from motionlake.motion.clip import SourceClip
from motionlake.motion.resampling import sample_count

LoadPoses = Callable[[int], RigPoses]
# Lengths of blends that are tried, in windows of the distance (a third of a second).
BLENDS: Final = (1, 2, 3)


@dataclass(frozen=True)
class LakeGraph:
    """The motion graph of one dataset; frames of all clips at one rate, the highest of them.

    Attributes:
        rows: of the clips in the table `clips`.
    """

    graph: MotionGraph
    rows: list[dict[str, Any]]

    @property
    def fps(self) -> float:
        return self.graph.clips[0].fps

    @property
    def blend(self) -> int:
        return self.graph.clips[0].blend

    def index(self, clip: str) -> int:
        """Raises `UserError` for a clip that it does not hold."""
        for at, row in enumerate(self.rows):
            if row["clip"] == clip:
                return at
        raise UserError(f"{clip}: is not among the clips to cut from; --min-quality may leave it out")


@dataclass(frozen=True)
class Source:
    """Where frames [out_start, out_stop) of a composed motion come from: frames [start, stop) of `clip`.

    Frames that two sources share are blended. The others are the clip's own (resampled where rates differ),
    turned by `turn` degrees about the up axis, then shifted by (x, y, z) in the units of the BVH. `distance` and
    `context_distance` are those of the transition that led here, None for the first.
    """

    out_start: int
    out_stop: int
    clip: str
    start: int
    stop: int
    licence: str | None
    label: str | None
    turn: float
    x: float
    y: float
    z: float
    distance: float | None
    context_distance: float | None


@dataclass(frozen=True)
class Composition:
    """A composed motion.

    Attributes:
        clip: to be written as BVH.
        rig: "own" where all clips it may visit share one, else "canonical".
        sources: lineage, in time.
        jump: the largest step of a joint from frame to frame, as a share of that joint's largest step in the
            clips used; at most 1.
        summary: of the graph walked.
    """

    clip: SourceClip
    rig: str
    sources: list[Source]
    jump: float
    summary: GraphSummary


def read_graph(
    con: Connection,
    lake: Lake,
    dataset: str,
    *,
    constrained: bool = True,
    distance_quantile: float = graphs.DISTANCE_QUANTILE,
    context_quantile: float = graphs.CONTEXT_QUANTILE,
    min_quality: str | None = None,
) -> LakeGraph:
    """The motion graph of a dataset, constrained by signatures or not (Deep Motifs, section 6.4).

    Args:
        con, lake: the lake.
        dataset: whose clips are joined.
        constrained: take only transitions between alike contexts.
        distance_quantile: share of the lake's transitions taken, nearest first.
        context_quantile: of these, the share taken with the constraint, nearest contexts first.
        min_quality: the worst verdict of stage "quality" that a clip may have; None: any.

    Raises:
        UserError: the lake has no transitions of the dataset, or as `good_rows`.
    """
    config = served_config(lake)
    rows = fetch(con, "graph_clips", {"dataset": dataset})
    table = fetch_table(con, "transitions", {"dataset": dataset})
    if not rows or not table.num_rows:
        raise UserError(
            f"{dataset}: has no transitions yet, or none of its clips come near one another; make them with "
            f"`motionlake run transitions --dataset {dataset} --lake {lake.root}`"
        )
    rows = good_rows(con, rows, min_quality, "clips to cut from")
    held = pa.array([row["clip"] for row in rows])
    table = table.filter(pc.and_(*(pc.is_in(table[f"{side}_clip"], held) for side in ("from", "to"))))
    fps = max(row["fps"] for row in rows)
    blend = max(2, round(config.transitions.window / config.words.fps * fps))
    clips = [GraphClip(r["clip"], fps, sample_count(r["frames"], r["fps"], fps), blend, r["label"]) for r in rows]
    place = {row["clip"]: i for i, row in enumerate(rows)}
    ratio = np.array([fps / row["fps"] for row in rows])

    def end(side: str) -> tuple[np.ndarray, np.ndarray]:
        clip = np.array([place[name] for name in table.column(f"{side}_clip").to_pylist()], dtype=np.int64)
        frame = np.round(numbers(table.column(f"{side}_frame")) * ratio[clip]).astype(np.int64)
        return clip, frame

    every = Transitions(
        *end("from"), *end("to"), numbers(table.column("distance")), numbers(table.column("context_distance"))
    )
    lengths = np.array([c.frames for c in clips])
    fits = every.from_frame + blend <= lengths[every.from_clip]
    fits &= every.to_frame + blend <= lengths[every.to_clip]
    taken = graphs.near(every.at(fits), distance_quantile)
    if constrained:
        taken = graphs.in_context(taken, context_quantile)
    return LakeGraph(build_graph(clips, taken), rows)


def graph_summary(con: Connection, lake: Lake, dataset: str, *, constrained: bool = True) -> GraphSummary:
    """The size of a dataset's graph; see `read_graph`."""
    return summarise(read_graph(con, lake, dataset, constrained=constrained).graph)


def pose_loader(con: Connection, lake: Lake, found: LakeGraph, component: int, start: int) -> tuple[str, LoadPoses]:
    """The rig that the clips of a component are posed in, and what gives a clip's poses at the graph's rate.

    All clips get the bones of the clip `start`: those of one graph differ by little.
    """
    visited = sorted({start, *(int(i) for i in found.graph.clip[found.graph.component == component])})
    rig = "own" if _share_rig([found.rows[i] for i in visited], con) else "canonical"

    @cache
    def load(clip: int) -> RigPoses:
        row = found.rows[clip]
        if rig == "own":
            poses = poses_of(own_rig(con, lake, row["clip"]), row["up"], row["metres_per_unit"])
        else:
            source = canonical_rig(con, lake, row["clip"])
            poses = poses_of(source, "y", source.metres_per_unit or 1.0)
        hierarchy = poses.hierarchy if clip == start else load(start).hierarchy
        return resampled(replace(poses, hierarchy=hierarchy), found.fps)

    return rig, load


def _share_rig(rows: list[dict[str, Any]], con: Connection) -> bool:
    if len({(r["layout"], r["skeleton"], r["up"], r["metres_per_unit"]) for r in rows}) != 1:
        return False
    layout = fetch(con, "layout", {"layout": rows[0]["layout"]})[0]
    return can_pose(layout["kind"], layout["channels"][0])


class SmoothBlend:
    """How long a transition must blend for no joint to step farther than it does within the clips walked through.

    Longer blends are tried where the graph's own is too short, as far as both clips go.
    """

    def __init__(self, found: LakeGraph, poses: LoadPoses) -> None:
        self._found = found
        self._poses = poses
        self._steps: Callable[[int], Steps] = cache(lambda clip: steps(poses(clip)))

    def limits(self, clips: Iterable[int]) -> Steps:
        """The largest steps within some clips."""
        return reduce(Steps.with_, (self._steps(clip) for clip in sorted(set(clips))))

    def __call__(self, pieces: Sequence[WalkPiece], transition: int) -> int:
        t = self._found.graph.transitions
        source, target = int(t.from_clip[transition]), int(t.to_clip[transition])
        leave, enter = int(t.from_frame[transition]), int(t.to_frame[transition])
        ends = self._found.graph.clips[source].frames, self._found.graph.clips[target].frames
        limits = self.limits([target, *(piece.clip for piece in pieces)])
        for length in BLENDS:
            blend = length * self._found.blend
            if leave + blend > ends[0] or enter + blend > ends[1]:
                break
            first = max(0, leave - 1)
            pair = [
                WalkPiece(source, first, leave + blend, 0),
                WalkPiece(target, enter, min(enter + blend + 1, ends[1]), leave - first, blend, transition),
            ]
            if steps(assemble(pair, placements(pair, self._poses), self._poses)).within(limits):
                return blend
        return 0


def compose(
    con: Connection,
    lake: Lake,
    found: LakeGraph,
    clip: str,
    seconds: float = 60.0,
    seed: int = 0,
    *,
    plant: bool = True,
) -> Composition:
    """A motion of `seconds` that starts with a clip and goes on from clip to clip.

    Where a joint would move more from frame to frame than it does within the clips walked through so far, the
    transition blends longer, up to a second, or is not taken. With `plant`, feet that stand while clips are blended
    stay where they are, if the legs of the rig are known.

    Raises:
        UserError: no transition leads on from the clip, or `seconds` hold none.
    """
    start = found.index(clip)
    frames = round(seconds * found.fps)
    rig, poses = pose_loader(con, lake, found, component_of(found.graph, start), start)
    smooth = SmoothBlend(found, poses)
    pieces = random_walk(found.graph, start, frames, seed, smooth)
    places = placements(pieces, poses)
    made = assemble(pieces, places, poses)
    limits = smooth.limits(piece.clip for piece in pieces)
    if plant and (legs := Legs.of(made.hierarchy)) is not None:
        made = planted(made, pieces, cache(lambda own: standing(poses(own), legs)), legs, limits)
    t = found.graph.transitions
    sources = []
    for piece, place in zip(pieces, places, strict=True):
        row, taken = found.rows[piece.clip], piece.transition
        costs = (float(t.distance[taken]), float(t.context[taken])) if taken >= 0 else (None, None)
        stop = piece.out + piece.stop - piece.start
        native = _native(piece, row, found.fps)
        sources.append(
            Source(
                piece.out, stop, row["clip"], *native, row["licence"], row["label"], place.degrees, *place.shift, *costs
            )
        )  # fmt: skip
    return Composition(made.clip(), rig, sources, steps(made).excess(limits), summarise(found.graph))


def _native(piece: WalkPiece, row: Mapping[str, Any], fps: float) -> tuple[int, int]:
    """The clip's own frames [start, stop) that a piece's are made of."""
    if row["fps"] == fps:
        return piece.start, piece.stop
    ratio = row["fps"] / fps
    return int(np.floor(piece.start * ratio)), min(int(np.ceil((piece.stop - 1) * ratio)) + 1, row["frames"])
