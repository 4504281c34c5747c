"""Writing a clip, or a range of its frames, as BVH in its own rig."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final, TextIO

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.formats.bvh import unique
from motionlake.formats.write.registry import ClipToWrite
from motionlake.formats.write.whole import whole_file
from motionlake.motion.clip import POSITION_CHANNELS, ChannelKind, Hierarchy, SourceClip, depth_first
from motionlake.motion.kinematics import channel_starts, solve
from motionlake.motion.rotations import IDENTITY, to_euler
from motionlake.names import printable

_ORDER: Final = "ZYX"
_ROTATIONS: Final = tuple(f"{axis}rotation" for axis in _ORDER)
# Degrees and file units to 1e-8: far below what a recording resolves.
_DECIMALS: Final = 8


def write_bvh(clip: SourceClip, target: Path | TextIO, start: int = 0, stop: int | None = None) -> None:
    """Write frames [start, stop) of a clip as BVH, in file units, to a stream or a path (whole or not at all).

    A BVH's own channels are written as they are. Other rotations become Euler angles ZYX, continuous along
    time, at the same rest pose; a clip of positions becomes joints that move without turning.

    Raises:
        IndexError: no frame in that range.
        OSError: the path cannot be written.
        ClipError: the channels cannot be solved.
    """
    frames = len(clip.channels)
    stop = frames if stop is None else stop
    if not 0 <= start < stop <= frames:
        raise IndexError(f"frames {start} to {stop} of a clip of {frames}")
    hierarchy, channels = to_bvh(replace(clip, channels=clip.channels[start:stop]))
    if isinstance(target, Path):
        with whole_file(target) as stream:
            stream.writelines(line.encode() for line in _lines(hierarchy, channels, clip.fps))
    else:
        target.writelines(_lines(hierarchy, channels, clip.fps))


def to_bvh(clip: SourceClip) -> tuple[Hierarchy, Float64Array]:
    """The clip's joint tree, depth first, and channels [F, C] as BVH can hold them."""
    hierarchy = clip.hierarchy
    if hierarchy.kind is ChannelKind.POSITIONS:
        return _depth_first(*_positions_to_bvh(clip))
    own = hierarchy.kind is ChannelKind.EULER and not hierarchy.fixed_axes
    if own and (hierarchy.axes == IDENTITY).all():
        return _depth_first(hierarchy, clip.channels)
    return _depth_first(*_rotations_to_bvh(clip))


def _depth_first(hierarchy: Hierarchy, channels: Float64Array) -> tuple[Hierarchy, Float64Array]:
    """The same with joints in the only order that BVH's nested braces can have."""
    order = depth_first(hierarchy.parents)
    if order == sorted(order):
        return hierarchy, channels
    place = {joint: i for i, joint in enumerate(order)} | {-1: -1}
    starts = channel_starts(hierarchy)
    columns = np.concatenate([np.arange(starts[joint], starts[joint + 1]) for joint in order])
    return replace(
        hierarchy,
        joints=tuple(hierarchy.joints[joint] for joint in order),
        parents=tuple(place[hierarchy.parents[joint]] for joint in order),
        offsets=hierarchy.offsets[order],
        channels=tuple(hierarchy.channels[joint] for joint in order),
        axes=hierarchy.axes[order],
        end_sites=tuple((place[joint], offset) for joint, offset in hierarchy.end_sites),
    ), channels[:, columns]


def _rotations_to_bvh(clip: SourceClip) -> tuple[Hierarchy, Float64Array]:
    hierarchy = clip.hierarchy
    local = solve(clip).local
    assert local is not None
    starts = channel_starts(hierarchy)
    parts, layout = [], []
    for joint, names in enumerate(hierarchy.channels):
        positions = [i for i, name in enumerate(names) if name in POSITION_CHANNELS]
        angles = np.unwrap(to_euler(local[:, joint], _ORDER), period=360.0, axis=0)
        parts += [clip.channels[:, [starts[joint] + i for i in positions]], angles]
        layout.append((*(names[i] for i in positions), *_ROTATIONS))
    return _plain(hierarchy, hierarchy.offsets, tuple(layout)), _rounded(np.hstack(parts))


