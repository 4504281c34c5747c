"""Channels of a joint tree from rotations: motion that was computed, as a clip that files can hold."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.clip import (
    POSITION_CHANNELS,
    QUATERNION_CHANNELS,
    ROTATION_CHANNELS,
    ChannelKind,
    Hierarchy,
    SourceClip,
)
from motionlake.motion.kinematics import channel_starts, solve
from motionlake.motion.resampling import resample
from motionlake.motion.rotations import IDENTITY, to_euler

_ORDER: Final = ("Zrotation", "Yrotation", "Xrotation")


def posed(hierarchy: Hierarchy, local: Float64Array, places: Float64Array, fps: float) -> SourceClip:
    """A clip of a joint tree in given poses.

    Joints keep the channels that they have. One whose channels could not hold every rotation gets Euler angles ZYX, as
    do all where the file's turn about axes of their own (ASF); the root gets a place where it has none.

    Args:
        hierarchy: EULER or QUATERNION.
        local: [F, J, 4] rotation of each joint relative to its parent, from the zero pose.
        places: [F, J, 3] of each joint relative to its parent, file units; used where a joint has channels for it.
        fps: frames a second.
    """
    plain = not hierarchy.fixed_axes and bool((hierarchy.axes == IDENTITY).all())
    layout, columns = [], []
    for joint, own in enumerate(hierarchy.channels):
        names = _channels(own, hierarchy.kind, plain, root=joint == 0)
        layout.append(names)
        columns.append(_values(names, np.ascontiguousarray(local[:, joint]), places[:, joint]))
    tree = replace(hierarchy, channels=tuple(layout), axes=np.tile(IDENTITY, (len(layout), 1)), fixed_axes=False)
    return SourceClip(tree, np.hstack(columns), fps)


def _channels(own: tuple[str, ...], kind: ChannelKind, plain: bool, root: bool) -> tuple[str, ...]:
    """The channels of a joint that can hold any rotation."""
    turns = tuple(name for name in own if name not in POSITION_CHANNELS)
    places = tuple(name for name in own if name in POSITION_CHANNELS)
    if root and len(places) < 3:
        places, own = POSITION_CHANNELS, (*POSITION_CHANNELS, *turns)
    if kind is ChannelKind.QUATERNION:
        return own if set(turns) == set(QUATERNION_CHANNELS) else (*places, *QUATERNION_CHANNELS)
    return own if plain and sorted(turns) == sorted(ROTATION_CHANNELS) else (*places, *_ORDER)


def _values(names: tuple[str, ...], local: Float64Array, place: Float64Array) -> Float64Array:
    """[F, C] channels of one joint."""
    turns = [name for name in names if name in ROTATION_CHANNELS]
    found = {name: place[:, i] for i, name in enumerate(POSITION_CHANNELS)}
    if turns:
        angles = to_euler(local, "".join(name[0] for name in turns))
        found |= dict(zip(turns, np.unwrap(angles, period=360.0, axis=0).T, strict=True))
    found |= {name: local[:, i] for i, name in enumerate(QUATERNION_CHANNELS)}
    return np.column_stack([found[name] for name in names])


def relative_places(clip: SourceClip) -> Float64Array:
    """[F, J, 3] of each joint relative to its parent, before the parent turns, file units."""
    hierarchy = clip.hierarchy
    places = np.tile(hierarchy.offsets, (len(clip.channels), 1, 1))
    starts = channel_starts(hierarchy)
    for joint, names in enumerate(hierarchy.channels):
        for at, name in enumerate(names):
            if name in POSITION_CHANNELS:
                places[:, joint, POSITION_CHANNELS.index(name)] = clip.channels[:, starts[joint] + at]
    return places


def resampled(clip: SourceClip, fps: float) -> SourceClip:
    """A clip at another rate: places by linear interpolation, rotations along the shortest arc.

    Raises:
        ClipError: the channels cannot be solved.
    """
    if fps == clip.fps:
        return clip
    if clip.hierarchy.kind is ChannelKind.POSITIONS:
        frames = clip.channels.reshape(len(clip.channels), -1, 3)
        values = resample(frames, clip.fps, fps).reshape(-1, clip.channels.shape[1])
        return replace(clip, channels=values, fps=fps)
    local = solve(clip).local
    assert local is not None
    turned = resample(local, clip.fps, fps, spherical=True)
    made = posed(clip.hierarchy, turned, resample(relative_places(clip), clip.fps, fps), fps)
    return replace(clip, hierarchy=made.hierarchy, channels=made.channels, fps=fps)
