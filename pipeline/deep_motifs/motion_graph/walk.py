"""Random walks through a motion graph, and the motion that a walk makes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
from motionlake.arrays import Int64Array
from motionlake.deep_motifs.motion_graph.blend import STAY, Placement, RigPoses, alignment, ease, mixture, placed
from motionlake.deep_motifs.motion_graph.graph import MotionGraph, NoWalkError
from motionlake.errors import UserError

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
    """A walk of `frames` frames that starts with the first frame of a clip.

    The next transition is drawn evenly among those that leave the clip at least a second after it was entered
    (earlier ones where there are none) and do not lead to within a second of where the walk last left or
    entered a clip. Where none may be taken, the walk goes back a transition and draws again.

    Args:
        graph: its clips all of one rate, that of the walk.
        clip: index of the clip to start with.
        frames: at least two blends.
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


def placements(pieces: Sequence[WalkPiece], poses: Callable[[int], RigPoses]) -> list[Placement]:
    """Where each piece is placed on the ground: the first as recorded, others so that blended frames come closest."""
    found = [STAY]
    for before, piece in pairwise(pieces):
        leaving = poses(before.clip).cut(before.stop - piece.blend, before.stop)
        entering = poses(piece.clip).cut(piece.start, piece.start + piece.blend)
        found.append(found[-1].after(alignment(leaving, entering), leaving.up))
    return found


def assemble(pieces: Sequence[WalkPiece], places: Sequence[Placement], poses: Callable[[int], RigPoses]) -> RigPoses:
    """The motion of a walk: the pieces one after the other, blended where they overlap."""
    made = [placed(poses(p.clip).cut(p.start, p.stop), place) for p, place in zip(pieces, places, strict=True)]
    parts: list[RigPoses] = []
    for i, (piece, own) in enumerate(zip(pieces, made, strict=True)):
        if i:
            before = made[i - 1]
            parts.append(
                mixture(before.cut(len(before) - piece.blend, len(before)), own.cut(0, piece.blend), ease(piece.blend))
            )
        shared = pieces[i + 1].blend if i + 1 < len(pieces) else 0
        parts.append(own.cut(piece.blend, len(own) - shared))
    return made[0].of(
        np.concatenate([p.root for p in parts]),
        np.concatenate([p.shifts for p in parts]),
        np.concatenate([p.rotations for p in parts]),
    )
