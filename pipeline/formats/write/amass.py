"""Writing a clip as AMASS has it: axis-angle rotations of SMPL-H's joints and a translation, z up, metres."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.formats.amass import UP
from motionlake.formats.write.registry import ClipToWrite
from motionlake.formats.write.whole import whole_file
from motionlake.motion.canonicalise import turn_to_y_up
from motionlake.motion.rotations import conjugate, multiply, rotate
from motionlake.motion.smpl import BODY_JOINTS, PELVIS
from motionlake.motion.smpl_motion import on_mean_body
from numpy.typing import NDArray

_HAND_NUMBERS: Final = 2 * 15 * 3  # of SMPL-H: fifteen finger joints a hand
_BETAS: Final = 16
_DMPLS: Final = 8


class AmassWriter:
    """AMASS `.npz` of the mean body (zero `betas`) with flat hands."""

    name = "amass"
    suffix = ".npz"
    rig = "smpl"

    def write(self, motion: ClipToWrite, path: Path) -> None:
        """Write the file, whole or not at all; `ClipError` where the clip is no motion of the SMPL skeleton."""
        arrays = amass_arrays(motion)
        with whole_file(path) as stream:
            np.savez_compressed(stream, allow_pickle=False, **arrays)


def amass_arrays(motion: ClipToWrite) -> dict[str, NDArray[Any]]:
    """The arrays of the file by name, as tools for AMASS look for them.

    Raises:
        ClipError: the clip is no motion of the SMPL skeleton.
    """
    from scipy.spatial.transform import Rotation

    body = on_mean_body(motion.clip, motion.metres_per_unit, motion.up)
    onto_z = conjugate(turn_to_y_up(UP))
    rotations = body.rotations[:, :BODY_JOINTS].copy()
    rotations[:, 0] = multiply(onto_z, np.ascontiguousarray(rotations[:, 0]))
    frames = len(rotations)
    vectors: Float64Array = Rotation.from_quat(rotations.reshape(-1, 4), scalar_first=True).as_rotvec()
    return {
        "poses": np.hstack([vectors.reshape(frames, -1), np.zeros((frames, _HAND_NUMBERS))]),
        "trans": rotate(onto_z, body.root) - PELVIS,
        "betas": np.zeros(_BETAS),
        "dmpls": np.zeros((frames, _DMPLS)),
        "gender": np.array("neutral"),
        "mocap_framerate": np.array(motion.clip.fps),
    }


WRITER: Final = AmassWriter()
