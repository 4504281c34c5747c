"""Motion graphs of clips and transitions (Deep Motifs, section 6.4), and random walks through them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array, Int64Array, IntArray
from motionlake.errors import UserError
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components


class NoWalkError(UserError):
    """A graph holds no walk that starts with some clip."""


# Of the transitions that a lake holds, those a graph takes by distance, and of these the constrained graph by context.
DISTANCE_QUANTILE: Final = 0.5
CONTEXT_QUANTILE: Final = 0.25


@dataclass(frozen=True)
class GraphClip:
    """One clip of a graph; `blend` frames of it are blended at a transition, at its own rate."""

    clip: str
    fps: float
    frames: int
    blend: int
    label: str | None = None


@dataclass(frozen=True)
class Transitions:
    """n transitions between clips, as indices into the graph's clips.

    A transition leaves `from_clip` at `from_frame` and enters `to_clip` at `to_frame`; the frames that follow
    either are blended.

    Attributes:
        distance: [n] metres.
        context: [n] distance of the signatures around both ends.
    """

    from_clip: Int64Array
    from_frame: Int64Array
    to_clip: Int64Array
    to_frame: Int64Array
    distance: Float64Array
    context: Float64Array

    def __len__(self) -> int:
        return len(self.distance)

    def at(self, rows: IntArray | BoolArray) -> Transitions:
        """Some of the transitions."""
        return Transitions(*(values[rows] for values in vars(self).values()))


def near(transitions: Transitions, quantile: float = DISTANCE_QUANTILE) -> Transitions:
    """The transitions whose distance is at most a quantile of all."""
    return _lowest(transitions, transitions.distance, quantile)


def in_context(transitions: Transitions, quantile: float = CONTEXT_QUANTILE) -> Transitions:
    """The transitions whose ends' contexts are at most a quantile of all apart (Deep Motifs, section 6.4)."""
    return _lowest(transitions, transitions.context, quantile)


def _lowest(transitions: Transitions, values: Float64Array, quantile: float) -> Transitions:
    if not len(transitions):
        return transitions
    return transitions.at(values <= np.quantile(values, quantile, method="lower"))


@dataclass(frozen=True)
class MotionGraph:
    """Points of clips, joined by the pieces between them and by transitions.

    Attributes:
        clips: of the graph, by name.
        transitions: its edges from clip to clip.
        clip, frame: [points] where a point lies; sorted.
        leave, enter: [transitions] the points they go from and to. A transition enters behind its blend.
        component: [points] strongly connected component.
    """

    clips: Sequence[GraphClip]
    transitions: Transitions
    clip: Int64Array
    frame: Int64Array
    leave: Int64Array
    enter: Int64Array
    component: Int64Array

    @property
    def inner(self) -> BoolArray:
        """[transitions] whether both ends lie in one component: only these lead nowhere that has no way back."""
        return np.asarray(self.component[self.leave] == self.component[self.enter])

    def seconds(self) -> Float64Array:
        """[components] seconds of the pieces within each."""
        fps = np.array([c.fps for c in self.clips])
        rows = np.flatnonzero((np.diff(self.clip) == 0) & (np.diff(self.component) == 0))
        spans = (self.frame[rows + 1] - self.frame[rows]) / fps[self.clip[rows]]
        found = np.bincount(self.component[rows], spans, minlength=self.component.max(initial=-1) + 1)
        return np.asarray(found, dtype=np.float64)

    def largest(self) -> int:
        """The component with the most seconds; -1 where there is no point."""
        seconds = self.seconds()
        return int(np.argmax(seconds)) if len(seconds) else -1


def build_graph(clips: Sequence[GraphClip], transitions: Transitions) -> MotionGraph:
    """The graph of all clips with these transitions.

    Points are the frames where a transition leaves a clip or has entered it, in time; from each a piece leads
    to the next one of its clip.
    """
    t, n = transitions, len(transitions)
    entered = t.to_frame + np.array([c.blend for c in clips], dtype=np.int64)[t.to_clip]
    ends = np.stack([np.concatenate([t.from_clip, t.to_clip]), np.concatenate([t.from_frame, entered])])
    points, place = np.unique(ends, axis=1, return_inverse=True)
    leave, enter = np.split(place.ravel(), [n])
    rows = np.flatnonzero(points[0, 1:] == points[0, :-1])
    sources, targets = np.concatenate([rows, leave]), np.concatenate([rows + 1, enter])
    size = points.shape[1]
    matrix = csr_array((np.ones(len(sources), dtype=np.int8), (sources, targets)), shape=(size, size))
    component = connected_components(matrix, connection="strong")[1].astype(np.int64) if size else np.zeros(0, np.int64)
    return MotionGraph(clips, transitions, points[0], points[1], leave, enter, component)


@dataclass(frozen=True)
class GraphSummary:
    """What a graph amounts to; `largest` is its largest strongly connected component.

    Attributes:
        points: where clips can be left or entered.
        components: strongly connected components that a walk can stay in.
        seconds: of all clips.
    """

    clips: int
    points: int
    transitions: int
    components: int
    largest_points: int
    largest_transitions: int
    largest_clips: int
    largest_seconds: float
    seconds: float

    def as_row(self) -> dict[str, int | float]:
        return asdict(self)


