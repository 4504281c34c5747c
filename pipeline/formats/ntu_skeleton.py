"""NTU RGB+D `.skeleton` text files: the 25 joints of a Kinect v2 for every body it saw, 30 frames a second.

Layout (Shahroudy et al., "NTU RGB+D", CVPR 2016): the frame count; for each frame the number of bodies; for
each body a line of ten values (ID first, tracking state last), the joint count, and one line of twelve values
a joint (x, y, z in metres first, tracking state last).
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array, Int64Array
from motionlake.errors import ClipError
from motionlake.formats.limits_config import limits
from motionlake.formats.parse.ntu_bodies import parse_bodies
from motionlake.formats.repair import carry, fill_missing, rarely_seen, repair_note
from motionlake.motion.clip import Hierarchy, SourceClip

FPS: Final = 30.0
JOINTS: Final = (
    "SpineBase", "SpineMid", "Neck", "Head",
    "ShoulderLeft", "ElbowLeft", "WristLeft", "HandLeft",
    "ShoulderRight", "ElbowRight", "WristRight", "HandRight",
    "HipLeft", "KneeLeft", "AnkleLeft", "FootLeft",
    "HipRight", "KneeRight", "AnkleRight", "FootRight",
    "SpineShoulder", "HandTipLeft", "ThumbLeft", "HandTipRight", "ThumbRight",
)  # fmt: skip
PARENT_NAMES: Final = {
    "SpineMid": "SpineBase", "SpineShoulder": "SpineMid", "Neck": "SpineShoulder", "Head": "Neck",
    "ShoulderLeft": "SpineShoulder", "ElbowLeft": "ShoulderLeft", "WristLeft": "ElbowLeft",
    "HandLeft": "WristLeft", "HandTipLeft": "HandLeft", "ThumbLeft": "WristLeft",
    "ShoulderRight": "SpineShoulder", "ElbowRight": "ShoulderRight", "WristRight": "ElbowRight",
    "HandRight": "WristRight", "HandTipRight": "HandRight", "ThumbRight": "WristRight",
    "HipLeft": "SpineBase", "KneeLeft": "HipLeft", "AnkleLeft": "KneeLeft", "FootLeft": "AnkleLeft",
    "HipRight": "SpineBase", "KneeRight": "HipRight", "AnkleRight": "KneeRight", "FootRight": "AnkleRight",
}  # fmt: skip
# Joints of the hands with what carries them where the camera hardly saw them: no ground to drop a body.
HANDS: Final = (
    ("HandLeft", "WristLeft"), ("HandTipLeft", "HandLeft"), ("ThumbLeft", "WristLeft"),
    ("HandRight", "WristRight"), ("HandTipRight", "HandRight"), ("ThumbRight", "WristRight"),
)  # fmt: skip
# Beside a body that is seen longer, one that is not seen in more frames than these is the sensor's noise: the
# threshold that is customary in preparing NTU for action recognition.
NOISE_FRAMES: Final = 11
# The file lists SpineShoulder after its children; in the hierarchy a parent comes first.
TREE_ORDER: Final = (0, 1, 20, *range(2, 20), *range(21, 25))
_NAMES: Final = tuple(JOINTS[index] for index in TREE_ORDER)
_HIERARCHY: Final = Hierarchy.of_positions(_NAMES, (-1, *(_NAMES.index(PARENT_NAMES[name]) for name in _NAMES[1:])))

Observed = tuple[Int64Array, Float64Array, BoolArray]


class NtuSkeletonReader:
    """NTU RGB+D and NTU RGB+D 120 skeletons."""

    name = "NTU RGB+D"
    suffixes = (".skeleton",)

    def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
        """Read every body that is seen in at least half of its own first to last frame; `fps` is 30 by default.

        Bodies are numbered in order of appearance; `SourceClip.body` is that number, or "" where the file
        has one body only. A body is left out, with a note on the others, where a joint other than a hand's
        is missing in more than half of its frames, or where it shows in a few frames beside a longer one.

        Raises:
            ClipError: a malformed line, a file cut short, or no body that can be kept.
        """
        frame_count, seen = parse_bodies(data)
        clips, left_out = [], []
        longest = max((_visible(missing) for _, _, missing in seen.values()), default=0)
        for number, (identity, observed) in enumerate(seen.items(), start=1):
            label = str(number) if len(seen) > 1 else ""
            try:
                visible = _visible(observed[2])
                if visible <= NOISE_FRAMES < longest:
                    raise ClipError(f"the body is seen in {visible} of {frame_count} frames")
                clips.append(_clip(label, identity, frame_count, observed))
            except ClipError as error:
                reason = error.reason.replace("the body", f"body {label}".strip())
                left_out.append(reason)
        if not clips:
            raise ClipError("; ".join(left_out) or "no body is tracked in any frame")
        notes = tuple(f"left out: {reason}" for reason in left_out)
        rate = FPS if fps is None else fps
        return [replace(clip, fps=rate, notes=clip.notes + notes) for clip in clips]


def _visible(missing: BoolArray) -> int:
    """Frames that show any joint."""
    return int((~missing).any(axis=1).sum())


def _fill(positions: Float64Array, missing: BoolArray) -> tuple[Float64Array, list[str]]:
    """The body [F, 25, 3] without gaps, and notes on what was hardly seen."""
    rare = rarely_seen(missing)
    carried = [(JOINTS.index(name), JOINTS.index(by)) for name, by in HANDS if rare[JOINTS.index(name)]]
    others = [joint for joint in range(len(JOINTS)) if joint not in {hand for hand, _ in carried}]
    filled = positions.copy()
    filled[:, others], _ = fill_missing(positions[:, others], missing[:, others], [JOINTS[joint] for joint in others])
    notes = []
    for joint, carrier in carried:
        carry(filled, missing, joint, carrier)
        seen = len(missing) - int(missing[:, joint].sum())
        notes.append(f"{JOINTS[joint]} seen in {seen} of {len(missing)} frames, carried by {JOINTS[carrier]}")
    return filled, notes


def _clip(label: str, identity: str, frame_count: int, observed: Observed) -> SourceClip:
    frames, positions, missing = observed
    visible = frames[~missing.all(axis=1)]
    if not len(visible):
        raise ClipError(f"the body is seen in 0 of {len(frames)} frames")
    first, length = int(visible[0]), int(visible[-1] - visible[0]) + 1
    limits().check_body(length, len(JOINTS))
    inside = (frames >= first) & (frames < first + length)
    dense = np.zeros((length, len(JOINTS), 3))
    absent = np.ones((length, len(JOINTS)), np.bool_)
    dense[frames[inside] - first] = positions[inside]
    absent[frames[inside] - first] = missing[inside]
    filled, carried = _fill(dense, absent)
    repaired = int(absent.any(axis=1).sum())
    notes = [f"body ID {identity}"]
    if length < frame_count:
        notes.append(f"frames {first} to {first + length - 1} of {frame_count}")
    return SourceClip(
        hierarchy=_HIERARCHY,
        channels=filled[:, TREE_ORDER].reshape(length, -1),
        fps=FPS,
        body=label,
        metres_per_unit=1.0,
        repaired=repaired,
        notes=(*notes, *carried, *repair_note(repaired, length)),
    )


READER: Final = NtuSkeletonReader()
