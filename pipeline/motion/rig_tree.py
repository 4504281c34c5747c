"""The joints of a file as a tree with the lengths of its bones, and where in a limb of it the long bones are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Final, TypeAlias

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.clip import Hierarchy

# Limbs are chains of as many joints at least: hip, knee, ankle.
LIMB: Final = 3
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
# Of two pairs of bones that follow each other this nearly as long as the longest, the outer are the limb.
_NEARLY: Final = 0.65
# A chain of three joints that goes on in an end site: its first bone is a collar bone, or goes to a hip, where it is
# shorter than this share of the second and the end site is farther than this share of that.
_SHORT: Final = 0.8
_GOES_ON: Final = 0.6


class RigTree:
    """A joint tree in some frames.

    Attributes:
        positions: [F, J, 3] of the joints, in the units of the file.
        parents, children: of each joint.
        bones: [J] length of the bone that ends at each joint, median over the frames.
        onwards: of the joints that hang on each the one that reaches farthest.
        tips: how far from a joint its end sites are, at most; of those that have any.
        ends: [F, 3] where the farthest of them is, where that is known.
    """

    def __init__(
        self, hierarchy: Hierarchy, positions: Float64Array, ends: Mapping[int, Float64Array] | None = None
    ) -> None:
        self.ends = ends or {}
        self.parents = hierarchy.parents
        self.positions = positions
        self.children: list[list[int]] = [[] for _ in self.parents]
        above = [max(parent, 0) for parent in self.parents]
        self.bones = np.median(np.linalg.norm(positions - positions[:, above], axis=-1), axis=0)
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                self.children[parent].append(joint)
        # Parents come before what hangs on them.
        self.onwards: dict[int, int] = {}
        reach = self.bones.copy()
        for joint in range(len(self.parents) - 1, -1, -1):
            if self.children[joint]:
                self.onwards[joint] = max(self.children[joint], key=reach.__getitem__)
                reach[joint] += reach[self.onwards[joint]]
        self.tips: dict[int, float] = {}
        for joint, offset in hierarchy.end_sites:
            if length := float(np.linalg.norm(offset)):
                self.tips[joint] = max(length, self.tips.get(joint, 0.0))

    def above(self, joint: int) -> list[int]:
        """The joint and those above it, to the root."""
        chain = [joint]
        while self.parents[chain[-1]] >= 0:
            chain.append(self.parents[chain[-1]])
        return chain

    def longest(self, joint: int) -> tuple[int, ...]:
        """The chain of joints from here that reaches farthest along its bones."""
        chain = [joint]
        while chain[-1] in self.onwards:
            chain.append(self.onwards[chain[-1]])
        return tuple(chain)

    def long_bones(self, limb: tuple[int, ...]) -> tuple[int, int, int]:
        """Where the two long bones of a limb begin, meet and end, as places in the limb.

        The last is beyond the limb where the second bone ends in an end site.
        """
        lengths = self.bones[list(limb)]
        if self._ends_early(limb):
            return 1, 2, 3
        real = [0] + [place for place in range(1, len(limb)) if lengths[place] > _BONE * lengths.sum()]
        if len(real) < LIMB:
            return 0, 1, 2
        # Of joints in one place the last bears the bone.
        last = {place: following - 1 for place, following in pairwise(real)} | {real[-1]: real[-1]}
        lengths_found, found = self._pair_of_bones(limb, real, last)
        halves = self.halves(limb, real)
        whole = [place for place in real if place not in halves]
        if halves and len(whole) >= LIMB:
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
            places = last[real[i]], last[real[i + 1]], self._end(limb, real[i + 3 if split else i + 2], last)
            shares = tuple(float(lengths[one + 1 : other + 1].sum()) for one, other in pairwise(places))
            bones.append(((shares[0], shares[1]), places, split))
        # A long collar bone is followed by longer ones; a long hand of two bones looks like a split lower arm.
        longest = max(min(shares) for shares, *_ in bones)
        return next(
            (shares, places)
            for shares, places, split in reversed(bones)
            if min(shares) >= (longest if split else _NEARLY * longest)
        )

    def _end(self, limb: tuple[int, ...], place: int, last: Mapping[int, int]) -> int:
        """Which of joints in one place ends a limb: the first from which fingers part, as they do from a wrist."""
        together = range(place, last[place] + 1)
        return next((at for at in together if len(self.children[limb[at]]) > 1), last[place])

    def halves(self, limb: tuple[int, ...], real: list[int]) -> set[int]:
        """Places in a limb at which it never bends."""
        inner = zip(real, real[1:], real[2:], strict=False)
        return {b for a, b, c in inner if self.cosines(limb[a], limb[b], limb[c]).min() > _STRAIGHT}

    def _bends(self, limb: tuple[int, ...], start: int, middle: int, end: int) -> bool:
        return bool(self.cosines(limb[start], limb[middle], limb[end]).min() < _BENT)

    def _is_split(self, limb: tuple[int, ...], places: list[int]) -> bool:
        """Whether a lower limb goes on beyond its next joint, where files split it to turn one half on the other."""
        if len(places) < 3:
            return False
        middle, end, beyond = places
        upper, lower, more = (float(self.bones[limb[place]]) for place in places)
        short = lower < _SPLIT * upper and more > _HALF * lower
        return short and self._in_line(limb[middle], limb[end], limb[beyond])

    def _ends_early(self, limb: tuple[int, ...]) -> bool:
        """Whether the second long bone of a limb of three joints ends in an end site, for want of a joint there."""
        if len(limb) != LIMB:
            return False
        first, second = (float(bone) for bone in self.bones[list(limb[1:])])
        return first < _SHORT * second and self.tips.get(limb[-1], 0.0) > _GOES_ON * second

    def _in_line(self, start: int, middle: int, end: int) -> bool:
        return bool(np.median(self.cosines(start, middle, end)) > _IN_LINE)

    def cosines(self, start: int, middle: int, end: int) -> Float64Array:
        """[F] of the angle by which the bones from `start` and to `end` are out of line."""
        one, other = (self.positions[:, b] - self.positions[:, a] for a, b in ((start, middle), (middle, end)))
        norms = np.linalg.norm(one, axis=-1) * np.linalg.norm(other, axis=-1)
        return np.asarray((one * other).sum(axis=-1) / np.maximum(norms, 1e-12), np.float64)


# Positions [F, 3] of hip, knee, ankle and toe, or of shoulder, elbow and wrist; None for one that is nowhere.
Limb: TypeAlias = Sequence[Float64Array | None]


def forward(legs: Sequence[Limb], arms: Sequence[Limb]) -> Float64Array:
    """[F, 3] where a body faces: as toes point, knees and elbows bend and hands are held, and longer where clearer."""
    found: list[Float64Array] = []
    for sign, limbs in ((1.0, legs), (-1.0, arms)):
        for begin, middle, end, *beyond in limbs:
            if begin is not None and middle is not None and end is not None:
                found.append(sign * (middle - (begin + end) / 2))
            found += [toe - end for toe in beyond if toe is not None and end is not None]
    return np.asarray(np.sum(found, axis=0), np.float64)
