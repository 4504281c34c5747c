"""Clips of a lake as source clips again: in their own rig, or on the canonical skeleton."""

from __future__ import annotations

import numpy as np
from motionlake.lake import frames, raw
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.motion.canonicalise import CanonicalMotion, to_source_clip
from motionlake.motion.clip import SourceClip


def own_rig(con: Connection, lake: Lake, clip: str) -> SourceClip:
    """A clip in its own rig, from its raw channels."""
    row = fetch(con, "clip", {"clip": clip})[0]
    layout = fetch(con, "layout", {"layout": row["layout"]})[0]
    skeleton = fetch(con, "skeleton", {"skeleton": row["skeleton"]})[0]
    return raw.read_source(lake.path(lake.raw_part(row["layout"], row["part"])), row, layout, skeleton)


def canonical_rig(con: Connection, lake: Lake, clip: str) -> SourceClip:
    """A clip retargeted to the canonical skeleton with the body's own bone lengths."""
    return to_source_clip(canonical_motion(con, lake, clip))


def canonical_motion(con: Connection, lake: Lake, clip: str) -> CanonicalMotion:
    """The motion of a clip on the canonical skeleton, from its stored frames."""
    row = fetch(con, "clip", {"clip": clip})[0]
    stored = frames.read_clip(lake.path(lake.frames_part(row["dataset"], row["part"])), clip)
    positions = stored.positions.astype(float)
    return CanonicalMotion(
        fps=stored.fps,
        root=positions[:, 0],
        rotations=stored.rotations.astype(float),
        positions=positions,
        rest_offsets=np.array(row["rest_offsets"], dtype=float).reshape(-1, 3),
        body_height=row["body_height"],
        twist=row["twist"],
        filled=tuple(row["filled"]),
        up="y",
        metres_per_unit=1.0,
        fk_error=row["fk_error"],
        fk_error_mean=row["fk_error"],
        notes=tuple(row["notes"]),
    )
