"""Which joint of an unknown joint tree is which canonical joint, by the shape of the tree and the lengths of its bones.

A body is a trunk that carries two pairs of limbs, each the mirror image of the other, and a head. The pair nearer to
the root is the legs. In a limb the two long bones that follow each other meet at the knee or the elbow. Joint names
are asked only for what the shape does not say: which side is the left one, and where the neck ends.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.clip import ChannelKind, Hierarchy
from motionlake.motion.rigs import bare_names
from motionlake.motion.skeleton import chained

# Limbs are chains of as many joints at least: hip, knee, ankle.
_LIMB: Final = 3
# A limb is at least as long, as a share of the longest: fingers, eyes, skirts are not.
_LONG: Final = 0.35
# Two limbs are a pair where their bones differ by less than this share of their length; with names of both sides more.
_ALIKE: Final = 0.25
_NAMED_ALIKE: Final = 0.5
# A bone shorter than this share of its limb is none: two joints in one place.
_BONE: Final = 0.03
# A lower arm shorter than this share of the upper arm goes on beyond the next joint where the bone from there is in
# line with it, and no hand: at least this share of it.
_SPLIT: Final = 0.8
_HALF: Final = 0.4
_IN_LINE: Final = 0.95  # cosine
# A joint that stays this straight in all frames turns half of a bone on the other half, where the long bones that
# this leaves are alike and the joint where they meet does bend: their lengths, and cosines of angles.
_STRAIGHT: Final = 0.9998
_BENT: Final = 0.99
_EVEN: Final = 0.6
# Shoulders whose middle is nearer to the joint that carries them, as a share of their distance, and hardly above it:
# that joint is the neck.
_BETWEEN_SHOULDERS: Final = 0.4
_ABOVE: Final = 0.1
# Legs may hang on a pelvis beside the spine, so many joints below where both begin.
_BESIDE: Final = 1
# Of two pairs of bones that follow each other this nearly as long as the longest, the outer are the limb.
_NEARLY: Final = 0.65
_TIP: Final = re.compile(r"end|top|nub|site|tip")


@dataclass(frozen=True)
class _Pair:
    """Two limbs of one shape that hang on one joint: its index, and the joints of both from the body outwards."""

    carrier: int
    limbs: tuple[tuple[int, ...], tuple[int, ...]]
    length: float


def solve_rig(
    hierarchy: Hierarchy, sides: Sequence[str | None], positions: Float64Array | None = None
) -> dict[str, int]:
    """Canonical joint -> index of the file's joint, of those that the tree has; nothing where it is no body.

    Args:
        hierarchy: joint tree of a file.
        sides: "left", "right" or None of each joint, as its name says.
        positions: [F, J, 3] of the joints in some frames; None: those of the zero pose (a file of positions has none).
    """
    if positions is None:
        if hierarchy.kind is ChannelKind.POSITIONS:
            return {}
        positions = chained(hierarchy.offsets, hierarchy.parents)[None]
    return _Body(hierarchy, sides, positions).solved()


class _Body:
    def __init__(self, hierarchy: Hierarchy, sides: Sequence[str | None], positions: Float64Array) -> None:
        self.parents = hierarchy.parents
        self.names = bare_names(hierarchy.joints)
        self.sides = sides
        self.positions = positions
        self.children: list[list[int]] = [[] for _ in self.parents]
        above = [max(parent, 0) for parent in self.parents]
        self.bones = np.median(np.linalg.norm(positions - positions[:, above], axis=-1), axis=0)
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                self.children[parent].append(joint)
        # Of the joints that hang on each the one that reaches farthest; parents come before what hangs on them.
        self.onwards: dict[int, int] = {}
        reach = self.bones.copy()
        for joint in range(len(self.parents) - 1, -1, -1):
            if self.children[joint]:
                self.onwards[joint] = max(self.children[joint], key=reach.__getitem__)
                reach[joint] += reach[self.onwards[joint]]
        self.tips = {joint for joint, offset in hierarchy.end_sites if np.linalg.norm(offset) > 0}

    def solved(self) -> dict[str, int]:
        pair = self._legs_and_arms()
        if pair is None:
            return {}
        legs, arms = pair
        found = {"hips": self._fork(legs, arms)}
        sides = self._leg_sides(legs, arms)
        for side, limb in zip(sides, legs.limbs, strict=True):
            found |= {f"{side}_{part}": joint for part, joint in self._leg(limb).items()}
        for side, limb in zip(self._arm_sides(arms, legs, sides), arms.limbs, strict=True):
            found |= {f"{side}_{part}": joint for part, joint in self._arm(limb).items()}
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
            and not set(self._above(arms.carrier)) & set().union(*legs.limbs)
        ]  # fmt: skip
        return max(fitting, key=lambda both: both[0].length + both[1].length, default=None)

    def _is_lower(self, legs: _Pair, arms: _Pair) -> bool:
        """Whether legs hang on the trunk that carries the arms, or on a joint beside its first bone."""
        fork = self._fork(legs, arms)
        below, higher = (self._above(pair.carrier).index(fork) for pair in (legs, arms))
        return below <= _BESIDE and below < higher

    def _fork(self, legs: _Pair, arms: _Pair) -> int:
        """The last joint above both pairs."""
        trunk = set(self._above(arms.carrier))
        return next(joint for joint in self._above(legs.carrier) if joint in trunk)

    def _pairs(self, carrier: int) -> list[_Pair]:
        if len(self.children[carrier]) < 2:
            return []
        limbs = [limb for child in self.children[carrier] if len(limb := self._longest(child)) >= _LIMB]
        found = []
        for one, other in combinations(limbs, 2):
            lengths = [self.bones[list(limb)] for limb in (one, other)]
            total = float(min(bones.sum() for bones in lengths))
            said = {self.sides[one[1]], self.sides[other[1]]}
            if len(one) != len(other) or (said != {None} and said != {"left", "right"}):
                continue
            alike = _ALIKE if said == {None} else _NAMED_ALIKE
            if total > 0 and float(np.abs(lengths[0] - lengths[1]).sum()) <= alike * total:
                found.append(_Pair(carrier, (one, other), total))
        return found

    def _longest(self, joint: int) -> tuple[int, ...]:
        """The chain of joints from here that reaches farthest along its bones."""
        chain = [joint]
        while chain[-1] in self.onwards:
            chain.append(self.onwards[chain[-1]])
        return tuple(chain)

    def _long_bones(self, limb: tuple[int, ...]) -> tuple[int, int, int]:
        """Where the two long bones of a limb begin, meet and end, as places in the limb."""
        lengths = self.bones[list(limb)]
        real = [0] + [place for place in range(1, len(limb)) if lengths[place] > _BONE * lengths.sum()]
        if len(real) < _LIMB:
            return 0, 1, 2
        # Of joints in one place the last bears the bone.
        last = {place: following - 1 for place, following in pairwise(real)} | {real[-1]: real[-1]}
        lengths_found, found = self._pair_of_bones(limb, real, last)
        halves = self._halves(limb, real)
        whole = [place for place in real if place not in halves]
        if halves and len(whole) >= _LIMB:
            longer, places = self._pair_of_bones(limb, whole, last)
            much = _SPLIT * min(longer) > min(lengths_found)
            if much and min(longer) >= _EVEN * max(longer) and self._bends(limb, *places):
                return places
        return found

    def _pair_of_bones(
        self, limb: tuple[int, ...], real: list[int], last: dict[int, int]
    ) -> tuple[tuple[float, float], tuple[int, int, int]]:
        """Lengths of the two long bones of a limb, and where they begin, meet and end."""
        lengths = self.bones[list(limb)]
        bones = []
        for i in range(len(real) - 2):
            split = self._is_split(limb, real[i + 1 : i + 4])
            places = last[real[i]], last[real[i + 1]], last[real[i + 3 if split else i + 2]]
            shares = tuple(float(lengths[one + 1 : other + 1].sum()) for one, other in pairwise(places))
            bones.append(((shares[0], shares[1]), places, split))
        # A long collar bone is followed by longer ones; a long hand of two bones looks like a split lower arm.
        longest = max(min(shares) for shares, *_ in bones)
        return next(
            (shares, places)
            for shares, places, split in reversed(bones)
            if min(shares) >= (longest if split else _NEARLY * longest)
        )

    def _halves(self, limb: tuple[int, ...], real: list[int]) -> set[int]:
        """Places in a limb at which it never bends."""
        inner = zip(real, real[1:], real[2:], strict=False)
        return {b for a, b, c in inner if self._cosines(limb[a], limb[b], limb[c]).min() > _STRAIGHT}

    def _bends(self, limb: tuple[int, ...], start: int, middle: int, end: int) -> bool:
        return bool(self._cosines(limb[start], limb[middle], limb[end]).min() < _BENT)

    def _is_split(self, limb: tuple[int, ...], places: list[int]) -> bool:
        """Whether a lower limb goes on beyond its next joint, where files split it to turn one half on the other."""
        if len(places) < 3:
            return False
        middle, end, beyond = places
        upper, lower, more = (float(self.bones[limb[place]]) for place in places)
        short = lower < _SPLIT * upper and more > _HALF * lower
        return short and self._in_line(limb[middle], limb[end], limb[beyond])

    def _leg(self, limb: tuple[int, ...]) -> dict[str, int]:
        hip, knee, ankle = self._long_bones(limb)
        toe = ankle + 1
        # A foot may be split as well.
        if toe + 1 < len(limb) and toe in self._halves(limb, [ankle, toe, toe + 1]):
            toe += 1
        places = {"hip": hip, "knee": knee, "ankle": ankle, "toe": toe}
        return {part: limb[place] for part, place in places.items() if place < len(limb)}

    def _arm(self, limb: tuple[int, ...]) -> dict[str, int]:
        shoulder, elbow, wrist = self._long_bones(limb)
        found = {"shoulder": limb[shoulder], "elbow": limb[elbow], "wrist": limb[wrist]}
        return found | ({"clavicle": limb[shoulder - 1]} if shoulder else {})

    def _in_line(self, start: int, middle: int, end: int) -> bool:
        return bool(np.median(self._cosines(start, middle, end)) > _IN_LINE)

    def _cosines(self, start: int, middle: int, end: int) -> Float64Array:
        """[F] of the angle by which the bones from `start` and to `end` are out of line."""
        one, other = (self.positions[:, b] - self.positions[:, a] for a, b in ((start, middle), (middle, end)))
        norms = np.linalg.norm(one, axis=-1) * np.linalg.norm(other, axis=-1)
        return np.asarray((one * other).sum(axis=-1) / np.maximum(norms, 1e-12), np.float64)

    # Sides

    def _sides_of(self, pair: _Pair) -> tuple[str, str] | None:
        """Side of each limb of a pair, as names say."""
        match self.sides[pair.limbs[0][1]]:
            case "left":
                return "left", "right"
            case "right":
                return "right", "left"
        return None

    def _leg_sides(self, legs: _Pair, arms: _Pair) -> tuple[str, str]:
        """Side of each leg: as names say, or else as toes point, knees and elbows bend and hands are held."""
        said = self._sides_of(legs)
        if said is not None:
            return said
        forward = np.zeros((len(self.positions), 3))
        ankles = []
        for limb in legs.limbs:
            hip, knee, ankle = (self.positions[:, limb[place]] for place in self._long_bones(limb))
            forward += knee - (hip + ankle) / 2 + self.positions[:, limb[-1]] - ankle
            ankles.append(ankle)
        for limb in arms.limbs:
            shoulder, elbow, wrist = (self.positions[:, limb[place]] for place in self._long_bones(limb))
            forward += (shoulder + wrist) / 2 - elbow
        up = self.positions[:, legs.carrier] - np.mean(ankles, axis=0)
        return ("left", "right") if (self._across(legs) * np.cross(up, forward)).sum() > 0 else ("right", "left")

    def _arm_sides(self, arms: _Pair, legs: _Pair, of_legs: tuple[str, str]) -> tuple[str, str]:
        """Side of each arm: as names say, or else that of the leg on the same side of the body."""
        said = self._sides_of(arms)
        if said is not None:
            return said
        return of_legs if (self._across(legs) * self._across(arms)).sum() > 0 else (of_legs[1], of_legs[0])

    def _across(self, pair: _Pair) -> Float64Array:
        """[F, 3] from the second limb to the first, where their long bones begin."""
        one, other = (self.positions[:, limb[self._long_bones(limb)[0]]] for limb in pair.limbs)
        return np.asarray(one - other, np.float64)

    # Trunk and head

    def _trunk(self, legs: _Pair, arms: _Pair, limbs: dict[str, int]) -> dict[str, int]:
        way = self._above(arms.carrier)
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
        chains = [self._longest(child) for child in self.children[arms.carrier] if child not in taken]
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

    def _above(self, joint: int) -> list[int]:
        """The joint and those above it, to the root."""
        chain = [joint]
        while self.parents[chain[-1]] >= 0:
            chain.append(self.parents[chain[-1]])
        return chain
