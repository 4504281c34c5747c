"""A made character with Mixamo's names: longer legs than most, three spine joints, a finger, a feather on its head."""

from __future__ import annotations

# Name -> parent and offset in centimetres; parents come first.
HERO: dict[str, tuple[str, tuple[float, float, float]]] = {
    "Hips": ("", (0, 104, 0)),
    "Spine": ("Hips", (0, 10, -1)), "Spine1": ("Spine", (0, 13, 0)), "Spine2": ("Spine1", (0, 13, 0)),
    "Neck": ("Spine2", (0, 16, 0)), "Head": ("Neck", (0, 9, 2)), "Feather": ("Head", (0, 30, -5)),
    "LeftShoulder": ("Spine2", (6, 12, 0)), "LeftArm": ("LeftShoulder", (12, 0, 0)),
    "LeftForeArm": ("LeftArm", (28, 0, 0)), "LeftHand": ("LeftForeArm", (26, 0, 0)),
    "LeftHandIndex1": ("LeftHand", (9, 0, 2)),
    "RightShoulder": ("Spine2", (-6, 12, 0)), "RightArm": ("RightShoulder", (-12, 0, 0)),
    "RightForeArm": ("RightArm", (-28, 0, 0)), "RightHand": ("RightForeArm", (-26, 0, 0)),
    "RightHandIndex1": ("RightHand", (-9, 0, 2)),
    "LeftUpLeg": ("Hips", (11, -6, 0)), "LeftLeg": ("LeftUpLeg", (0, -46, 1)), "LeftFoot": ("LeftLeg", (0, -44, -1)),
    "LeftToeBase": ("LeftFoot", (0, -6, 14)),
    "RightUpLeg": ("Hips", (-11, -6, 0)), "RightLeg": ("RightUpLeg", (0, -46, 1)),
    "RightFoot": ("RightLeg", (0, -44, -1)), "RightToeBase": ("RightFoot", (0, -6, 14)),
}  # fmt: skip


def hero_bvh() -> str:
    """The character as a BVH file of two frames in its zero pose, with channels in the order that Mixamo has."""
    rows = [" ".join(["0 104 0 0 0 0"] + ["0 0 0"] * (len(HERO) - 1))] * 2
    tree = "\n".join(_joint("Hips", 0))
    return f"HIERARCHY\n{tree}\nMOTION\nFrames: 2\nFrame Time: 0.0333333\n" + "\n".join(rows) + "\n"


def _joint(name: str, depth: int) -> list[str]:
    indent, (parent, offset) = "  " * depth, HERO[name]
    places = "" if parent else "Xposition Yposition Zposition "
    children = [child for child, (above, _) in HERO.items() if above == name]
    return [
        f"{indent}{'JOINT' if parent else 'ROOT'} {name}", indent + "{",
        f"{indent}  OFFSET {' '.join(map(str, offset))}",
        f"{indent}  CHANNELS {3 if parent else 6} {places}Zrotation Xrotation Yrotation",
        *(line for child in children for line in _joint(child, depth + 1)),
        *([] if children else [f"{indent}  End Site", indent + "  {", f"{indent}    OFFSET 0 4 0", indent + "  }"]),
        indent + "}",
    ]  # fmt: skip
