"""The skeleton of the SMPL body model: its joints, and the bone lengths of its mean body.

The names and the tree are those of SMPL (Loper et al., SIGGRAPH Asia 2015). The offsets are the joints of the neutral
template at zero shape parameters, to a tenth of a millimetre, as open programs list them that need the skeleton without
the model (docs/smpl.md); the model itself is neither needed nor part of motionlake.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.clip import POSITION_CHANNELS, QUATERNION_CHANNELS, ChannelKind, Hierarchy, SourceClip
from motionlake.motion.rotations import IDENTITY

JOINTS: Final[tuple[str, ...]] = (
    "pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle", "right_ankle",
    "spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head", "left_shoulder",
    "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist", "left_hand", "right_hand",
)  # fmt: skip
PARENTS: Final[tuple[int, ...]] = (
    -1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21,
)  # fmt: skip
INDEX: Final[dict[str, int]] = {name: joint for joint, name in enumerate(JOINTS)}
BODY_JOINTS: Final = 22  # all but the hands: what SMPL, SMPL-H, SMPL-X and HumanML3D have in common
# [24, 3] metres from the parent joint in the T-pose: x to the body's left, y up, z forward.
OFFSETS: Final[Float64Array] = np.array([
    [0.0, 0.0, 0.0],
    [0.0695, -0.0914, -0.0068], [-0.0677, -0.0905, -0.0043], [-0.0025, 0.1090, -0.0267],
    [0.0343, -0.3752, -0.0045], [-0.0383, -0.3826, -0.0089], [0.0055, 0.1352, 0.0011],
    [-0.0136, -0.3980, -0.0437], [0.0158, -0.3984, -0.0423], [0.0015, 0.0529, 0.0254],
    [0.0264, -0.0558, 0.1193], [-0.0254, -0.0481, 0.1233], [-0.0028, 0.2139, -0.0429],
    [0.0788, 0.1217, -0.0341], [-0.0818, 0.1188, -0.0386], [0.0052, 0.0650, 0.0513],
    [0.0910, 0.0305, -0.0089], [-0.0960, 0.0326, -0.0091],
    [0.2596, -0.0128, -0.0275], [-0.2537, -0.0133, -0.0214],
    [0.2492, 0.0090, -0.0012], [-0.2553, 0.0078, -0.0056],
    [0.0840, -0.0082, -0.0149], [-0.0846, -0.0061, -0.0103],
])  # fmt: skip
# Where the model puts the pelvis when nothing moves it: its `trans` counts from here.
PELVIS: Final[Float64Array] = np.array([-0.0018, -0.2233, 0.0282])


def smpl_hierarchy(joints: int = len(JOINTS), offsets: Float64Array = OFFSETS) -> Hierarchy:
    """The tree of the first `joints` joints, 24 or 22, with quaternions for channels and a place for the pelvis.

    Its zero pose is the T-pose, y up, facing +z.
    """
    return Hierarchy(
        joints=JOINTS[:joints],
        parents=PARENTS[:joints],
        offsets=np.array(offsets[:joints]),
        channels=((*POSITION_CHANNELS, *QUATERNION_CHANNELS), *(QUATERNION_CHANNELS,) * (joints - 1)),
        kind=ChannelKind.QUATERNION,
        axes=np.tile(IDENTITY, (joints, 1)),
    )


def smpl_channels(frames: int, joints: int) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Channels [F, 3 + 4 J] of a clip of the first J joints, not filled, and views of them.

    These are the pelvis' places [F, 3] and the joints' rotations [F, J, 4].
    """
    channels = np.empty((frames, 3 + 4 * joints))
    return channels, channels[:, :3], channels[:, 3:].reshape(frames, joints, 4)


def smpl_clip(
    root: Float64Array,
    rotations: Float64Array,
    fps: float,
    *,
    up: str = "y",
    offsets: Float64Array = OFFSETS,
    notes: tuple[str, ...] = (),
    twist: bool = True,
) -> SourceClip:
    """A clip of the pelvis' places [F, 3] in metres and of local rotations [F, J, 4] of the first J joints."""
    channels, places, turns = smpl_channels(*rotations.shape[:2])
    places[:], turns[:] = root, rotations
    return SourceClip(
        hierarchy=smpl_hierarchy(rotations.shape[1], offsets),
        channels=channels,
        fps=fps,
        metres_per_unit=1.0,
        up=up,
        notes=notes,
        twist=twist,
    )
