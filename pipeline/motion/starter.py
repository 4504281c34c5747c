"""A first rig map for an unknown joint tree, guessed from names and places in the tree."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Final

import numpy as np
from motionlake.motion.clip import ChannelKind, Hierarchy
from motionlake.motion.skeleton import JOINTS
from motionlake.names import toml_text

# In each limb the joints from the body outwards, with what their names contain.
_LEG: Final = (
    ("hip", r"up.*leg|thigh|femur|hip(?!joint)"),
    ("knee", r"knee|shin|calf|tibia|lo.*leg|leg"),
    ("ankle", r"ankle|foot"),
    ("toe", r"toe|ball|foot"),
)
_ARM: Final = (
    ("clavicle", r"clav|collar"),
    ("shoulder", r"up.*arm|shldr|humer|shoulder|arm"),
    ("elbow", r"elbow|fore|lo.*arm|radius"),
    ("wrist", r"wrist|hand"),
)
LIMB_WORDS: Final = {
    "leg": r"leg|thigh|femur|hip|butt|knee|shin|calf|tibia|ankle|foot|toe",
    "arm": r"arm|clav|collar|should|shldr|humer|elbow|radius|wrist|hand",
}
# Shares of the body height along x (left; mirrored for the right), y, z, for what is found nowhere.
_OFFSETS: Final = {
    "spine": (0.0, 0.08, 0.0), "chest": (0.0, 0.1, 0.0), "neck": (0.0, 0.15, 0.0), "head": (0.0, 0.09, 0.0),
    "clavicle": (0.02, 0.12, 0.0), "shoulder": (0.1, 0.0, 0.0),
    "elbow": (0.2, 0.0, 0.0), "wrist": (0.17, 0.0, 0.0),
    "hip": (0.06, -0.05, 0.0), "knee": (0.0, -0.28, 0.0),
    "ankle": (0.0, -0.28, 0.0), "toe": (0.0, -0.03, 0.09),
}  # fmt: skip
# Joints whose end site stands for the next one where a file lacks it.
_BEFORE: Final = {"toe": "ankle", "ankle": "knee", "wrist": "elbow"}
_IN_LINE: Final = 0.95  # cosine
_FINGER: Final = r"finger|thumb|index|mid|ring|pinky"


def starter_map(hierarchy: Hierarchy, guesses: Mapping[str, int]) -> str:
    """TOML text of a rig map for a clip of an unknown rig, to be checked and mended by a person.

    `parse_rig` reads it; canonical joints without a guess are filled by an offset.

    Args:
        hierarchy: joint tree of the clip.
        guesses: canonical joint -> index of the joint that is it.
    """
    others = [joint for index, joint in enumerate(hierarchy.joints) if index not in guesses.values()]
    rest = "positions" if hierarchy.kind is ChannelKind.POSITIONS else "zero"
    lines = [
        "# Guessed: check every line, above all [filled], up, metres_per_unit, rest; see docs/skeletons.md.",
        'name = "my_rig"',
        'description = "guessed by motionlake rig"',
        'source = "joint names of the file"',
        'up = "y"',
        'metres_per_unit = "file"',
        f"rest = {json.dumps(rest)}",
        "",
        "[joints]",
        *(f"{c} = {toml_text(hierarchy.joints[guesses[c]])}" for c in JOINTS if c in guesses),
        "",
        "[filled]",
        *(f"{c} = {_fill(c, guesses, hierarchy)}" for c in JOINTS if c not in guesses),
        "",
        "[known]",
        f"others = [{', '.join(map(toml_text, others))}]",
    ]
    return "\n".join(lines) + "\n"


def guess_joints(hierarchy: Hierarchy) -> dict[str, int]:
    """Canonical joint -> index of the file's joint, of those that names alone tell; always the hips."""
    guesses: dict[str, int] = {}
    sides = name_sides(hierarchy.joints)
    for side, (limb, parts) in product(("left", "right"), (("leg", _LEG), ("arm", _ARM))):
        joints = [
            index
            for index, name in enumerate(map(str.lower, hierarchy.joints))
            if sides[index] == side and re.search(LIMB_WORDS[limb], name) and not re.search(_FINGER, name)
        ]
        guesses.update({f"{side}_{part}": index for part, index in _limb(hierarchy, joints, parts).items()})
    trunk = _trunk(hierarchy, guesses, sides)
    # What both legs hang from may be called like a leg.
    return {joint: place for joint, place in guesses.items() if place != trunk["hips"]} | trunk


