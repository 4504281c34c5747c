"""What speaks for each joint of a solved rig map and what against it, and how sure it makes the map.

Each kind of evidence is a number from -1 (against) over 0 (says nothing) to 1 (for):

- name: the joint's name has a word for it, or for another joint;
- side: the names of the limb say this side, or the other;
- symmetry: the bone is as long as that of the other side; a joint of the trunk is half way between the sides;
- length: the bone is as long as a person's, as a share of the leg or the arm;
- motion: knees, elbows, toes and hands lie and bend as those of a body that faces where these sides say;
- margin: its limb would be a worse one if it began one joint on, or one before.

Joints of the trunk have neither side nor motion nor margin.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.clip import Hierarchy
from motionlake.motion.rig_tree import RigTree, forward
from motionlake.motion.rigs import bare_names
from motionlake.motion.starter import name_sides

KINDS: Final = ("name", "symmetry", "length", "side", "motion", "margin")
_FINGER: Final = r"thumb|index|middle|ring|pinky|little|finger"
# Words that names of a joint have, whatever the side.
_WORDS: Final = {
    "hips": r"hip|pelvis|root|cog|spine",
    "spine": r"spine|back|abdomen|waist|torso|chest",
    "chest": r"chest|spine|back|thorax|torso|rib|shoulder.?cent|^neck.?cent",
    "neck": r"neck|shoulder|head|spine",
    "head": r"head|face|skull|neck|spine",
    "clavicle": r"clav|collar|shoulder|scapula",
    "shoulder": r"up.*arm|^(?!.*(fore|low)).*arm|shldr|shoulder|humer",
    "elbow": r"elbow|fore|lo.*arm|radius|ulna",
    "wrist": rf"wrist|palm|^(?!.*({_FINGER})).*hand",
    "hip": r"up.*leg|thigh|femur|hip|^(?!.*low).*leg",
    "knee": r"knee|shin|calf|tibia|^(?!.*up).*leg",
    "ankle": r"ankle|foot",
    "toe": r"toe|ball|foot|metatars",
}
# Lengths of bones that persons have, as shares of the leg from hip to ankle, or of the arm from shoulder to wrist:
# joints where the bone begins and ends, least and most.
_LENGTHS: Final = {
    "hips": ("hips", "hip", 0.0, 0.35),
    "spine": ("hips", "spine", 0.0, 0.5),
    "chest": ("hips", "chest", 0.05, 0.85),
    "neck": ("hips", "neck", 0.35, 1.05),
    "head": ("neck", "head", 0.03, 0.4),
    "hip": ("hip", "knee", 0.4, 0.6),
    "knee": ("hip", "knee", 0.4, 0.6),
    "ankle": ("knee", "ankle", 0.4, 0.6),
    "toe": ("ankle", "toe", 0.05, 0.4),
    "clavicle": ("clavicle", "shoulder", 0.05, 0.45),
    "shoulder": ("shoulder", "elbow", 0.42, 0.62),
    "elbow": ("shoulder", "elbow", 0.42, 0.62),
    "wrist": ("elbow", "wrist", 0.38, 0.58),
}
_ARM: Final = ("clavicle", "shoulder", "elbow", "wrist")
_BEYOND: Final = 0.1  # a share that is out of the range by as much speaks against
_UNLIKE: Final = 0.12  # bones of the two sides that differ by this share say nothing, by twice as much against
_ASIDE: Final = 0.25  # joints of the trunk that are this far from the middle, as a share of the hips' width, likewise
_TRUNK: Final = ("hips", "spine", "chest", "neck", "head")
# What each kind adds to the logarithm of the odds that a joint is the right one, and what there is without any.
_PLACE: Final = {"name": 1.2, "symmetry": 0.6, "length": 1.0, "margin": 1.0}
_PLAIN: Final = 1.0
_CONTRARY: Final = 2.0  # times as much where it speaks against
_SIDE: Final = {"side": 4.0, "motion": 5.0}


def confidence(evidence: Mapping[str, float]) -> float:
    """How sure a joint is, 0 to 1, by its evidence: that it is the right one of its limb, and the limb of this side."""
    place = _PLAIN + sum(
        weight * evidence[kind] * (_CONTRARY if evidence[kind] < 0 else 1)
        for kind, weight in _PLACE.items()
        if kind in evidence
    )
    return _probability(place) * side_confidence(evidence)


def side_confidence(evidence: Mapping[str, float]) -> float:
    """How sure it is which side a joint is of; 1 in the middle."""
    if "side" not in evidence:
        return 1.0
    return _probability(sum(weight * evidence[kind] for kind, weight in _SIDE.items()))


def _probability(odds: float) -> float:
    return 1 / (1 + math.exp(-odds))


def evidence_of(
    hierarchy: Hierarchy,
    found: Mapping[str, int],
    positions: Float64Array,
    ends: Mapping[int, Float64Array] | None = None,
) -> dict[str, dict[str, float]]:
    """Evidence by its kind of every canonical joint of a map.

    Args:
        hierarchy: joint tree of a file.
        found: canonical joint -> index of the joint of the file: hips, hips' and shoulders' chains of both sides.
        positions: [F, J, 3] of the joints in some frames.
        ends: [F, 3] of the end sites of joints, where they are known.
    """
    return _Evidence(hierarchy, found, positions, ends or {}).all()


class _Evidence:
    def __init__(
        self, hierarchy: Hierarchy, found: Mapping[str, int], positions: Float64Array, ends: Mapping[int, Float64Array]
    ) -> None:
        self.tree = RigTree(hierarchy, positions, ends)
        self.found, self.positions = found, positions
        self.names, self.sides = bare_names(hierarchy.joints), name_sides(hierarchy.joints)
        self.leg, self.arm = (
            float(np.mean([self._far(f"{s}_{a}", f"{s}_{b}") + self._far(f"{s}_{b}", f"{s}_{c}") for s in _BOTH]))
            for a, b, c in (("hip", "knee", "ankle"), ("shoulder", "elbow", "wrist"))
        )
        self.across = self._at("left_hip") - self._at("right_hip")

    def all(self) -> dict[str, dict[str, float]]:
        faces = self._faces()
        every: dict[str, dict[str, float]] = {}
        for joint in self.found:
            side, _, part = joint.rpartition("_")
            said = {"name": self._name(joint, part), "symmetry": self._symmetry(joint, side, part)}
            said["length"] = self._length(side, part)
            if side:
                said |= {"side": self._side(side, part), "motion": faces, "margin": self._margin(side, part)}
            every[joint] = {kind: round(value, 3) for kind, value in said.items()}
        return every

    def _at(self, joint: str) -> Float64Array:
        return self.positions[:, self.found[joint]]

    def _far(self, one: str, other: str) -> float:
        """Median distance of two canonical joints; that of an end site for one that the file lacks."""
        if other not in self.found:
            return self.tree.tips.get(self.found.get(one, -1), 0.0)
        if one not in self.found:
            return 0.0
        return float(np.median(np.linalg.norm(self._at(one) - self._at(other), axis=-1)))

    def _name(self, joint: str, part: str) -> float:
        names = [self.names[place] for place in self._in_place(self.found[joint])]
        if any(re.search(_WORDS[part], name) for name in names):
            return 1.0
        return -1.0 if any(re.search(words, name) for words in (_FINGER, *_WORDS.values()) for name in names) else 0.0

    def _in_place(self, joint: int) -> list[int]:
        """The joint, and those before and after it that are in its place."""
        bones, found = self.tree.bones, [joint, *(j for j in self.tree.children[joint] if not self.tree.bones[j])]
        while self.tree.parents[joint] >= 0 and not bones[joint]:
            joint = self.tree.parents[joint]
            found.append(joint)
        return found

    def _side(self, side: str, part: str) -> float:
        """Share of the named joints of the limb that are called by its side, less those by the other."""
        parts = _ARM if part in _ARM else ("hip", "knee", "ankle", "toe")
        called = [self.sides[self.found[name]] for name in (f"{side}_{p}" for p in parts) if name in self.found]
        said = [1.0 if name == side else -1.0 for name in called if name]
        return sum(said) / len(said) if said else 0.0

    def _symmetry(self, joint: str, side: str, part: str) -> float:
        if side:
            lengths = [self._bone(f"{each}_", part) for each in _BOTH]
            return 1 - abs(lengths[0] - lengths[1]) / max(_UNLIKE * sum(lengths) / 2, 1e-12) if all(lengths) else 0.0
        middle = (self._at("left_hip") + self._at("right_hip")) / 2
        width = np.linalg.norm(self.across, axis=-1)
        off = np.abs(((self._at(joint) - middle) * self.across).sum(axis=-1)) / np.maximum(width**2, 1e-12)
        return max(-1.0, 1 - float(np.median(off)) / _ASIDE)

    def _bone(self, side: str, part: str) -> float:
        start, end, *_ = _LENGTHS[part]
        return self._far(side + start, side + end)

    def _length(self, side: str, part: str) -> float:
        start, end, least, most = _LENGTHS[part]
        prefix, whole = (f"{side}_" if side else ""), self.arm if part in _ARM else self.leg
        if part == "hips":
            end = "left_hip"
        if prefix + start not in self.found or not whole:
            return 0.0
        length = self._far(prefix + start, prefix + end)
        if not length and part not in ("hips", "spine"):
            return 0.0
        share = length / whole
        return max(-1.0, 1 - 2 * max(least - share, share - most, 0.0) / _BEYOND)

    def _margin(self, side: str, part: str) -> float:
        """How much shorter the shorter of the two long bones would be if the limb began one joint on, or one before."""
        begin, middle, end = (f"{side}_{p}" for p in (_ARM[1:] if part in _ARM else ("hip", "knee", "ankle")))
        bones = self._far(begin, middle), self._far(middle, end)
        start, stop = self.found[begin], self.found.get(end, -1)
        before = float(self.tree.bones[start]) if self.tree.parents[start] != self.found["hips"] else 0.0
        beyond = float(self.tree.bones[self.tree.onwards[stop]]) if stop in self.tree.onwards else 0.0
        worse = max(min(before, bones[0]), min(bones[1], beyond))
        return max(-1.0, 1 - 1.25 * worse / max(min(bones), 1e-12)) if min(bones) else 0.0

    def _faces(self) -> float:
        """How well the body faces where its sides say, as toes point, knees and elbows bend and hands are held."""
        legs, arms = (
            [[self._end(f"{side}_{part}", f"{side}_{before}") for before, part in parts] for side in _BOTH]
            for parts in (_LEG_BONES, _ARM_BONES)
        )
        ahead = forward(legs, arms)
        feet = [self._at(f"{side}_{'ankle' if f'{side}_ankle' in self.found else 'knee'}") for side in _BOTH]
        turned = np.cross(self._at("hips") - np.mean(feet, axis=0), ahead)
        sizes = np.linalg.norm(self.across, axis=-1) * np.linalg.norm(turned, axis=-1)
        return float((self.across * turned).sum() / max(sizes.sum(), 1e-12))

    def _end(self, joint: str, before: str) -> Float64Array | None:
        """Where a joint is, or the end site of the one before that stands for it."""
        return self._at(joint) if joint in self.found else self.tree.ends.get(self.found.get(before, -1))


_BOTH: Final = ("left", "right")
_LEG_BONES: Final = (("", "hip"), ("", "knee"), ("knee", "ankle"), ("ankle", "toe"))
_ARM_BONES: Final = (("", "shoulder"), ("", "elbow"), ("elbow", "wrist"))
