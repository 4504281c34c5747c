"""Copies of real clips as people make them: another rate, a cut, another rig, a mirror image."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.formats.write.bvh import to_bvh, write_bvh
from motionlake.lake.catalog import Connection
from motionlake.lake.layout import Lake
from motionlake.lake.raw import canonical_rig, own_rig
from motionlake.motion.clip import SourceClip
from motionlake.motion.skeleton import INDEX, JOINTS, MIRRORED_JOINTS

Export = Callable[[Connection, Lake, str], SourceClip]


def at_rate(clip: SourceClip, fps: float) -> SourceClip:
    """Channels interpolated at another rate; angles must be continuous."""
    hierarchy, channels = to_bvh(clip)
    instants = np.arange(int((len(channels) - 1) / clip.fps * fps) + 1) * (clip.fps / fps)
    below = np.minimum(instants.astype(int), len(channels) - 1)
    above = np.minimum(below + 1, len(channels) - 1)
    turned = np.unwrap(channels, period=360.0, axis=0)
    made = turned[below] + (instants - below)[:, None] * (turned[above] - turned[below])
    return SourceClip(hierarchy, made, fps, metres_per_unit=clip.metres_per_unit)


def trimmed(clip: SourceClip, share: float = 0.1) -> SourceClip:
    """The clip without so much of its frames, half of it at each end."""
    less = round(len(clip.channels) * share / 2)
    return replace(clip, channels=clip.channels[less : len(clip.channels) - less])


def mirrored(clip: SourceClip) -> SourceClip:
    """A clip of the canonical rig mirrored left to right."""
    joints = list(clip.hierarchy.joints)
    assert sorted(joints) == sorted(JOINTS)
    source = [joints.index(JOINTS[MIRRORED_JOINTS[INDEX[joint]]]) for joint in joints]
    offsets = clip.hierarchy.offsets[source] * [-1, 1, 1]
    root, angles = clip.channels[:, :3] * [-1, 1, 1], clip.channels[:, 3:].reshape(len(clip.channels), -1, 3)
    angles = angles[:, source] * [-1, -1, 1]  # about z, y, x
    channels = np.concatenate([root, angles.reshape(len(root), -1)], axis=1)
    return replace(clip, hierarchy=replace(clip.hierarchy, offsets=offsets), channels=channels)


def _everything(clip: SourceClip) -> SourceClip:
    return at_rate(trimmed(mirrored(clip)), 30.0)


COPIES: Final[dict[str, tuple[Export, Callable[[SourceClip], SourceClip]]]] = {
    "rate": (own_rig, lambda clip: at_rate(clip, 30.0)),
    "trimmed": (own_rig, trimmed),
    "rig": (canonical_rig, lambda clip: clip),
    "mirrored": (canonical_rig, mirrored),
    "all": (canonical_rig, _everything),
}


def write_copies(
    con: Connection, lake: Lake, clips: Sequence[str], folder: Path, kinds: Sequence[str]
) -> dict[str, str]:
    """Write copies of clips of a lake as BVH, kind by kind in turn; returns the source of each file's name."""
    folder.mkdir(parents=True, exist_ok=True)
    made = {}
    for number, clip in enumerate(clips):
        kind = kinds[number % len(kinds)]
        export, change = COPIES[kind]
        name = f"{kind}_{number:04}.bvh"
        write_bvh(change(export(con, lake, clip)), folder / name)
        made[name] = clip
    return made
