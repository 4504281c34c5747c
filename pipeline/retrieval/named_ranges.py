"""Places in clips as a person names them: frames, or seconds."""

from __future__ import annotations


def frame_at(value: float, fps: float, *, in_seconds: bool) -> int:
    """The frame of a clip of `fps` frames a second that is meant: that frame, or the nearest one to a time."""
    return round(value * fps) if in_seconds else int(value)
