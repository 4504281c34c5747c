"""Which joint of an unknown joint tree is which canonical joint, by the shape of the tree and the lengths of its bones.

A body is a trunk that carries two pairs of limbs, each the mirror image of the other, and a head. The pair nearer to
the root is the legs. In a limb the two long bones that follow each other meet at the knee or the elbow. Joint names
are asked only for what the shape does not say: which side is the left one, and where the neck ends.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.clip import ChannelKind, Hierarchy
from motionlake.motion.rig_tree import LIMB, RigTree, forward
from motionlake.motion.rigs import bare_names
from motionlake.motion.skeleton import chained

# A limb is at least as long, as a share of the longest: fingers, eyes, skirts are not.
_LONG: Final = 0.35
# Two limbs are a pair where their bones differ by less than this share of their length; with names of both sides more.
_ALIKE: Final = 0.25
_NAMED_ALIKE: Final = 0.5
# Shoulders whose middle is nearer to the joint that carries them, as a share of their distance, and hardly above it:
# that joint is the neck.
_BETWEEN_SHOULDERS: Final = 0.4
_ABOVE: Final = 0.1
# Legs may hang on a pelvis beside the spine, so many joints below where both begin.
_BESIDE: Final = 1
_TIP: Final = re.compile(r"end|top|nub|site|tip")


@dataclass(frozen=True)
class _Pair:
    """Two limbs of one shape that hang on one joint: its index, and the joints of both from the body outwards."""

    carrier: int
    limbs: tuple[tuple[int, ...], tuple[int, ...]]
    length: float


def solve_rig(
    hierarchy: Hierarchy,
    sides: Sequence[str | None],
    positions: Float64Array | None = None,
    ends: Mapping[int, Float64Array] | None = None,
) -> dict[str, int]:
    """Canonical joint -> index of the file's joint, of those that the tree has; nothing where it is no body.

    Args:
        hierarchy: joint tree of a file.
        sides: "left", "right" or None of each joint, as its name says.
        positions: [F, J, 3] of the joints in some frames; None: those of the zero pose (a file of positions has none).
        ends: [F, 3] of the end sites of joints, where they are known.
    """
    if positions is None:
        if hierarchy.kind is ChannelKind.POSITIONS:
            return {}
        positions = chained(hierarchy.offsets, hierarchy.parents)[None]
    return _Body(hierarchy, sides, positions, ends or {}).solved()


class _Body(RigTree):
    def __init__(
        self, hierarchy: Hierarchy, sides: Sequence[str | None], positions: Float64Array,
        ends: Mapping[int, Float64Array],
    ) -> None:  # fmt: skip
        super().__init__(hierarchy, positions, ends)
        self.names = bare_names(hierarchy.joints)
        self.sides = sides

    def solved(self) -> dict[str, int]:
        both = self._legs_and_arms()
        if both is None:
            return {}
        legs, arms = both
        found = {"hips": self._fork(legs, arms)}
        for pair, sides, joints_of in zip(both, self._sides(legs, arms), (self._leg, self._arm), strict=True):
            for side, limb in zip(sides, pair.limbs, strict=True):
                found |= {f"{side}_{part}": joint for part, joint in joints_of(limb).items()}
        return found | self._trunk(legs, arms, found)

    # Limbs

    def _legs_and_arms(self) -> tuple[_Pair, _Pair] | None:
        """The two longest pairs, the nearer to the root first."""
        pairs = [pair for joint in range(len(self.parents)) for pair in self._pairs(joint)]
        if not pairs:
            return None
        longest = max(pair.length for pair in pairs)
        pairs = [pair for pair in pairs if pair.length >= _LONG * longest]
        fitting = [
            (legs, arms)
            for legs in pairs
            for arms in pairs
            if legs.carrier != arms.carrier and self._is_lower(legs, arms)
            and not set(self.above(arms.carrier)) & set().union(*legs.limbs)
        ]  # fmt: skip
        return max(fitting, key=lambda both: both[0].length + both[1].length, default=None)

    def _is_lower(self, legs: _Pair, arms: _Pair) -> bool:
        """Whether legs hang on the trunk that carries the arms, or on a joint beside its first bone."""
        fork = self._fork(legs, arms)
        below, higher = (self.above(pair.carrier).index(fork) for pair in (legs, arms))
        return below <= _BESIDE and below < higher

    def _fork(self, legs: _Pair, arms: _Pair) -> int:
        """The last joint above both pairs."""
        trunk = set(self.above(arms.carrier))
        return next(joint for joint in self.above(legs.carrier) if joint in trunk)

    def _pairs(self, carrier: int) -> list[_Pair]:
        if len(self.children[carrier]) < 2:
            return []
        limbs = [limb for child in self.children[carrier] if len(limb := self.longest(child)) >= LIMB]
        found = []
        for one, other in combinations(limbs, 2):
            lengths = [self.bones[list(limb)] for limb in (one, other)]
            total = float(min(bones.sum() for bones in lengths))
            said = self._said(one), self._said(other)
            if len(one) != len(other) or said[0] * said[1] > 0:
                continue
            alike = _NAMED_ALIKE if said[0] * said[1] < 0 else _ALIKE
            if total > 0 and float(np.abs(lengths[0] - lengths[1]).sum()) <= alike * total:
                found.append(_Pair(carrier, (one, other), total))
        return found

    def _leg(self, limb: tuple[int, ...]) -> dict[str, int]:
        hip, knee, ankle = self.long_bones(limb)
        toe = ankle + 1
        # A foot may be split as well.
        if toe + 1 < len(limb) and toe in self.halves(limb, [ankle, toe, toe + 1]):
            toe += 1
        places = {"hip": hip, "knee": knee, "ankle": ankle, "toe": toe}
        return {part: limb[place] for part, place in places.items() if place < len(limb)}

    def _arm(self, limb: tuple[int, ...]) -> dict[str, int]:
        shoulder, elbow, wrist = self.long_bones(limb)
        places = {"clavicle": shoulder - 1, "shoulder": shoulder, "elbow": elbow, "wrist": wrist}
        return {part: limb[place] for part, place in places.items() if 0 <= place < len(limb)}

    # Sides

    def _said(self, limb: tuple[int, ...]) -> int:
        """How many joints of a limb are called left, less those that are called right."""
        called = [self.sides[joint] for joint in limb]
        return called.count("left") - called.count("right")

    def _sides(self, legs: _Pair, arms: _Pair) -> tuple[tuple[str, str], tuple[str, str]]:
        """Sides of the legs and of the arms: as most names of a pair say; where they do not, as the other pair's do."""
        said = {pair: self._said(pair.limbs[0]) - self._said(pair.limbs[1]) for pair in (legs, arms)}
        along = 1 if (self._across(legs) * self._across(arms)).sum() > 0 else -1
        if not any(said.values()):
            said[legs] = self._faces(legs, arms)
        if not said[legs] or (said[legs] * said[arms] * along < 0 and abs(said[arms]) > abs(said[legs])):
            said[legs] = along * said[arms]
        elif not said[arms] or (said[legs] * said[arms] * along < 0 and abs(said[legs]) > abs(said[arms])):
            said[arms] = along * said[legs]
        left_first, right_first = ("left", "right"), ("right", "left")
        return (left_first if said[legs] > 0 else right_first), (left_first if said[arms] > 0 else right_first)

    def _faces(self, legs: _Pair, arms: _Pair) -> int:
        """1 where the first leg is the left one, else -1: as toes point, knees and elbows bend and hands are held."""
        limbs = [[self._long_joints(limb) for limb in pair.limbs] for pair in (legs, arms)]
        ahead = forward(limbs[0], [limb[:3] for limb in limbs[1]])
        feet = [limb[2] if limb[2] is not None else limb[1] for limb in limbs[0]]
        up = self.positions[:, legs.carrier] - np.mean([foot for foot in feet if foot is not None], axis=0)
        return 1 if (self._across(legs) * np.cross(up, ahead)).sum() > 0 else -1

    def _long_joints(self, limb: tuple[int, ...]) -> list[Float64Array | None]:
        """Where the long bones of a limb begin, meet and end, and what lies farthest beyond."""
        places = [self._at(limb, place) for place in self.long_bones(limb)]
        last = self._at(limb, len(limb) - 1 if self.long_bones(limb)[2] < len(limb) - 1 else len(limb))
        return [*places, last if places[2] is not last else None]

    def _at(self, limb: tuple[int, ...], place: int) -> Float64Array | None:
        return self.positions[:, limb[place]] if place < len(limb) else self.ends.get(limb[-1])

    def _across(self, pair: _Pair) -> Float64Array:
        """[F, 3] from the second limb to the first, where their long bones begin."""
        one, other = (self.positions[:, limb[self.long_bones(limb)[0]]] for limb in pair.limbs)
        return np.asarray(one - other, np.float64)

    # Trunk and head

    def _trunk(self, legs: _Pair, arms: _Pair, limbs: dict[str, int]) -> dict[str, int]:
        way = self.above(arms.carrier)
        trunk = way[: way.index(limbs["hips"])][::-1]
        head = self._head(arms, limbs)
        found: dict[str, int] = {}
        if "left_clavicle" not in limbs and self._carries_shoulders(arms, limbs):
            found["neck"] = trunk.pop()
        elif head:
            found["neck"] = head[0]
            head = head[1:]
        if head:
            found["head"] = next((joint for joint in head if "head" in self.names[joint]), self._last(head))
        if trunk and "neck" in found and found["neck"] == arms.carrier:
            found["spine"] = trunk[0]
            return found | ({"chest": trunk[-1]} if len(trunk) > 1 else {})
        if trunk:
            found["chest"] = trunk[-1]
        return found | ({"spine": trunk[0]} if len(trunk) > 1 else {})

    def _head(self, arms: _Pair, limbs: dict[str, int]) -> list[int]:
        """Joints from the chest to the head: of what the chest carries beside the arms, the longest."""
        taken = {limb[0] for limb in arms.limbs} | set(limbs.values())
        chains = [self.longest(child) for child in self.children[arms.carrier] if child not in taken]
        named = [chain for chain in chains if any(re.search("neck|head", self.names[joint]) for joint in chain)]
        chain = list(max(named or chains, key=lambda joints: float(self.bones[list(joints)].sum()), default=()))
        while len(chain) > 1 and _TIP.search(self.names[chain[-1]]):
            chain.pop()
        return chain

    def _last(self, chain: list[int]) -> int:
        """The head where no name says it: the last joint from which a bone starts."""
        for joint, following in pairwise(chain):
            if len(self.children[joint]) > 1:
                return joint
            if following == chain[-1] and following not in self.tips and not self.children[following] and self.tips:
                return joint
        return chain[-1]

    def _carries_shoulders(self, arms: _Pair, limbs: dict[str, int]) -> bool:
        shoulders = [limbs["left_shoulder"], limbs["right_shoulder"]]
        apart = np.linalg.norm(self.positions[:, shoulders[0]] - self.positions[:, shoulders[1]], axis=-1)
        off = self._middle(shoulders) - self.positions[:, arms.carrier]
        trunk = self.positions[:, arms.carrier] - self._middle([limbs["left_hip"], limbs["right_hip"]])
        above = (off * trunk).sum(axis=-1) / np.maximum(np.linalg.norm(trunk, axis=-1), 1e-12)
        near = np.median(np.linalg.norm(off, axis=-1)) < _BETWEEN_SHOULDERS * np.median(apart)
        return bool(near and np.median(above) < _ABOVE * np.median(apart))

    def _middle(self, joints: list[int]) -> Float64Array:
        return np.asarray(self.positions[:, joints].mean(axis=1), np.float64)
