"""Feet that stand while two clips are blended stay where they are: legs bend for it (Kovar et al. 2002, section 4.3).

A blend takes a foot from where it stands in one clip to where it stands in the other, and so it slides. A stand that a
blend touches is held at one place from its first frame to its last, those of the clips' own frames too; hip and knee
take what is between (inverse kinematics of two bones), and the foot is turned as before. A stand whose foot would have
to be moved farther than `FAR`, or whose leg would jump for it, stays as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array, Int64Array
from motionlake.deep_motifs.motion_graph.blend import RigPoses, Steps, steps, y_up, y_up_axes
from motionlake.deep_motifs.motion_graph.graph import WalkPiece
from motionlake.errors import ClipError
from motionlake.motion.clip import Hierarchy
from motionlake.motion.kinematics import solve
from motionlake.motion.rigs import identify, joints_by_name, load_rigs
from motionlake.motion.rotations import conjugate, multiply, swing
from motionlake.motion.skeleton import INDEX
from motionlake.motion.standing import SIDES, contacts, staying
from motionlake.motion.two_bones import bent, level_ahead
from scipy.ndimage import binary_closing, gaussian_filter1d

FAR: Final = 0.08  # metres that a foot is moved at most
EDGE: Final = 0.15  # seconds over which a foot comes to where it stands, and leaves it
STEADY: Final = 0.03  # seconds over which feet are smoothed before it is said whether they stand
GAP: Final = 0.1  # seconds; a foot that stands again so soon has stood all the time


@dataclass(frozen=True)
class Legs:
    """The joints of both legs of a rig, hip, knee, ankle and toe of each side (the ankle where there is no toe)."""

    left: tuple[int, int, int, int]
    right: tuple[int, int, int, int]

    @classmethod
    def of(cls, hierarchy: Hierarchy) -> Legs | None:
        """None where the rig is not known, or its legs are no chains."""
        try:
            rig = identify(hierarchy.joints, load_rigs())
        except ClipError:
            return None
        present = joints_by_name(hierarchy.joints)
        found = {name: present[own.casefold()] for name, own in rig.joints.items() if own.casefold() in present}
        parts = ("hip", "knee", "ankle")
        if any(f"{side}_{part}" not in found for side in SIDES for part in parts):
            return None
        chains = []
        for side in SIDES:
            hip, knee, ankle = (found[f"{side}_{part}"] for part in parts)
            if hip not in _above(hierarchy, knee) or knee not in _above(hierarchy, ankle):
                return None
            chains.append((hip, knee, ankle, found.get(f"{side}_toe", ankle)))
        return cls(chains[0], chains[1])

    @cached_property
    def sides(self) -> tuple[tuple[int, int, int, int], ...]:
        return self.left, self.right


def _above(hierarchy: Hierarchy, joint: int) -> Iterator[int]:
    """The joints that lead to a joint."""
    while (joint := hierarchy.parents[joint]) >= 0:
        yield joint


def standing(poses: RigPoses, legs: Legs) -> BoolArray:
    """[F, 2] whether the left and the right foot of poses stand."""
    places = y_up(poses)
    joints = np.zeros((len(poses), len(INDEX), 3))
    for side, (_, _, ankle, toe) in zip(SIDES, legs.sides, strict=True):
        joints[:, INDEX[f"{side}_ankle"]], joints[:, INDEX[f"{side}_toe"]] = places[:, ankle], places[:, toe]
    low = np.minimum(*(places[:, leg[2], 1] for leg in legs.sides))
    height = float(np.median(places[..., 1].max(axis=1) - low))
    steady = gaussian_filter1d(joints, STEADY * poses.fps, axis=0, mode="nearest")
    return contacts(steady, poses.fps, max(height, 1e-6))


def of_walk(pieces: Sequence[WalkPiece], stands: Callable[[int], BoolArray]) -> BoolArray:
    """[F, 2] whether feet stand in the motion of a walk: as in the clip that a frame is mostly of."""
    found = np.zeros((pieces[-1].out + pieces[-1].stop - pieces[-1].start, 2), dtype=np.bool_)
    for piece in pieces:
        half = piece.blend // 2
        found[piece.out + half : piece.out + piece.stop - piece.start] = stands(piece.clip)[
            piece.start + half : piece.stop
        ]
    return found


def planted(
    made: RigPoses, pieces: Sequence[WalkPiece], stands: Callable[[int], BoolArray], legs: Legs, limits: Steps
) -> RigPoses:
    """The motion of a walk, its feet held where a blend would have them slide.

    Args:
        made: as `blend.assemble` has it.
        pieces: of the walk.
        stands: [F, 2] of each clip, by its index (`standing`).
        legs: of the rig.
        limits: steps that no joint may exceed.
    """
    every = _without_gaps(of_walk(pieces, stands), max(1, round(GAP * made.fps)))
    touched = np.zeros(len(made), dtype=np.bool_)
    for before, piece in pairwise(pieces):
        touched[piece.out : before.out + before.stop - before.start] = True
    edge = max(1, round(EDGE * made.fps))
    for side in range(len(SIDES)):
        for first, last in _stands(every[:, side], touched):
            window = slice(max(0, first - edge - 1), min(len(made), last + edge + 2))
            held = np.zeros(len(made), dtype=np.bool_)
            held[first : last + 1] = True
            own = made.at(window)
            better = _held(own, legs.sides[side], legs, held[window], edge)
            if better is not None and steps(better).within(limits):
                rotations = made.rotations.copy()
                rotations[window] = better.rotations
                made = replace(made, rotations=rotations)
    return made


def _without_gaps(standing: BoolArray, gap: int) -> BoolArray:
    """[F, 2] with gaps of fewer frames than `gap` between stands filled."""
    beyond = np.pad(standing, ((gap, gap), (0, 0)))
    return np.asarray(binary_closing(beyond, np.ones((gap, 1)))[gap:-gap])


def _stands(standing: BoolArray, touched: BoolArray) -> Iterator[tuple[int, int]]:
    """First and last frame of each stand that holds a frame of a blend."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], standing, [False]]).astype(np.int8)))
    for first, stop in edges.reshape(-1, 2).tolist():
        if touched[first:stop].any():
            yield first, stop - 1


