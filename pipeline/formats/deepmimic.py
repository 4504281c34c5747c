"""DeepMimic motion files: JSON with "Loop" and "Frames", for the character humanoid3d.

A frame is 44 numbers: its duration in seconds, the root's position and rotation, then the rotations of the
joints in the character's order, a quaternion (w, x, y, z) for a ball joint and an angle in radians about z
for a knee or an elbow (Peng et al., "DeepMimic", SIGGRAPH 2018, and the character file published with it).
The character faces +x, y is up, lengths are metres.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.limits_config import limits
from motionlake.formats.parse.json_document import json_document
from motionlake.formats.repair import FARTHEST
from motionlake.motion.clip import POSITION_CHANNELS, QUATERNION_CHANNELS, ChannelKind, Hierarchy, SourceClip
from motionlake.motion.rotations import IDENTITY

BALL: Final = 4
HINGE: Final = 1
FIXED: Final = 0
# Joint, parent, values a frame, rest offset in metres.
CHARACTER: Final[tuple[tuple[str, int, int, tuple[float, float, float]], ...]] = (
    ("root", -1, BALL, (0.0, 0.0, 0.0)),
    ("chest", 0, BALL, (0.0, 0.236151, 0.0)),
    ("neck", 1, BALL, (0.0, 0.223894, 0.0)),
    ("right_hip", 0, BALL, (0.0, 0.0, 0.084887)),
    ("right_knee", 3, HINGE, (0.0, -0.421546, 0.0)),
    ("right_ankle", 4, BALL, (0.0, -0.409870, 0.0)),
    ("right_shoulder", 1, BALL, (-0.02405, 0.24350, 0.18311)),
    ("right_elbow", 6, HINGE, (0.0, -0.274788, 0.0)),
    ("right_wrist", 7, FIXED, (0.0, -0.258947, 0.0)),
    ("left_hip", 0, BALL, (0.0, 0.0, -0.084887)),
    ("left_knee", 9, HINGE, (0.0, -0.421546, 0.0)),
    ("left_ankle", 10, BALL, (0.0, -0.409870, 0.0)),
    ("left_shoulder", 1, BALL, (-0.02405, 0.24350, -0.18311)),
    ("left_elbow", 12, HINGE, (0.0, -0.274788, 0.0)),
    ("left_wrist", 13, FIXED, (0.0, -0.258947, 0.0)),
)
# The middle of the head's sphere, and the front of each foot's box.
END_SITES: Final = (
    (2, (0.0, 0.175, 0.0)),
    (5, (0.1335, -0.0225, 0.0)),
    (11, (0.1335, -0.0225, 0.0)),
)
FRAME_VALUES: Final = 1 + len(POSITION_CHANNELS) + sum(values for _, _, values, _ in CHARACTER)
DURATION_TOLERANCE: Final = 1e-3
# A damaged duration must not ask for endless resampled frames.
MAX_STRETCH: Final = 100
# Less than the difference between 30 and 29.97 a second.
ROUNDING: Final = 1e-4
MIN_NORM: Final = 1e-3
_SIGNS: Final = (
    re.compile(rb'"Loop"\s*+:\s*+"(?:wrap|none)"'),
    re.compile(rb'"Frames"\s*+:\s*+\['),
    re.compile(rb"\[(?:\s*+[-+.\deE]++\s*+,){%d}\s*+[-+.\deE]++\s*+\]" % (FRAME_VALUES - 1)),
)


class DeepMimicReader:
    """DeepMimic motions; a `.txt` or `.json` of any other content is no clip."""

    name = "DeepMimic"
    suffixes = (".txt", ".json")

    opening = b"{"

    def sniff(self, head: bytes) -> bool:
        """Whether these first bytes are a DeepMimic motion's, damaged or whole, not just any text or JSON's.

        They are where they say how the motion loops, open a list "Frames", or hold a list of a frame's length.
        """
        return any(sign.search(head) for sign in _SIGNS)

    def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
        """Read one body.

        Knees and elbows become quaternion channels. Frames that do not all last equally long are resampled
        to their median duration (spherical linear interpolation), which a note says. The last frame's
        duration has no meaning and may be 0. With `fps` durations are not looked at.

        Raises:
            ClipError: no DeepMimic JSON, another character's frames, or a bad duration or quaternion.
        """
        frames = _frames(data)
        if fps is not None:
            return [SourceClip(_HIERARCHY, _channels(frames), fps=fps, metres_per_unit=1.0)]
        durations = frames[:-1, 0]
        if not (durations > 0).all():
            index = int((durations <= 0).argmax())
            raise ClipError(f"frame {index} lasts {durations[index]:g} s")
        step = float(np.median(durations))
        channels = _channels(frames)
        notes: tuple[str, ...] = ()
        if (np.abs(durations - step) > DURATION_TOLERANCE * step).any():
            lowest, highest = float(durations.min()), float(durations.max())
            notes = (f"frames last {lowest:g} to {highest:g} s: resampled to {1 / step:.4g} frames a second",)
            channels = _resampled(channels, durations, step)
        return [SourceClip(_HIERARCHY, channels, fps=_frame_rate(step), metres_per_unit=1.0, notes=notes)]


def _frames(data: bytes) -> Float64Array:
    """[F, 44] the file's numbers."""
    document = json_document(data)
    frames = document.get("Frames") if isinstance(document, dict) else None
    if not isinstance(frames, list):
        raise ClipError('is JSON without a list "Frames"')
    if len(frames) < 2:
        raise ClipError(f"has {len(frames)} frame(s); a motion needs at least two")
    limits().check_body(len(frames), len(CHARACTER), len(data))
    for index, frame in enumerate(frames):
        if not isinstance(frame, list):
            raise ClipError(f"frame {index} is no list of numbers")
        if len(frame) != FRAME_VALUES:
            raise ClipError(f"frame {index} has {len(frame)} numbers, a DeepMimic humanoid has {FRAME_VALUES} a frame")
        if not all(isinstance(value, int | float) for value in frame):
            raise ClipError(f"frame {index} holds something that is not a number")
    try:
        values = np.array(frames, dtype=np.float64)
    except OverflowError as error:
        raise ClipError("holds a number out of range") from error
    sound = (np.abs(values) <= FARTHEST).all(axis=1)
    if not sound.all():
        raise ClipError(f"frame {int(sound.argmin())} holds a number that is not finite or absurdly large")
    return values


