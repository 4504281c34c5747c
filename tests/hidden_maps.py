"""Known rig maps as the oracle of the rig solver: each is hidden from it and looked for again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.auto_rig import match_rig, sampled, sampled_ends
from motionlake.motion.clip import Hierarchy, SolvedMotion, SourceClip
from motionlake.motion.kinematics import solve
from motionlake.motion.rig_solver import solve_rig
from motionlake.motion.rigs import identify, joints_by_name, load_rigs
from motionlake.motion.starter import name_sides

CHAINS: Final = tuple(
    tuple(f"{side}_{part}" for part in parts)
    for side, parts in product(
        ("left", "right"), (("hip", "knee", "ankle", "toe"), ("clavicle", "shoulder", "elbow", "wrist"))
    )
)


def numbered(clip: SourceClip) -> SourceClip:
    """The clip with numbers for the names of its joints."""
    names = tuple(f"joint{i:02}" for i in range(len(clip.hierarchy.joints)))
    return replace(clip, hierarchy=replace(clip.hierarchy, joints=names))


def places(clip: SourceClip) -> dict[str, int]:
    """Canonical joint -> joint of the file, by the known map of its rig."""
    present = joints_by_name(clip.hierarchy.joints)
    rig = identify(clip.hierarchy.joints, load_rigs())
    return {joint: present[name.casefold()] for joint, name in rig.joints.items() if name.casefold() in present}


def found_again(clip: SourceClip, named: bool) -> tuple[list[bool], list[bool]]:
    """Of each joint of the known map, and of each limb chain, whether the solver finds the same without it."""
    asked = clip if named else numbered(clip)
    motion = solve(clip)
    positions = sampled(motion)
    ends = sampled_ends(clip.hierarchy, motion)
    found = solve_rig(asked.hierarchy, name_sides(asked.hierarchy.joints), positions, ends)
    # Of joints in one place each is right.
    right = {
        joint: joint in found and bool((positions[:, found[joint]] == positions[:, place]).all())
        for joint, place in places(clip).items()
    }
    return list(right.values()), [all(right.get(joint, True) for joint in chain) for chain in CHAINS]


# Of the names of a damaged file so many are lost, another joint's, or of the other side.
DAMAGED: Final = 0.3
_OTHER_SIDE: Final = {"left": "right", "right": "left", "Left": "Right", "Right": "Left"}


def with_damaged_names(hierarchy: Hierarchy, rng: np.random.Generator) -> Hierarchy:
    """The tree with a part of its names damaged."""
    joints = list(hierarchy.joints)
    for joint in np.flatnonzero(rng.random(len(joints)) < DAMAGED):
        name, harm = joints[joint], rng.integers(3)
        other = hierarchy.joints[rng.integers(len(joints))]
        turned = next((name.replace(side, to) for side, to in _OTHER_SIDE.items() if side in name), "lost")
        joints[joint] = f"{('lost', other, turned)[harm]}_{joint}"
    return replace(hierarchy, joints=tuple(joints))


def without(hierarchy: Hierarchy, motion: SolvedMotion, gone: set[int]) -> tuple[Hierarchy, SolvedMotion, list[int]]:
    """Tree and positions without some joints, whose children hang on the joint above, and which joints are left."""
    kept = [joint for joint in range(len(hierarchy.joints)) if joint not in gone]

    def above(joint: int) -> int:
        while joint in gone:
            joint = hierarchy.parents[joint]
        return kept.index(joint) if joint >= 0 else -1

    tree = replace(
        hierarchy,
        joints=tuple(hierarchy.joints[joint] for joint in kept),
        parents=tuple(above(hierarchy.parents[joint]) for joint in kept),
        offsets=hierarchy.offsets[kept], axes=hierarchy.axes[kept],
        channels=tuple(hierarchy.channels[joint] for joint in kept),
        end_sites=tuple((kept.index(joint), at) for joint, at in hierarchy.end_sites if joint in kept),
    )  # fmt: skip
    return tree, SolvedMotion(motion.positions[:, kept], None, None), kept


Judged = list[tuple[float, bool]]


def judged(hierarchy: Hierarchy, motion: SolvedMotion, truth: Mapping[str, int]) -> Judged:
    """(confidence, whether it is right) of every joint that the solver finds; what is in no map is wrong.

    Of the trunk, joints are judged that the map has: which of several is the chest is the map's choice.
    """
    match, at = match_rig(hierarchy, motion), motion.positions

    def right(joint: str, place: int) -> bool:
        return joint in truth and bool((at[:, place] == at[:, truth[joint]]).all())

    asked = {joint: place for joint, place in match.joints.items() if joint in truth or "_" in joint}
    return [(match.confidence(joint), right(joint, place)) for joint, place in asked.items()]


def judged_ways(clip: SourceClip, seed: int) -> dict[str, Judged]:
    """The joints of a clip judged with its names, with numbers, with names damaged, and with a joint missing."""
    truth, motion, rng = places(clip), solve(clip), np.random.default_rng(seed)
    at: Float64Array = sampled(motion)
    motion = SolvedMotion(at, None, None)
    limbs = sorted({joint.partition("_")[2] for joint in truth if "_" in joint})
    part = limbs[rng.integers(len(limbs))]
    tree, less, kept = without(clip.hierarchy, motion, {truth[f"{side}_{part}"] for side in ("left", "right")})
    left = {joint: kept.index(place) for joint, place in truth.items() if place in kept}
    return {
        "names": judged(clip.hierarchy, motion, truth),
        "numbers": judged(numbered(clip).hierarchy, motion, truth),
        "damaged names": judged(with_damaged_names(clip.hierarchy, rng), motion, truth),
        "a joint missing": judged(tree, less, left),
    }
