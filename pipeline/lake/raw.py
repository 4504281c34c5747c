"""The raw channels of source files, kept so that a clip can be written back in its own rig; clips as source clips."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from motionlake.columns import matrix_of
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.config import canonical_json
from motionlake.lake.frames import canonical_motion, columns_of, key_columns
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.motion.clip import ChannelKind, Hierarchy, SourceClip

DEGREES_STEP = 2.0**-12  # a joint a metre away moves by 2 micrometres
QUATERNION_STEP = 2.0**-20
_IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def layout_row(hierarchy: Hierarchy) -> dict[str, Any]:
    """The channel layout of a file as a row of `layouts`; clips of one layout share a raw table."""
    row: dict[str, Any] = {
        "kind": hierarchy.kind.value,
        "fixed_axes": hierarchy.fixed_axes,
        "joints": list(hierarchy.joints),
        "parents": list(hierarchy.parents),
        "channels": [list(c) for c in hierarchy.channels],
    }
    return {"layout": hashlib.sha256(canonical_json(row).encode()).hexdigest()[:12], **row}


def skeleton_row(hierarchy: Hierarchy) -> dict[str, Any]:
    """What of a hierarchy differs between bodies of one layout, as a row of `skeletons`."""
    plain = np.allclose(hierarchy.axes, _IDENTITY, atol=0)
    row: dict[str, Any] = {
        "offsets": hierarchy.offsets.ravel().tolist(),
        "axes": [] if plain else hierarchy.axes.ravel().tolist(),
        "ends": [float(number) for joint, offset in hierarchy.end_sites for number in (joint, *offset)],
    }
    return {"skeleton": hashlib.sha256(canonical_json(row).encode()).hexdigest()[:16], **row}


def to_table(name: str, part: str, clip: SourceClip, height: float) -> pa.Table:
    """One clip's raw channels, rounded far below what moves a joint by 1e-4 of the body height.

    Args:
        height: body height in file units.
    """
    channels = clip.hierarchy.channel_names
    steps = np.array([_step(c.rpartition(".")[2], height) for c in channels])
    matrix = (np.round(clip.channels / steps) * steps).astype(np.float32)
    count = len(matrix)
    columns = [*key_columns(name, part, count), *columns_of(matrix)]
    return pa.Table.from_arrays(columns, names=["clip", "part", "frame", *channels])


def _step(channel: str, height: float) -> float:
    if channel.endswith("rotation"):
        return DEGREES_STEP
    if channel.endswith("quaternion"):
        return QUATERNION_STEP
    return float(2.0 ** np.floor(np.log2(max(height, 1e-9) * 1e-5)))


def own_rig(con: Connection, lake: Lake, clip: str) -> SourceClip:
    """A clip in its own rig, from its raw channels."""
    row = fetch(con, "clip", {"clip": clip})[0]
    layout = fetch(con, "layout", {"layout": row["layout"]})[0]
    skeleton = fetch(con, "skeleton", {"skeleton": row["skeleton"]})[0]
    joints = len(layout["joints"])
    axes = np.array(skeleton["axes"], dtype=float).reshape(-1, 4)
    ends = np.array(skeleton["ends"], dtype=float).reshape(-1, 4)
    hierarchy = Hierarchy(
        joints=tuple(layout["joints"]),
        parents=tuple(layout["parents"]),
        offsets=np.array(skeleton["offsets"], dtype=float).reshape(joints, 3),
        channels=tuple(tuple(c) for c in layout["channels"]),
        kind=ChannelKind(layout["kind"]),
        axes=axes if len(axes) else np.tile(_IDENTITY, (joints, 1)),
        fixed_axes=layout["fixed_axes"],
        end_sites=tuple((int(e[0]), (e[1], e[2], e[3])) for e in ends.tolist()),
    )
    names = hierarchy.channel_names
    path = sound(lake, lake.raw_part(row["layout"], row["part"]))
    table = pq.read_table(path, columns=["frame", *names], filters=[("clip", "==", clip)]).sort_by("frame")
    channels = matrix_of(table, names).astype(float)
    return SourceClip(hierarchy, channels, row["fps"], row["body"], row["metres_per_unit"])


def canonical_rig(con: Connection, lake: Lake, clip: str) -> SourceClip:
    """A clip retargeted to the canonical skeleton with the body's own bone lengths."""
    from motionlake.motion.canonicalise import to_source_clip

    return to_source_clip(canonical_motion(con, lake, clip))
