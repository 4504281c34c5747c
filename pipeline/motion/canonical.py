"""The canonical skeleton: 21 joints that every supported rig can fill, and the papers' joint sets in it.

Why these 21: the union of the joint sets of the papers (Deep Motifs section 5.1, 16 informative joints;
PESTA section 5.1, root, thorax, head, clavicles, humeri, radii, wrists, femurs, tibiae, feet), closed under
"parent of", with the toes, which foot contact needs. More spine joints would be invented for most rigs.

World: metres, y up, right-handed. Canonical rest pose: T-pose facing +z, the body's left towards +x.
"""

from __future__ import annotations

from typing import Final

JOINTS: Final[tuple[str, ...]] = (
    "hips", "spine", "chest", "neck", "head",
    "left_clavicle", "left_shoulder", "left_elbow", "left_wrist",
    "right_clavicle", "right_shoulder", "right_elbow", "right_wrist",
    "left_hip", "left_knee", "left_ankle", "left_toe",
    "right_hip", "right_knee", "right_ankle", "right_toe",
)  # fmt: skip
PARENTS: Final[tuple[int, ...]] = (-1, 0, 1, 2, 3, 2, 5, 6, 7, 2, 9, 10, 11, 0, 13, 14, 15, 0, 17, 18, 19)
INDEX: Final[dict[str, int]] = {name: i for i, name in enumerate(JOINTS)}

# Direction of the bone from a joint to the next one of its limb in the canonical rest pose. Joints that are
# missing here bear several bones (hips, chest) or none: their orientation comes from the source rest pose.
BONES: Final[dict[str, tuple[str, tuple[float, float, float]]]] = {
    "spine": ("chest", (0.0, 1.0, 0.0)), "neck": ("head", (0.0, 1.0, 0.0)),
    "left_clavicle": ("left_shoulder", (1.0, 0.0, 0.0)),
    "right_clavicle": ("right_shoulder", (-1.0, 0.0, 0.0)),
    "left_shoulder": ("left_elbow", (1.0, 0.0, 0.0)), "right_shoulder": ("right_elbow", (-1.0, 0.0, 0.0)),
    "left_elbow": ("left_wrist", (1.0, 0.0, 0.0)), "right_elbow": ("right_wrist", (-1.0, 0.0, 0.0)),
    "left_hip": ("left_knee", (0.0, -1.0, 0.0)), "right_hip": ("right_knee", (0.0, -1.0, 0.0)),
    "left_knee": ("left_ankle", (0.0, -1.0, 0.0)), "right_knee": ("right_ankle", (0.0, -1.0, 0.0)),
    "left_ankle": ("left_toe", (0.0, 0.0, 1.0)), "right_ankle": ("right_toe", (0.0, 0.0, 1.0)),
}  # fmt: skip
# Axis that a rest pose is twisted about: the bone's, hands and toes with the bone before them.
TWIST_AXES: Final[dict[str, tuple[float, float, float]]] = {
    **{name: direction for name, (_, direction) in BONES.items()},
    "left_wrist": (1.0, 0.0, 0.0), "right_wrist": (-1.0, 0.0, 0.0),
    "left_toe": (0.0, 0.0, 1.0), "right_toe": (0.0, 0.0, 1.0),
}  # fmt: skip

# 15 joints that every rig measures itself (none is filled in by interpolation).
COMMON: Final[tuple[str, ...]] = (
    "hips", "neck", "head",
    "left_shoulder", "left_elbow", "left_wrist", "right_shoulder", "right_elbow", "right_wrist",
    "left_hip", "left_knee", "left_ankle", "right_hip", "right_knee", "right_ankle",
)  # fmt: skip
# Deep Motifs, section 5.1: the m = 16 most informative joints with their relative joint angles. The hips'
# own rotation is the body's orientation in the world, which words are invariant to.
DEEP_MOTIFS: Final[tuple[str, ...]] = (
    "spine", "chest", "neck", "head",
    "left_shoulder", "left_elbow", "left_wrist", "right_shoulder", "right_elbow", "right_wrist",
    "left_hip", "left_knee", "left_ankle", "right_hip", "right_knee", "right_ankle",
)  # fmt: skip
# PESTA, section 5.1: root, thorax, head, clavicles, humeri, radii, wrists, femurs, tibiae, feet.
PESTA: Final[tuple[str, ...]] = (
    "hips", "chest", "head",
    "left_clavicle", "left_shoulder", "left_elbow", "left_wrist",
    "right_clavicle", "right_shoulder", "right_elbow", "right_wrist",
    "left_hip", "left_knee", "left_ankle", "right_hip", "right_knee", "right_ankle",
)  # fmt: skip