def _positions_to_bvh(clip: SourceClip) -> tuple[Hierarchy, Float64Array]:
    hierarchy = clip.hierarchy
    positions = solve(clip).positions
    parents = np.array(hierarchy.parents)
    relative = positions.copy()
    relative[:, parents >= 0] -= positions[:, parents[parents >= 0]]
    # The first frame's bones make a rest pose that a viewer can show; the channels replace it.
    offsets = np.where(parents[:, None] < 0, 0.0, relative[0])
    layout = (POSITION_CHANNELS,) * len(parents)
    channels = _rounded(relative.reshape(len(positions), -1))
    return _plain(hierarchy, _rounded(offsets), layout), channels


def _rounded(values: Float64Array) -> Float64Array:
    result: Float64Array = np.round(values, _DECIMALS)
    return result


def _plain(hierarchy: Hierarchy, offsets: Float64Array, channels: tuple[tuple[str, ...], ...]) -> Hierarchy:
    """The same tree with channels as BVH has them; every branch ends in an end site, as some readers want."""
    ended = {*hierarchy.parents, *(joint for joint, _ in hierarchy.end_sites)}
    open_ends = tuple((j, (0.0, 0.0, 0.0)) for j in range(len(hierarchy.joints)) if j not in ended)
    return replace(
        hierarchy,
        offsets=offsets,
        channels=channels,
        kind=ChannelKind.EULER,
        axes=np.tile(IDENTITY, (len(hierarchy.joints), 1)),
        fixed_axes=False,
        end_sites=hierarchy.end_sites + open_ends,
    )


def _numbers(values: Float64Array | tuple[float, ...]) -> str:
    """Numbers in the shortest form that reads back the same."""
    return " ".join(map(repr, np.asarray(values, float).tolist()))


def joint_names(hierarchy: Hierarchy) -> list[str]:
    """Names of joints as a line of BVH can hold them: words apart by single blanks, no braces, no controls.

    A name that BVH cannot hold is spelled with "_"; joints that would then be called alike get numbers.
    """
    fit = [" ".join(re.sub(r"[{}]", "_", printable(name)).split()) or "_" for name in hierarchy.joints]
    return list(unique(fit))


def _lines(hierarchy: Hierarchy, channels: Float64Array, fps: float) -> Iterator[str]:
    yield "HIERARCHY\n"
    yield from _tree_lines(replace(hierarchy, joints=tuple(joint_names(hierarchy))))
    yield f"MOTION\nFrames: {len(channels)}\nFrame Time: {1 / fps!r}\n"
    for row in channels:
        yield _numbers(row) + "\n"


def _tree_lines(hierarchy: Hierarchy) -> Iterator[str]:
    """The joint tree of a hierarchy whose joints are in depth-first order."""
    open_joints: list[int] = []
    sites: dict[int, list[tuple[float, float, float]]] = {}
    for joint, offset in hierarchy.end_sites:
        sites.setdefault(joint, []).append(offset)
    for joint, parent in enumerate(hierarchy.parents):
        while open_joints and open_joints[-1] != parent:
            open_joints.pop()
            yield "\t" * len(open_joints) + "}\n"
        indent = "\t" * len(open_joints)
        names = hierarchy.channels[joint]
        yield f"{indent}{'ROOT' if parent < 0 else 'JOINT'} {hierarchy.joints[joint]}\n{indent}{{\n"
        yield f"{indent}\tOFFSET {_numbers(hierarchy.offsets[joint])}\n"
        yield f"{indent}\tCHANNELS {' '.join([str(len(names)), *names])}\n"
        for site in sites.get(joint, []):
            yield f"{indent}\tEnd Site\n{indent}\t{{\n{indent}\t\tOFFSET {_numbers(site)}\n{indent}\t}}\n"
        open_joints.append(joint)
    while open_joints:
        open_joints.pop()
        yield "\t" * len(open_joints) + "}\n"


class BvhWriter:
    """BVH in the clip's own joints, unit and axes."""

    name = "bvh"
    suffix = ".bvh"
    rig = ""

    def write(self, motion: ClipToWrite, path: Path) -> None:
        """Write the file, whole or not at all."""
        write_bvh(motion.clip, path)


WRITER: Final = BvhWriter()
