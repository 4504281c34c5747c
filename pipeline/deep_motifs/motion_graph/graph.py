"""What can go wrong with a walk."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
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
        return Transitions(
            self.from_clip[rows], self.from_frame[rows], self.to_clip[rows], self.to_frame[rows],
            self.distance[rows], self.context[rows],
        )  # fmt: skip


def near(transitions: Transitions, quantile: float = DISTANCE_QUANTILE) -> Transitions:
    """The transitions whose distance is at most a quantile of all."""
    return transitions.at(_lowest(transitions.distance, quantile))


def in_context(transitions: Transitions, quantile: float = CONTEXT_QUANTILE) -> Transitions:
    """The transitions whose ends' contexts are at most a quantile of all apart (Deep Motifs, section 6.4)."""
    return transitions.at(_lowest(transitions.context, quantile))


def _lowest(values: Float64Array, quantile: float) -> BoolArray:
    if not len(values):
        return np.zeros(0, dtype=bool)
    return np.asarray(values <= np.quantile(values, quantile, method="lower"))


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
        found = np.zeros(int(self.component.max()) + 1 if len(self.component) else 0)
        fps = np.array([c.fps for c in self.clips])
        follows = (self.clip[1:] == self.clip[:-1]) & (self.component[1:] == self.component[:-1])
        rows = np.flatnonzero(follows)
        spans = (self.frame[rows + 1] - self.frame[rows]) / fps[self.clip[rows]]
        np.add.at(found, self.component[rows], spans)
        return found

    def largest(self) -> int:
        """The component with the most seconds; -1 where there is no point."""
        seconds = self.seconds()
        return int(np.argmax(seconds)) if len(seconds) else -1


def build_graph(clips: Sequence[GraphClip], transitions: Transitions) -> MotionGraph:
    """The graph of all clips with these transitions.

    Points are the frames where a transition leaves a clip or has entered it, in time; from each a piece leads
    to the next one of its clip.
    """
    blend = np.array([c.blend for c in clips], dtype=np.int64)
    n = len(transitions)
    entered = transitions.to_frame + blend[transitions.to_clip] if n else transitions.to_frame
    ends = np.stack(
        [
            np.concatenate([transitions.from_clip, transitions.to_clip]),
            np.concatenate([transitions.from_frame, entered]),
        ]
    )
    points, place = np.unique(ends, axis=1, return_inverse=True)
    place = place.ravel()
    leave, enter = place[:n], place[n:]
    rows = np.flatnonzero(points[0, 1:] == points[0, :-1])
    sources, targets = np.concatenate([rows, leave]), np.concatenate([rows + 1, enter])
    size = points.shape[1]
    matrix = csr_array((np.ones(len(sources), dtype=np.int8), (sources, targets)), shape=(size, size))
    component = connected_components(matrix, connection="strong")[1].astype(np.int64) if size else np.zeros(0, np.int64)
    return MotionGraph(clips, transitions, points[0], points[1], leave, enter, component)


@dataclass(frozen=True)
class GraphSummary:
    """What a graph amounts to.

    Attributes:
        clips: of the graph.
        points: where clips can be left or entered.
        transitions: all of them.
        largest_points, largest_transitions, largest_clips, largest_seconds: of the largest strongly connected
            component.
        seconds: of all clips.
        components: strongly connected components that a walk can stay in.
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
    """Figures of a graph and of its largest strongly connected component."""
    largest = graph.largest()
    members = graph.component == largest
    inner = graph.inner
    return GraphSummary(
        clips=len(graph.clips),
        points=len(graph.clip),
        transitions=len(graph.transitions),
        components=len(np.unique(graph.component[graph.leave[inner]])),
        largest_points=int(members.sum()),
        largest_transitions=int((inner & members[graph.leave]).sum()) if len(graph.transitions) else 0,
        largest_clips=len(np.unique(graph.clip[members])),
        largest_seconds=float(graph.seconds()[largest]) if largest >= 0 else 0.0,
        seconds=float(sum(c.frames / c.fps for c in graph.clips)),
    )
