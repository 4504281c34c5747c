"""Writing a clip as C3D: every joint is a point."""

from __future__ import annotations

import os
import uuid
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.errors import ClipError
from motionlake.formats.parse.c3d_blocks import OWN_GROUP, PARENTS
from motionlake.formats.write.joints import joint_places
from motionlake.formats.write.registry import ClipToWrite

MILLIMETRES: Final = 1000.0
# The frame numbers of a C3D header are two bytes, and so is the length of a parameter.
MOST_FRAMES: Final = 65_535
MOST_POINTS: Final = 255


class C3dWriter:
    """Points in millimetres, y up, named by `POINT:LABELS`; `POINT:RATE` is the frame rate.

    The tree of joints stands in `MOTIONLAKE:PARENTS`, so that the file comes back as the clip that it was.
    """

    name = "c3d"
    suffix = ".c3d"
    rig = ""

    def write(self, motion: ClipToWrite, path: Path) -> None:
        """Write the file, whole or not at all.

        Raises:
            ClipError: ezc3d is not there, or the clip has more frames or joints than a C3D file can hold.
        """
        try:
            import ezc3d
        except ImportError as error:
            raise ClipError("needs ezc3d: pip install 'motionlake[c3d]'") from error
        places = joint_places(motion) * MILLIMETRES
        frames, joints = places.shape[:2]
        if frames > MOST_FRAMES or joints > MOST_POINTS:
            raise ClipError(f"{frames} frames of {joints} points: C3D holds {MOST_FRAMES} of {MOST_POINTS} at most")
        made: Any = ezc3d.c3d()
        made["parameters"]["POINT"]["RATE"]["value"] = [motion.clip.fps]
        made["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
        made["parameters"]["POINT"]["LABELS"]["value"] = list(motion.clip.hierarchy.joints)
        made.add_parameter("POINT", "X_SCREEN", "+X")
        made.add_parameter("POINT", "Y_SCREEN", "+Y")
        made.add_parameter(OWN_GROUP, PARENTS, [parent + 1 for parent in motion.clip.hierarchy.parents])
        made["data"]["points"] = np.concatenate([places.transpose(2, 1, 0), np.ones((1, joints, frames))])
        temporary = path.with_name(f".{uuid.uuid4().hex}.tmp.c3d")  # ezc3d adds the suffix where there is none
        try:
            made.write(str(temporary))
            with temporary.open("rb") as stream:
                os.fsync(stream.fileno())
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)


WRITER: Final = C3dWriter()
