"""What holds for the clips of every format."""

from __future__ import annotations

from operator import lt
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.limits_config import FARTHEST, MOST_DEGREES, limits
from motionlake.motion.clip import ROTATION_CHANNELS, ChannelKind, Hierarchy, SourceClip

MIN_FPS: Final = 1.0
MAX_FPS: Final = 1000.0


def _is_text(name: str) -> bool:
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def most_of(hierarchy: Hierarchy) -> Float64Array:
    """[C] the largest number that is no damage, of every channel: degrees or file units."""
    if hierarchy.kind is not ChannelKind.EULER:
        return np.full(sum(map(len, hierarchy.channels)), FARTHEST)
    names = [name for joint in hierarchy.channels for name in joint]
    return np.array([MOST_DEGREES if name in ROTATION_CHANNELS else FARTHEST for name in names])


def check_clip(clip: SourceClip) -> None:
    """Raise `ClipError` unless shapes agree, parents precede children and all numbers are finite."""
    hierarchy, channels = clip.hierarchy, clip.channels
    joints = len(hierarchy.joints)
    if not joints:
        raise ClipError("has no joints")
    if len(set(hierarchy.joints)) != joints:
        raise ClipError("has two joints of one name")
    every = "".join(hierarchy.joints)
    if "\0" in every or not _is_text(every):
        raise ClipError("has a joint whose name is no text")
    root, *below = hierarchy.parents or (0,)
    tree = len(hierarchy.parents) == len(hierarchy.channels) == joints and root == -1
    if not tree or min(below, default=0) < 0 or not all(map(lt, below, range(1, joints))):
        raise ClipError("its joints form no tree of which joint 0 is the root")
    if hierarchy.offsets.shape != (joints, 3):
        raise ClipError("has a joint without a finite offset")
    if not np.abs(hierarchy.offsets).max() <= FARTHEST:  # false for NaN too
        sound = np.isfinite(hierarchy.offsets).all()
        raise ClipError(f"has a joint {'with an offset that is absurdly long' if sound else 'without a finite offset'}")
    if channels.ndim != 2 or channels.shape[1] != sum(map(len, hierarchy.channels)):
        raise ClipError("its rows do not fit its channels")
    limits().check_body(len(channels), joints)
    if len(channels) < 2:
        raise ClipError(f"has {len(channels)} frame(s); a motion needs at least two")
    # No number is above the root of the sum of all their squares, which takes one pass; false for NaN too.
    if not np.vdot(channels, channels) <= min(MOST_DEGREES, FARTHEST) ** 2:
        _check_numbers(clip)
    if not MIN_FPS <= clip.fps <= MAX_FPS:
        raise ClipError(f"frame rate {clip.fps:g}/s is outside [{MIN_FPS:g}, {MAX_FPS:g}]: say --fps")


def _check_numbers(clip: SourceClip) -> None:
    """Raise `ClipError` unless all numbers of the channels are finite and none is absurd for what it says."""
    channels, most = clip.channels, most_of(clip.hierarchy)
    if ((channels.max(axis=0) <= most) & (channels.min(axis=0) >= -most)).all():
        return
    if not np.isfinite(channels).all():
        raise ClipError("has a channel value that is not finite")
    frame, channel = np.argwhere(~(np.abs(channels) <= most))[0].tolist()
    raise ClipError(
        f"frame {frame}: {clip.hierarchy.channel_names[channel]} is {channels[frame, channel]:.4g}, which is absurd"
    )