def _held(poses: RigPoses, leg: tuple[int, int, int, int], legs: Legs, stands: BoolArray, edge: int) -> RigPoses | None:
    """Poses whose foot stays in place while it stands; None where it does so already, or goes too far."""
    hip, knee, ankle, toe = leg
    places = y_up(poses)
    change = staying(places[:, [ankle, toe]], stands, FAR, edge)
    moved = np.flatnonzero(np.abs(change).max(axis=1) > 0)
    if not len(moved):
        return None
    ahead = level_ahead(places[:, legs.left[0]], places[:, legs.right[0]])
    hips, old_knees, old_ankles = (np.ascontiguousarray(places[:, joint]) for joint in (hip, knee, ankle))
    knees, ankles = bent(hips, old_knees, old_ankles, old_ankles + change, ahead)
    turns = [swing(old_knees - hips, knees - hips), swing(old_ankles - old_knees, ankles - knees)]
    thigh, shin = (_in_rig(turn[moved], poses.up) for turn in turns)
    return replace(poses, rotations=_turned(poses, leg, moved, thigh, shin))


def _turned(
    poses: RigPoses, leg: tuple[int, int, int, int], rows: Int64Array, thigh: Float64Array, shin: Float64Array
) -> Float64Array:
    """[F, J, 4] rotations relative to the parents, after thigh and shin were turned in the world in some frames."""
    hip, knee, ankle, _ = leg
    parents = poses.hierarchy.parents
    world = solve(poses.at(rows).clip()).world
    assert world is not None
    found = poses.rotations.copy()

    def own(joint: int) -> Float64Array:
        return np.ascontiguousarray(world[:, joint])

    def above(joint: int, turn: Float64Array) -> Float64Array:
        return conjugate(multiply(turn, own(parents[joint])))

    still = np.broadcast_to(np.array([1.0, 0.0, 0.0, 0.0]), thigh.shape)
    found[rows, hip] = multiply(above(hip, still), multiply(thigh, own(hip)))
    found[rows, knee] = multiply(above(knee, thigh), multiply(shin, own(knee)))
    found[rows, ankle] = multiply(above(ankle, shin), own(ankle))
    return found


def _in_rig(turns: Float64Array, up: str) -> Float64Array:
    """Rotations [F, 4] of a world whose y is up, in that of a rig."""
    found = turns.copy()
    found[:, 1:] = turns[:, 1:] @ y_up_axes(up)
    return found
