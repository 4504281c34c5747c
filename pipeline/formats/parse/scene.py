"""Joints of a scene: a tree of nodes that are placed, turned and scaled below one another, as a clip.

glTF, FBX and USD differ in how they are stored and agree in this: a skeleton's joints are nodes among others, what
stands above them moves them too, and the pose in which they were bound to the skin is the body's rest pose.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.limits_config import FRAME_BYTES, JOINT_BYTES, limits
from motionlake.formats.parse.placings import Placing, Placings, are_sound
from motionlake.formats.parse.scene_trees import JointTree
from motionlake.motion.clip import (
    POSITION_CHANNELS,
    QUATERNION_CHANNELS,
    ChannelKind,
    Hierarchy,
    SourceClip,
)
from motionlake.motion.rotations import IDENTITY, multiply, to_matrix
from motionlake.names import printable, unique

# Shares of the body's size: what a joint's place under its parent may waver by and still be one offset.
STEADY: Final = 1e-5
ROUNDING: Final = 1e-12  # of the largest number
LONGEST_NAME: Final = 100
NO_PLACE: Final = "has a node that is scaled to nothing, or placed at no number"


@dataclass(frozen=True)
class Worlds:
    """Where nodes are in the scene.

    Attributes:
        positions: [F, J, 3].
        rotations: [F, J, 4].
    """

    positions: Float64Array
    rotations: Float64Array


def worlds(tree: JointTree, placings: Placings, frames: int, nodes: Sequence[int] | None = None) -> Worlds:
    """Where a tree's joints are at `frames` frames.

    Args:
        tree: of the joints.
        placings: of its nodes, or of more.
        frames: F.
        nodes: for each of the tree's nodes its place among `placings`, -1 where it stands as its parent; by default
            they are in the tree's order.
    """
    from motionlake.formats.parse.scene_kernels import chain

    nodes = range(len(tree.nodes)) if nodes is None else nodes
    sized = (placings.scale != 1).any(axis=(0, 2))
    scaled = np.zeros(len(nodes), bool)  # it, or what is above it
    for at, (node, parent) in enumerate(zip(nodes, tree.parents, strict=True)):
        scaled[at] = (node >= 0 and sized[node]) or (parent >= 0 and scaled[parent])
    joints = len(nodes) - tree.root
    positions, rotations = np.empty((frames, joints, 3)), np.empty((frames, joints, 4))
    chain(
        np.array(nodes), np.array(tree.parents), tree.root, placings.translation, placings.rotation, placings.scale,
        scaled, positions, rotations,
    )  # fmt: skip
    return Worlds(positions, rotations)


def bind_pose(tree: JointTree, rest: Sequence[Placing], bound: Mapping[int, Float64Array]) -> Worlds:
    """Where joints were when they were bound to the skin; those that were not stand below their parent as they rest.

    Args:
        tree: of the joints.
        rest: how each of the tree's nodes rests.
        bound: by node, the inverse of the matrix [4, 4] at which it was bound, in the mesh's own axes. Those are the
            scene's or those of what the skeleton hangs from: whichever brings the joints nearer to where they rest.
    """
    standing = worlds(tree, Placings.of(rest), 1)
    matrices = _matrices(tree, rest)
    inverses = _inverse(matrices)
    nodes = [node for node in tree.joints if node in bound]
    given = np.array([bound[node] for node in nodes]).reshape(-1, 4, 4)
    sound = are_sound(given)
    place = {node: number for number, node in enumerate(node for node, fits in zip(nodes, sound, strict=True) if fits)}
    chosen = np.array([place.get(node, -1) for node in tree.joints])
    as_bound = _inverse(given[sound])
    if len(as_bound) == len(tree.joints) and _are_alike(as_bound, matrices[tree.root :]):
        return standing
    above = matrices[tree.parents[tree.root]] if tree.root else np.eye(4)
    best, nearest = standing, np.inf
    for axes in (np.eye(4), above):
        placed = axes @ as_bound
        found = matrices.copy()
        joints = found[tree.root :]
        joints[chosen >= 0] = placed[chosen[chosen >= 0]]
        for at in (tree.root + np.flatnonzero(chosen < 0)).tolist():
            parent = tree.parents[at]
            if at > tree.root:
                found[at] = found[parent] @ inverses[parent] @ matrices[at]
        changes = Placing.of_matrices(inverses[tree.root :] @ joints)
        here = Worlds(joints[None, :, :3, 3].copy(), multiply(standing.rotations, changes.rotation[None]))
        apart = float(np.median(np.linalg.norm(here.positions - standing.positions, axis=-1)))
        if apart < nearest:
            best, nearest = here, apart
        if (above == axes).all():
            break
    return best


def _matrices(tree: JointTree, rest: Sequence[Placing]) -> Float64Array:
    """[N, 4, 4] of the nodes in the scene, of how each rests."""
    local = np.tile(np.eye(4), (len(rest), 1, 1))
    turns = to_matrix(np.array([placing.rotation[0] for placing in rest]))
    local[:, :3, :3] = turns * np.array([placing.scale[0] for placing in rest])[:, None, :]
    local[:, :3, 3] = [placing.translation[0] for placing in rest]
    for at, parent in enumerate(tree.parents):
        if parent >= 0:
            local[at] = local[parent] @ local[at]
    if not are_sound(local).all():
        raise ClipError(NO_PLACE)
    return local


def _are_alike(some: Float64Array, others: Float64Array) -> bool:
    """Whether matrices are the same but for what is lost in rounding."""
    return bool(np.abs(some - others).max() <= ROUNDING * np.abs(others).max())


def _inverse(matrices: Float64Array) -> Float64Array:
    try:
        return np.asarray(np.linalg.inv(matrices), np.float64)
    except np.linalg.LinAlgError as error:
        raise ClipError(NO_PLACE) from error


def uneven_note(names: Sequence[str], placings: Placings, nodes: Sequence[int] | None = None) -> tuple[str, ...]:
    """A note where nodes are scaled more along one axis than along another; `nodes` as in `worlds`."""
    nodes, uneven = range(len(names)) if nodes is None else nodes, placings.uneven
    first = next((name for name, node in zip(names, nodes, strict=True) if node >= 0 and uneven[node]), None)
    if first is None:
        return ()
    return (f"{printable(first)} is scaled unequally: bones below it stretch as they turn",)


def against_rest(parents: Sequence[int], moved: Worlds, rest: Float64Array) -> tuple[Float64Array, Float64Array]:
    """How joints are turned against their rest and where they are, as their parents see them; the root from the scene.

    Args:
        parents: of J joints.
        moved: where they are at F frames.
        rest: [J, 4] rotations in the scene.

    Returns:
        [F, 3 + 4 J] where the root is and how joints are turned, and [F, J, 3] where they are.
    """
    from motionlake.formats.parse.scene_kernels import fill_against_rest

    frames, joints = moved.rotations.shape[:2]
    channels = np.empty((frames, 3 + 4 * joints))
    seen = np.empty((frames, joints, 3))
    fill_against_rest(np.array(parents), moved.positions, moved.rotations, rest, channels, seen)
    channels[:, :3] = seen[:, 0]
    return channels, seen


def check_room(clips: Iterable[tuple[int, int]]) -> None:
    """Hold clips of so many (frames, joints) against the limits, each and together, before room is made for them."""
    total = 0
    for frames, joints in clips:
        limits().check_body(frames, joints)
        total += frames * (FRAME_BYTES + JOINT_BYTES * joints)
    limits().check_memory(total)


def joint_names(names: Iterable[str]) -> tuple[str, ...]:
    """Names of joints as a clip has them: printable, none empty, none twice."""
    return tuple(unique([printable(name) or f"joint {number}" for number, name in enumerate(names)]))


def body_names(takes: Sequence[tuple[str, str]]) -> list[str]:
    """What tells clips of one file apart, of the names of each one's take and skeleton; "" where there is one clip.

    Printable, short, none twice; a take or skeleton is named where there are several.
    """
    if len(takes) == 1:
        return [""]
    several = [len({take[part] for take in takes}) > 1 for part in (0, 1)]
    told = [" ".join(name for name, tells in zip(take, several, strict=True) if tells) for take in takes]
    short = [" ".join(printable(name).split())[:LONGEST_NAME] for name in told]
    return list(unique([name or str(number) for number, name in enumerate(short, start=1)]))


def clip_of_worlds(
    names: tuple[str, ...],
    parents: tuple[int, ...],
    moved: Worlds,
    rest: Worlds,
    *,
    fps: float,
    body: str,
    metres_per_unit: float | None,
    up: str,
    notes: tuple[str, ...] = (),
) -> SourceClip:
    """A clip whose zero pose is the rest pose, of joints in the scene.

    The root and joints whose place under their parent changes have position channels, all have quaternions: a joint's
    rotation against its rest, as its parent's sees it.

    Args:
        names, parents: of J joints; the root, which is joint 0, has parent -1.
        moved: the joints at F frames.
        rest: the joints in the rest pose, F = 1.
        fps, body, metres_per_unit, up, notes: as `SourceClip` has them.
    """
    channels, seen = against_rest(parents, moved, rest.rotations[0])
    bones = rest.positions[0] - rest.positions[0, [max(parent, 0) for parent in parents]]
    size = max(float(np.ptp(rest.positions[0], axis=0).max()), np.finfo(float).tiny)
    low, high = seen.min(axis=0), seen.max(axis=0)
    middle = np.asarray((low + high) / 2)
    steady = (high - low <= 2 * STEADY * size).all(axis=-1)
    as_bound = (np.abs(middle - bones) <= STEADY * size).all(axis=-1)
    offsets = np.where((steady & ~as_bound)[:, None], middle, bones)
    offsets[0] = 0.0
    placed = [True, *(not still for still in steady[1:].tolist())]
    if any(placed[1:]):
        turns = channels[:, 3:].reshape(len(channels), -1, 4)
        parts = [[seen[:, joint]] * places + [turns[:, joint]] for joint, places in enumerate(placed)]
        channels = np.concatenate([part for joint in parts for part in joint], axis=1)
    columns = [(*(POSITION_CHANNELS if places else ()), *QUATERNION_CHANNELS) for places in placed]
    hierarchy = Hierarchy(
        joints=names,
        parents=parents,
        offsets=offsets,
        channels=tuple(columns),
        kind=ChannelKind.QUATERNION,
        axes=np.tile(IDENTITY, (len(names), 1)),
    )
    return SourceClip(
        hierarchy,
        channels,
        fps=fps,
        body=body,
        metres_per_unit=metres_per_unit,
        up=up,
        notes=notes,
    )
