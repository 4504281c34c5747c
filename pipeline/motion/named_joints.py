"""The tree of joints that a file names without saying how they hang together: that of a known rig."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from motionlake.errors import ClipError
from motionlake.motion.rigs import RigMap, identify, joints_by_name, load_rigs
from motionlake.motion.skeleton import JOINTS, PARENTS


@dataclass(frozen=True)
class NamedTree:
    """Joints of a rig among the names of a file.

    Attributes:
        rig: the rig's name.
        places: index of each joint among the names, parents first.
        parents: for each joint its parent's place in `places`; -1 at the first.
        canonical: place in `places` of each canonical joint that the rig measures.
    """

    rig: str
    places: tuple[int, ...]
    parents: tuple[int, ...]
    canonical: Mapping[str, int]


@functools.cache
def _known() -> Mapping[str, RigMap]:
    return load_rigs()


def named_tree(names: Sequence[str]) -> NamedTree | None:
    """The joints of a known rig that these names are; None where they are no rig's.

    What a rig map does not name is left out; a joint hangs from the nearest one above it that the rig measures.
    """
    try:
        rig = identify(names, _known())
    except ClipError:
        return None
    by_name = joints_by_name(names)
    measured = {joint: by_name.get(name.casefold()) for joint, name in rig.joints.items()}
    places: list[int] = []
    parents: list[int] = []
    canonical: dict[str, int] = {}
    for index, joint in enumerate(JOINTS):
        place = measured.get(joint)
        if place is None:
            continue
        above = PARENTS[index]
        while above >= 0 and JOINTS[above] not in canonical:
            above = PARENTS[above]
        parents.append(canonical[JOINTS[above]] if above >= 0 else -1)
        canonical[joint] = len(places)
        places.append(place)
    return NamedTree(rig.name, tuple(places), tuple(parents), canonical)