def name_sides(joints: Sequence[str]) -> list[str | None]:
    """ "left", "right" or None of each joint, as its name says."""
    return [_side(name) for name in joints]


def _side(name: str) -> str | None:
    bare = re.split(r"[:|]", name)[-1]
    for side in ("left", "right"):
        letter = side[0]
        marks = (
            side in bare.lower(),
            re.search(rf"(^|[_. -]){letter}([_. -]|$)", bare.lower()),
            re.search(rf"^({letter}|{letter.upper()})(?=[A-Z])", bare),
            re.search(rf"^{letter}({LIMB_WORDS['leg']}|{LIMB_WORDS['arm']})", bare),
        )
        if any(marks):
            return side
    return None


def _limb(hierarchy: Hierarchy, joints: list[int], parts: tuple[tuple[str, str], ...]) -> dict[str, int]:
    names = {index: re.split(r"[:|]", hierarchy.joints[index])[-1].lower() for index in joints}
    named_arm = sum(bool(re.search(r"arm|humer", n)) and not re.search(r"fore|lo.*arm", n) for n in names.values())
    found: dict[str, int] = {}
    start = 0
    for part, pattern in parts:
        # A "shoulder" inside an "arm" is the collar bone's joint.
        wanted = f"{pattern}|shoulder" if part == "clavicle" and named_arm else pattern
        match = next((i for i in range(start, len(joints)) if re.search(wanted, names[joints[i]])), None)
        if match is not None:
            found[part] = joints[match]
            start = match + 1
    return found


def _trunk(hierarchy: Hierarchy, limbs: dict[str, int], sides: list[str | None]) -> dict[str, int]:
    def ancestors(joint: int) -> list[int]:
        chain = [joint]
        while hierarchy.parents[chain[-1]] >= 0:
            chain.append(hierarchy.parents[chain[-1]])
        return chain

    found = {"hips": 0}
    if {"left_hip", "right_hip"} <= limbs.keys():
        right = ancestors(limbs["right_hip"])
        found["hips"] = next((j for j in ancestors(limbs["left_hip"]) if j in right), 0)
    middle = [index for index, side in enumerate(sides) if side is None]
    names = {index: hierarchy.joints[index].lower() for index in middle}
    taken = {*found.values(), *limbs.values()}
    heads = [i for i in middle if "head" in names[i] and not re.search(r"top|end|nub", names[i]) and i not in taken]
    top = heads[0] if heads else next((i for i in middle if "neck" in names[i]), None)
    chain = [j for j in reversed(ancestors(top)) if j not in taken and j > found["hips"]] if top is not None else []
    if heads:
        found["head"] = heads[0]
        chain = [j for j in chain if j != heads[0]]
    necks = [j for j in chain if "neck" in names.get(j, "")]
    if necks or len(chain) > 1:
        found["neck"] = necks[0] if necks else chain[-1]
        chain = chain[: chain.index(found["neck"])]
    if chain:
        found["chest"] = chain[-1]
    if len(chain) > 1:
        found["spine"] = chain[0]
    return found


def _is_heel(ankle: int, hierarchy: Hierarchy) -> bool:
    """Whether the end site of an ankle goes on in the direction of the shin, to the sole."""
    shin, foot = hierarchy.offsets[ankle], next(np.array(at) for joint, at in hierarchy.end_sites if joint == ankle)
    return bool(shin @ foot > _IN_LINE * np.linalg.norm(shin) * np.linalg.norm(foot))


def _fill(canonical: str, guesses: Mapping[str, int], hierarchy: Hierarchy) -> str:
    side, _, part = canonical.rpartition("_")
    ends = {joint for joint, _ in hierarchy.end_sites}
    before = {part: f"{side}_{joint}" for part, joint in _BEFORE.items()}.get(part, "neck" if part == "head" else "")
    if part == "clavicle" and {"neck", f"{side}_shoulder"} <= guesses.keys():
        return f'{{ between = ["neck", "{side}_shoulder"], at = 0.2 }}'
    if canonical == "spine" and "chest" in guesses:
        return '{ between = ["hips", "chest"], at = 0.5 }'
    if canonical == "chest" and {"spine", "neck"} <= guesses.keys():
        return '{ between = ["spine", "neck"], at = 0.5 }'
    if before in guesses and guesses[before] in ends and not (part == "toe" and _is_heel(guesses[before], hierarchy)):
        return f"{{ end_site = {toml_text(hierarchy.joints[guesses[before]])} }}"
    x, y, z = _OFFSETS[part]
    return f"{{ offset = [{-x if side == 'right' else x}, {y}, {z}] }}"
