"""Where the joints of a clip are, for formats that hold positions."""

from __future__ import annotations

from motionlake.arrays import Float64Array
from motionlake.formats.write.registry import ClipToWrite
from motionlake.motion.canonicalise import turn_to_y_up
from motionlake.motion.kinematics import solve
from motionlake.motion.rotations import rotate


def joint_places(motion: ClipToWrite) -> Float64Array:
    """[F, J, 3] the joints of a clip in metres, y up. Raises `ClipError` where its channels cannot be solved."""
    return rotate(turn_to_y_up(motion.up), solve(motion.clip).positions) * motion.metres_per_unit
