"""Rig maps for files that no known map fits: solved from the joint tree, and taken where they leave no doubt."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.motion.clip import Hierarchy, SolvedMotion, SourceClip
from motionlake.motion.kinematics import with_end_sites
from motionlake.motion.rig_evidence import confidence, evidence_of, side_confidence
from motionlake.motion.rig_solver import solve_rig
from motionlake.motion.rigs import RigMap, bare_names, identify, joints_by_name, parse_rig, placeable
from motionlake.motion.rigs_config import RigsConfig
from motionlake.motion.skeleton import chained
from motionlake.motion.starter import LIMB_WORDS, guess_joints, name_sides, starter_map
from numpy.typing import NDArray

PREFIX: Final = "auto:"
NOTE: Final = "rig map solved from the joint tree; `motionlake rig FILE` prints it"
PICTURE: Final = "`motionlake rig FILE --picture skeleton.png` draws it"
DEFAULT: Final = RigsConfig()
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


@dataclass(frozen=True)
class RigMatch:
    """What the joint tree of a file gives.

    Attributes:
        joints: canonical joint -> index of the joint of the file; empty where the tree is no body.
        evidence: of each of them, by its kind (`rig_evidence`).
        doubt: why no clip is taken in by it; "" where clips are.
    """

    joints: Mapping[str, int]
    evidence: Mapping[str, Mapping[str, float]]
    doubt: str = ""

    def confidence(self, joint: str) -> float:
        """How sure a canonical joint is, 0 to 1."""
        return round(confidence(self.evidence[joint]), 3)

    @property
    def sides(self) -> float:
        """How sure it is which side is the left one: of the limb that is the least sure."""
        return min((side_confidence(said) for said in self.evidence.values()), default=0.0)


def rig_of(clip: SourceClip, motion: SolvedMotion, rigs: Mapping[str, RigMap], name: str | None = None) -> RigMap:
    """The rig of a clip, as `find_rig`."""
    return find_rig(clip, motion, rigs, name)[0]


def find_rig(
    clip: SourceClip,
    motion: SolvedMotion,
    rigs: Mapping[str, RigMap],
    name: str | None = None,
    config: RigsConfig = DEFAULT,
) -> tuple[RigMap, RigMatch | None]:
    """The rig of a clip: a known map that fits (`identify`), else the one that its tree gives, called auto:HASH, with
    what speaks for it.

    Raises:
        UserError: there is no map called `name`.
        ClipError: no map fits, and the tree leaves in doubt what is what; the reason says both.
    """
    known = rigs if name is not None else placeable(clip.hierarchy, rigs)
    try:
        return identify(clip.hierarchy.joints, known, name), None
    except ClipError as unknown:
        match = match_rig(clip.hierarchy, motion, config)
        if match.doubt:
            raise ClipError(f"{unknown}; it was not solved by itself: {match.doubt}; {PICTURE}") from unknown
        return solved_map(clip.hierarchy, match), match


def auto_rig(hierarchy: Hierarchy, motion: SolvedMotion) -> RigMap:
    """The map that the joint tree of a file gives, under a name of its content, however sure it is.

    Raises:
        ClipError: the tree is no person's, or its joint names contradict its shape.
    """
    match = match_rig(hierarchy, motion, RigsConfig(least_confidence=0.0))
    if match.doubt:
        raise ClipError(match.doubt)
    return solved_map(hierarchy, match)


def match_rig(hierarchy: Hierarchy, motion: SolvedMotion, config: RigsConfig = DEFAULT) -> RigMatch:
    """Which joint of a file is which, as far as its tree tells, with what speaks for and against it."""
    positions, ends = sampled(motion), sampled_ends(hierarchy, motion)
    found = solve_rig(hierarchy, name_sides(hierarchy.joints), positions, ends)
    evidence = evidence_of(hierarchy, found, positions, ends) if found else {}
    match = RigMatch(found, evidence)
    try:
        _check(hierarchy, found, positions)
        _check_sure(hierarchy, match, config.least_confidence)
    except ClipError as doubt:
        return replace(match, doubt=str(doubt))
    return match


def solved_map(hierarchy: Hierarchy, match: RigMatch) -> RigMap:
    """The rig map of a match, under a name of its content."""
    rig = parse_rig(starter_map(hierarchy, match.joints), "solved")
    content = json.dumps([dict(rig.joints), {joint: repr(rule) for joint, rule in rig.filled.items()}, rig.rest])
    name = PREFIX + hashlib.sha256(content.encode()).hexdigest()[:12]
    return replace(rig, name=name, description="solved from a joint tree")


def notes_of(match: RigMatch, config: RigsConfig = DEFAULT) -> tuple[str, ...]:
    """What a person should know of a clip that was taken in by a solved map."""
    doubt = f"left and right are in doubt: {match.sides:.0%} sure"
    return (NOTE, doubt) if match.sides < config.sides_in_doubt else (NOTE,)


def first_map(hierarchy: Hierarchy, motion: SolvedMotion) -> str:
    """TOML text of a rig map to edit: as the joint tree gives it, or else as names do."""
    ends = sampled_ends(hierarchy, motion)
    found = solve_rig(hierarchy, name_sides(hierarchy.joints), sampled(motion), ends) or guess_joints(hierarchy)
    return starter_map(hierarchy, found)


def sampled(motion: SolvedMotion) -> Float64Array:
    """Positions [f, J, 3] of some frames of a motion, at even distances."""
    return np.asarray(motion.positions[_sampled(motion)], np.float64)


def sampled_ends(hierarchy: Hierarchy, motion: SolvedMotion) -> dict[int, Float64Array]:
    """[f, 3] of the farthest end site of each joint that has one, in the same frames."""
    if motion.world is None:
        return {}
    frames = _sampled(motion)
    some = SolvedMotion(motion.positions[frames], None, motion.world[frames])
    positions, parents = with_end_sites(hierarchy, some)
    sites = sorted(
        enumerate(hierarchy.end_sites, start=len(hierarchy.joints)), key=lambda site: np.linalg.norm(site[1][1])
    )
    return {parents[place]: positions[:, place] for place, _ in sites}


def _sampled(motion: SolvedMotion) -> NDArray[np.int64]:
    return np.unique(np.linspace(0, len(motion.positions) - 1, _FRAMES).round().astype(np.int64))


def _check(hierarchy: Hierarchy, found: Mapping[str, int], positions: Float64Array) -> None:
    if missing := [joint for joint in ("hips", *LIMBS) if joint not in found and not _ends(hierarchy, found, joint)]:
        raise ClipError(f"no joint is clearly the {missing[0].replace('_', ' ')}")
    if not {"neck", "head"} & found.keys():
        raise ClipError("no joint is clearly the neck or the head")
    by_name = joints_by_name(hierarchy.joints)
    for place in found.values():
        if by_name[hierarchy.joints[place].casefold()] != place:
            raise ClipError(f"two joints are called {hierarchy.joints[place]}")
    names = bare_names(hierarchy.joints)
    for joint in (joint for joint in LIMBS if joint in found):
        limb, other = ("leg", "arm") if joint.endswith(("hip", "knee", "ankle")) else ("arm", "leg")
        name = names[found[joint]]
        if re.search(LIMB_WORDS[other], name) and not re.search(LIMB_WORDS[limb], name):
            raise ClipError(f"joint {hierarchy.joints[found[joint]]} is where the {joint.replace('_', ' ')} should be")
    lengths = [
        np.median(
            [
                _far(positions, found[f"{side}_{one}"], found[f"{side}_{other}"])
                for side, (one, other) in product(("left", "right"), pairs)
                if f"{side}_{other}" in found
            ]
        )
        * 2
        for pairs in ((("shoulder", "elbow"), ("elbow", "wrist")), (("hip", "knee"), ("knee", "ankle")))
    ]
    if not _ARM_TO_LEG[0] * lengths[1] <= lengths[0] <= _ARM_TO_LEG[1] * lengths[1]:
        raise ClipError(f"arms are {lengths[0] / max(lengths[1], 1e-12):.2g} times as long as legs")
    rest = chained(hierarchy.offsets, hierarchy.parents)[None]
    if not _stands(rest, found).any() and _stands(positions, found).mean() < _STANDING_FRAMES:
        raise ClipError("the body never stands on two legs")


def _check_sure(hierarchy: Hierarchy, match: RigMatch, least: float) -> None:
    sure = {joint: match.confidence(joint) for joint in ("hips", *LIMBS) if joint in match.joints}
    doubts = [
        f"{joint.replace('_', ' ')} ({hierarchy.joints[match.joints[joint]]}, {sure[joint]:.0%} sure)"
        for joint in sure
        if sure[joint] < least
    ]
    if doubts:
        raise ClipError(f"in doubt {'is' if len(doubts) == 1 else 'are'} {', '.join(doubts)}")


def _ends(hierarchy: Hierarchy, found: Mapping[str, int], joint: str) -> bool:
    """Whether the end site of an elbow or a knee stands for a wrist or an ankle that a file lacks."""
    side, _, part = joint.rpartition("_")
    before = found.get(f"{side}_{'elbow' if part == 'wrist' else 'knee'}")
    return part in ("wrist", "ankle") and any(at == before for at, _ in hierarchy.end_sites)


def _far(positions: Float64Array, one: int, other: int) -> float:
    return float(np.median(np.linalg.norm(positions[:, one] - positions[:, other], axis=-1)))


def _stands(positions: Float64Array, found: Mapping[str, int]) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """[f] whether legs go on in the direction of the trunk."""

    def middle(part: str) -> Float64Array:
        return np.asarray(positions[:, [found[f"left_{part}"], found[f"right_{part}"]]].mean(axis=1), np.float64)

    foot = "ankle" if {"left_ankle", "right_ankle"} <= found.keys() else "knee"
    trunk, legs = middle("hip") - middle("shoulder"), middle(foot) - middle("hip")
    lengths = np.linalg.norm(trunk, axis=-1) * np.linalg.norm(legs, axis=-1)
    return np.asarray((trunk * legs).sum(axis=-1) > _STANDS * lengths)
