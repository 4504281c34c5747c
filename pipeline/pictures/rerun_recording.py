"""A motion as rerun's viewer shows it: the joints as points, the bones as lines, over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from motionlake.errors import UserError
from motionlake.motion.skeleton import JOINTS, PARENTS

if TYPE_CHECKING:
    from motionlake.motion.canonicalise import CanonicalMotion

_BONES: Final = [(joint, parent) for joint, parent in enumerate(PARENTS) if parent >= 0]
_COLOURS: Final = {"left": (0, 114, 178), "right": (213, 94, 0)}  # of the limbs, as in every picture
_MIDDLE: Final = (136, 136, 136)
_THICK: Final = 0.015  # metres


def to_rerun(motion: CanonicalMotion, name: str, recording: Any) -> Any:
    """As `CanonicalMotion.to_rerun`."""
    try:
        import rerun
    except ImportError as error:
        raise UserError("to_rerun(): rerun is not installed; get it with `pip install 'motionlake[rerun]'`") from error
    count = len(motion)
    if not count:
        raise UserError("to_rerun(): the motion has no frames")
    written = rerun.RecordingStream("motionlake") if recording is None else recording
    positions = np.asarray(motion.positions, np.float32)
    times = [
        rerun.TimeColumn("frame", sequence=np.arange(count)),
        rerun.TimeColumn("seconds", duration=np.arange(count) / motion.fps),
    ]
    colours = [_colour(joint) for joint in JOINTS]
    bones = [joint for joint, _ in _BONES]
    strips = positions[:, _BONES].reshape(-1, 2, 3)
    written.log(name, rerun.ViewCoordinates.RIGHT_HAND_Y_UP, static=True)
    marks = rerun.Points3D.from_fields(colors=colours, radii=_THICK, labels=list(JOINTS), show_labels=False)
    sides = rerun.LineStrips3D.from_fields(colors=[colours[joint] for joint in bones], radii=_THICK)
    written.log(f"{name}/joints", marks, static=True)
    written.log(f"{name}/bones", sides, static=True)
    points = rerun.Points3D.columns(positions=positions.reshape(-1, 3))
    lines = rerun.LineStrips3D.columns(strips=strips)
    written.send_columns(f"{name}/joints", times, points.partition(np.full(count, len(JOINTS))))
    written.send_columns(f"{name}/bones", times, lines.partition(np.full(count, len(bones))))
    return written


def _colour(joint: str) -> tuple[int, int, int]:
    return next((colour for side, colour in _COLOURS.items() if joint.startswith(side)), _MIDDLE)
