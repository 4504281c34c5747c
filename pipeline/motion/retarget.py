"""A canonical motion as a clip of the canonical skeleton itself, for export."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.motion.canonicalise import CanonicalMotion
from motionlake.motion.clip import ChannelKind, Hierarchy, SourceClip
from motionlake.motion.rotations import to_euler
from motionlake.motion.skeleton import INDEX, JOINTS, PARENTS

METRES_PER_UNIT: Final = 0.01
ROTATION: Final = ("Zrotation", "Yrotation", "Xrotation")
POSITION: Final = ("Xposition", "Yposition", "Zposition")
# End sites as shares of the body height, where the last joints' bones end.
_TIPS: Final[dict[str, tuple[float, float, float]]] = {
    "head": (0.0, 0.12, 0.0),
    "left_wrist": (0.1, 0.0, 0.0),
    "right_wrist": (-0.1, 0.0, 0.0),
    "left_toe": (0.0, 0.0, 0.05),
    "right_toe": (0.0, 0.0, 0.05),
}


def to_source_clip(motion: CanonicalMotion) -> SourceClip:
    """The motion in BVH terms: root position and ZYX rotations in degrees, centimetres, y up.

    The zero pose is the canonical rest pose with the clip's own bone offsets. Where the source was not rigid,
    positions differ from `motion.positions` by up to `motion.fk_error`.
    """
    order = _depth_first()
    offsets = motion.rest_offsets / METRES_PER_UNIT
    angles = to_euler(motion.rotations, "ZYX")[:, order].reshape(len(motion.root), -1)
    hierarchy = Hierarchy(
        joints=tuple(JOINTS[joint] for joint in order),
        parents=tuple(order.index(PARENTS[joint]) if PARENTS[joint] >= 0 else -1 for joint in order),
        offsets=offsets[order],
        channels=(POSITION + ROTATION, *(ROTATION for _ in order[1:])),
        kind=ChannelKind.EULER,
        axes=np.tile(np.array([1.0, 0.0, 0.0, 0.0]), (len(JOINTS), 1)),
        end_sites=tuple(
            (order.index(INDEX[name]), _scaled(share, motion.body_height / METRES_PER_UNIT))
            for name, share in _TIPS.items()
        ),
    )
    return SourceClip(
        hierarchy=hierarchy,
        channels=np.concatenate([motion.root / METRES_PER_UNIT, angles], axis=1),
        fps=motion.fps,
        metres_per_unit=METRES_PER_UNIT,
        notes=motion.notes,
    )


def _scaled(share: tuple[float, float, float], size: float) -> tuple[float, float, float]:
    x, y, z = share
    return x * size, y * size, z * size


def _depth_first() -> list[int]:
    """Canonical joints in the order in which a BVH file writes its tree."""

    def below(joint: int) -> list[int]:
        return [joint, *(j for child, parent in enumerate(PARENTS) if parent == joint for j in below(child))]

    return below(0)