def summarise(graph: MotionGraph) -> GraphSummary:
    """Sizes of a graph and of its largest strongly connected component."""
    largest = graph.largest()
    members = graph.component == largest
    inner = graph.inner
    return GraphSummary(
        clips=len(graph.clips),
        points=len(graph.clip),
        transitions=len(graph.transitions),
        components=len(np.unique(graph.component[graph.leave[inner]])),
        largest_points=int(members.sum()),
        largest_transitions=int((inner & members[graph.leave]).sum()),
        largest_clips=len(np.unique(graph.clip[members])),
        largest_seconds=float(graph.seconds()[largest]) if largest >= 0 else 0.0,
        seconds=float(sum(c.frames / c.fps for c in graph.clips)),
    )


# A piece of a walk lasts at least this long where the graph allows it, and a walk does not go straight back.
SHORTEST_SECONDS: Final = 1.0


@dataclass(frozen=True)
class WalkPiece:
    """Frames [start, stop) of one clip from frame `out` of the walk on.

    Attributes:
        blend: so many of its first frames are blended with the last ones of the piece before; 0 for the first.
        transition: the one that led here, -1 for the first piece.
    """

    clip: int
    start: int
    stop: int
    out: int
    blend: int = 0
    transition: int = -1


# How many frames a transition from the last of some pieces must blend; 0 where it may not be taken.
Blending = Callable[[Sequence[WalkPiece], int], int]


def component_of(graph: MotionGraph, clip: int) -> int:
    """The strongly connected component that a walk from a clip stays in: of those it leads into, the longest.

    Raises:
        NoWalkError: no transition of the clip leads to where one can come back from.
    """
    leaving = graph.inner & (graph.transitions.from_clip == clip)
    reached = np.unique(graph.component[graph.leave[leaving]])
    if not len(reached):
        raise NoWalkError(
            f"{graph.clips[clip].clip}: no transition leads out of it and on; start from another clip, or take more "
            "of the transitions with --no-constraint, --distance-quantile or --context-quantile"
        )
    return int(reached[np.argmax(graph.seconds()[reached])])


def starts(graph: MotionGraph) -> list[int]:
    """The clips that transitions of the largest strongly connected component leave."""
    inner = graph.inner & (graph.component[graph.leave] == graph.largest())
    return [int(clip) for clip in np.unique(graph.transitions.from_clip[inner])]


def random_walk(
    graph: MotionGraph, clip: int, frames: int, seed: int, blending: Blending | None = None
) -> list[WalkPiece]:
    """A walk of `frames` frames, at least two blends, that starts with the first frame of a clip.

    The next transition is drawn evenly among those that leave the clip at least a second after it was entered
    (earlier ones where there are none) and do not lead to within a second of where the walk last left or
    entered a clip. Where none may be taken, the walk goes back a transition and draws again.

    Args:
        graph: its clips all of one rate, that of the walk.
        clip: index of the clip to start with.
        seed: of the draws.
        blending: how many frames a transition blends, by default as many as the clips say.

    Raises:
        UserError: `frames` are too few; `NoWalkError` where the graph holds no such walk.
    """
    blend = graph.clips[clip].blend
    if frames < 2 * blend:
        fps = graph.clips[clip].fps
        raise UserError(f"{frames / fps:.3g} s hold no transition; ask for at least {2 * blend / fps:.3g} s")
    usable = np.flatnonzero(graph.inner & (graph.component[graph.leave] == component_of(graph, clip)))
    random = np.random.default_rng(seed)
    refused: set[int] = set()
    pieces = [WalkPiece(clip, 0, graph.clips[clip].frames, 0)]
    t = graph.transitions
    while True:
        chosen = _next(graph, usable, pieces, refused, random)
        if chosen is None and len(pieces) == 1:
            raise NoWalkError(
                f"{graph.clips[clip].clip}: every transition out of it would make a joint jump; start from another clip"
            )
        if chosen is None:
            refused.add(pieces.pop().transition)
            continue
        blended = blending(pieces, chosen) if blending else blend
        if not blended:
            refused.add(chosen)
            continue
        here, leaving = pieces[-1], int(t.from_frame[chosen])
        out = here.out + leaving - here.start
        if out + blended > frames:
            pieces[-1] = replace(here, stop=here.start + frames - here.out)
            return pieces
        entered = int(t.to_clip[chosen])
        pieces[-1] = replace(here, stop=leaving + blended)
        pieces.append(WalkPiece(entered, int(t.to_frame[chosen]), graph.clips[entered].frames, out, blended, chosen))


def _next(
    graph: MotionGraph, usable: Int64Array, pieces: Sequence[WalkPiece], refused: set[int], random: np.random.Generator
) -> int | None:
    t, here = graph.transitions, pieces[-1]
    second = round(graph.clips[here.clip].fps * SHORTEST_SECONDS)
    entered = here.start + here.blend
    rows = usable[(t.from_clip[usable] == here.clip) & (t.from_frame[usable] >= entered)]
    rows = rows[~np.isin(rows, list(refused))]
    late = t.from_frame[rows] >= entered + second
    fresh = np.ones(len(rows), dtype=bool)
    recent = pieces[-3:]
    ends = [(piece.clip, piece.start) for piece in recent]
    ends += [(before.clip, before.stop - piece.blend) for before, piece in pairwise(recent)]
    for clip, frame in ends:
        fresh &= (t.to_clip[rows] != clip) | (np.abs(t.to_frame[rows] - frame) > second)
    for wanted in (late & fresh, late, fresh, np.ones(len(rows), dtype=bool)):
        if wanted.any():
            return int(random.choice(rows[wanted]))
    return None
