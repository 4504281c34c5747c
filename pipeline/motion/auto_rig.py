"""Rig maps for files that no known map fits: solved from the joint tree, and taken where they leave no doubt."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.motion.clip import Hierarchy, SolvedMotion, SourceClip
from motionlake.motion.rig_solver import solve_rig
from motionlake.motion.rigs import RigMap, bare_names, identify, joints_by_name, parse_rig
from motionlake.motion.skeleton import chained
from motionlake.motion.starter import LIMB_WORDS, guess_joints, name_sides, starter_map

PREFIX: Final = "auto:"
NOTE: Final = "rig map solved from the joint tree; `motionlake rig FILE` prints it"
LIMBS: Final = tuple(
    f"{side}_{part}"
    for side, part in product(("left", "right"), ("hip", "knee", "ankle", "shoulder", "elbow", "wrist"))
)
_FRAMES: Final = 64
# Arms as long as this share of the legs, from shoulder to wrist and from hip to ankle.
_ARM_TO_LEG: Final = (0.4, 1.6)
# Cosine between the legs and the trunk, downwards, of a body that stands; of an animal on four legs it is about 0.
_STANDS: Final = 0.6
_STANDING_FRAMES: Final = 0.05


def rig_of(clip: SourceClip, motion: SolvedMotion, rigs: Mapping[str, RigMap], name: str | None = None) -> RigMap:
    """The rig of a clip: a known map that fits (`identify`), else the one that its tree gives, called auto:HASH.

    Raises:
        UserError: there is no map called `name`.
        ClipError: no map fits, and the tree leaves in doubt what is what; the reason says both.
    """
    try:
        return identify(clip.hierarchy.joints, rigs, name)
    except ClipError as unknown:
        try:
            return auto_rig(clip.hierarchy, motion)
        except ClipError as doubt:
            raise ClipError(f"{unknown}; it was not solved by itself: {doubt}") from doubt


def auto_rig(hierarchy: Hierarchy, motion: SolvedMotion) -> RigMap:
    """The map that the joint tree of a file gives, under a name of its content.

    Raises:
        ClipError: the tree is no person's, or its joint names contradict its shape.
    """
    positions = sampled(motion)
    found = solve_rig(hierarchy, name_sides(hierarchy.joints), positions)
    _check(hierarchy, found, positions)
    rig = parse_rig(starter_map(hierarchy, found), "solved")
    content = json.dumps([dict(rig.joints), {joint: repr(rule) for joint, rule in rig.filled.items()}, rig.rest])
    name = PREFIX + hashlib.sha256(content.encode()).hexdigest()[:12]
    return replace(rig, name=name, description="solved from a joint tree")


def first_map(hierarchy: Hierarchy, motion: SolvedMotion) -> str:
    """TOML text of a rig map to edit: as the joint tree gives it, or else as names do."""
    found = solve_rig(hierarchy, name_sides(hierarchy.joints), sampled(motion)) or guess_joints(hierarchy)
    return starter_map(hierarchy, found)


def sampled(motion: SolvedMotion) -> Float64Array:
    """Positions [f, J, 3] of some frames of a motion, at even distances."""
    frames = np.unique(np.linspace(0, len(motion.positions) - 1, _FRAMES).round().astype(int))
    return np.asarray(motion.positions[frames], np.float64)


def _check(hierarchy: Hierarchy, found: Mapping[str, int], positions: Float64Array) -> None:
    if missing := [joint for joint in ("hips", *LIMBS) if joint not in found]:
        raise ClipError(f"no joint is clearly the {missing[0].replace('_', ' ')}")
    if not {"neck", "head"} & found.keys():
        raise ClipError("no joint is clearly the neck or the head")
    by_name = joints_by_name(hierarchy.joints)
    for place in found.values():
        if by_name[hierarchy.joints[place].casefold()] != place:
            raise ClipError(f"two joints are called {hierarchy.joints[place]}")
    names = bare_names(hierarchy.joints)
    for joint in LIMBS:
        limb, other = ("leg", "arm") if joint.endswith(("hip", "knee", "ankle")) else ("arm", "leg")
        name = names[found[joint]]
        if re.search(LIMB_WORDS[other], name) and not re.search(LIMB_WORDS[limb], name):
            raise ClipError(f"joint {hierarchy.joints[found[joint]]} is where the {joint.replace('_', ' ')} should be")
    lengths = [
        np.median([_far(positions, found, side, *pair) for side, pair in product(("left", "right"), pairs)]) * 2
        for pairs in ((("shoulder", "elbow"), ("elbow", "wrist")), (("hip", "knee"), ("knee", "ankle")))
    ]
    if not _ARM_TO_LEG[0] * lengths[1] <= lengths[0] <= _ARM_TO_LEG[1] * lengths[1]:
        raise ClipError(f"arms are {lengths[0] / max(lengths[1], 1e-12):.2g} times as long as legs")
    rest = chained(hierarchy.offsets, hierarchy.parents)[None]
    if not _stands(rest, found).any() and _stands(positions, found).mean() < _STANDING_FRAMES:
        raise ClipError("the body never stands on two legs")


def _far(positions: Float64Array, found: Mapping[str, int], side: str, one: str, other: str) -> float:
    a, b = (positions[:, found[f"{side}_{part}"]] for part in (one, other))
    return float(np.median(np.linalg.norm(a - b, axis=-1)))


def _stands(positions: Float64Array, found: Mapping[str, int]) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """[f] whether legs go on in the direction of the trunk."""

    def middle(part: str) -> Float64Array:
        return np.asarray(positions[:, [found[f"left_{part}"], found[f"right_{part}"]]].mean(axis=1), np.float64)

    trunk, legs = middle("hip") - middle("shoulder"), middle("ankle") - middle("hip")
    lengths = np.linalg.norm(trunk, axis=-1) * np.linalg.norm(legs, axis=-1)
    return np.asarray((trunk * legs).sum(axis=-1) > _STANDS * lengths)
