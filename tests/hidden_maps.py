"""Known rig maps as the oracle of the rig solver: each is hidden from it and looked for again."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Final

from motionlake.motion.auto_rig import sampled
from motionlake.motion.clip import SourceClip
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
    positions = sampled(solve(clip))
    found = solve_rig(asked.hierarchy, name_sides(asked.hierarchy.joints), positions)
    # Of joints in one place each is right.
    right = {
        joint: joint in found and bool((positions[:, found[joint]] == positions[:, place]).all())
        for joint, place in places(clip).items()
    }
    return list(right.values()), [all(right.get(joint, True) for joint in chain) for chain in CHAINS]