def _channels(frames: Float64Array) -> Float64Array:
    """[F, C] the numbers after the duration, angles as quaternions about z, ball joints as they stand."""
    columns = [frames[:, 1:4]]
    start = 4
    for joint, _, values, _ in CHARACTER:
        raw = frames[:, start : start + values]
        start += values
        if values == HINGE:
            half = raw[:, 0] / 2.0
            zero = np.zeros_like(half)
            raw = np.stack([np.cos(half), zero, zero, np.sin(half)], axis=1)
        elif values == BALL:
            norms = np.linalg.norm(raw, axis=1)
            if (norms < MIN_NORM).any():
                raise ClipError(f"frame {int(norms.argmin())}: the quaternion of {joint} is no rotation")
        columns.append(raw)
    return np.concatenate(columns, axis=1)


def _frame_rate(step: float) -> float:
    """1 / step, or the whole number that published files cut to a few digits: 0.016666 s is 60 a second."""
    whole = round(1.0 / step)
    return float(whole) if abs(whole * step - 1.0) < ROUNDING else 1.0 / step


def _resampled(channels: Float64Array, durations: Float64Array, step: float) -> Float64Array:
    """The same motion at a constant `step` in seconds: [F', C], from the first frame to the last."""
    from scipy.spatial.transform import Rotation, Slerp

    shortest, longest = durations.min(), durations.max()
    if longest > MAX_STRETCH * step or shortest < step / MAX_STRETCH:
        raise ClipError(f"its frames last from {shortest:g} to {longest:g} s")
    times = np.concatenate([[0.0], np.cumsum(durations)])
    count = round(times[-1] / step) + 1
    limits().check_body(count, len(CHARACTER))
    grid = np.minimum(np.arange(count) * step, times[-1])
    columns = [np.stack([np.interp(grid, times, column) for column in channels[:, :3].T], axis=1)]
    for start in range(3, channels.shape[1], 4):
        rotations = Rotation.from_quat(channels[:, start : start + 4], scalar_first=True)
        columns.append(Slerp(times, rotations)(grid).as_quat(scalar_first=True))
    return np.concatenate(columns, axis=1)


_HIERARCHY: Final = Hierarchy(
    joints=tuple(joint for joint, _, _, _ in CHARACTER),
    parents=tuple(parent for _, parent, _, _ in CHARACTER),
    offsets=np.array([offset for _, _, _, offset in CHARACTER]),
    channels=(
        POSITION_CHANNELS + QUATERNION_CHANNELS,
        *(QUATERNION_CHANNELS if values else () for _, _, values, _ in CHARACTER[1:]),
    ),
    kind=ChannelKind.QUATERNION,
    axes=np.tile(IDENTITY, (len(CHARACTER), 1)),
    end_sites=END_SITES,
)
READER: Final = DeepMimicReader()
