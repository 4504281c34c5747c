"""What each joint of a file is to its rig: the rows of the view `rig_joints`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from motionlake.motion.auto_rig import RigMatch
from motionlake.motion.rigs import RigMap, joints_by_name
from motionlake.motion.skeleton import JOINTS


@dataclass(frozen=True)
class RigJoint:
    """A joint of a file, or a canonical one that the file lacks.

    Attributes:
        joint: its name in the file; None for one that is filled in.
        canonical: which canonical joint it is; None for one that is none.
        how: "map" by a known rig map, "solved" by the joint tree, "filled" for what the rig lacks, "unused".
        confidence: of a solved one, 0 to 1.
        evidence: of a solved one, by its kind (`rig_evidence`).
    """

    joint: str | None
    canonical: str | None
    how: str
    confidence: float | None = None
    evidence: Mapping[str, float] = field(default_factory=dict)


def rig_joints(joint_names: Sequence[str], rig: RigMap, match: RigMatch | None = None) -> list[RigJoint]:
    """The canonical joints in their order, then the file's others.

    Args:
        joint_names: of the file.
        rig: its map, which fits.
        match: where the map was solved from the tree.
    """
    names = joints_by_name(joint_names)
    source = {canonical: names[name.casefold()] for canonical, name in rig.joints.items() if name.casefold() in names}
    return joints_of(joint_names, source, match)


def joints_of(joint_names: Sequence[str], source: Mapping[str, int], match: RigMatch | None = None) -> list[RigJoint]:
    """The same where it is known at which place of the file canonical joints are."""
    found = []
    for canonical in JOINTS:
        place = source.get(canonical)
        if place is None:
            found.append(RigJoint(None, canonical, "filled"))
        elif match is None:
            found.append(RigJoint(joint_names[place], canonical, "map"))
        else:
            said = match.confidence(canonical), match.evidence[canonical]
            found.append(RigJoint(joint_names[place], canonical, "solved", *said))
    used = set(source.values())
    return found + [RigJoint(name, None, "unused") for at, name in enumerate(joint_names) if at not in used]
