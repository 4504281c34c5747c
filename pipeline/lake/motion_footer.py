"""What a frames part says of itself: JSON below the key `motion` of its footer, as docs/lake-format.md describes it.

With it a part can be read alone: which joints the columns are of, what rotations turn, and each clip's rate and bones.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from motionlake.errors import UserError
from motionlake.motion.skeleton import JOINTS, PARENTS
from numpy.typing import ArrayLike

KEY: Final = "motion"
VERSION: Final = 1  # of frames parts: their columns and this footer
_CONVENTIONS: Final[Mapping[str, Any]] = {
    "version": VERSION,
    "unit": "metre",
    "up": "y",
    "handedness": "right",
    "joints": JOINTS,
    "parents": PARENTS,
    "rest_pose": "T-pose facing +z, the body's left towards +x",
    "rotations": {
        "order": "wxyz",
        "of": "local: a joint relative to its parent, in the rest pose the identity",
        "position": "of the parent + rest offset of the joint turned by the parent's world rotation",
    },
    "columns": {
        "root": ["root_x", "root_y", "root_z"],
        "rotation": ["{joint}_qw", "{joint}_qx", "{joint}_qy", "{joint}_qz"],
        "position": ["{joint}_x", "{joint}_y", "{joint}_z"],
    },
}


def footer_clip(fps: float, rest_offsets: ArrayLike) -> dict[str, Any]:
    """What a footer says of one clip; `rest_offsets` [21, 3], metres, are rounded to micrometres."""
    offsets = np.asarray(rest_offsets, dtype=np.float32).astype(float)  # first as the catalog has them
    offsets = offsets.reshape(len(JOINTS), 3).round(6) + 0.0  # no -0.0
    return {"fps": float(fps), "rest_offsets": offsets.tolist()}


def motion_footer(clips: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """The footer's key and text for a part of clips as `footer_clip` gives them."""
    return {KEY: json.dumps({**_CONVENTIONS, "clips": clips}, ensure_ascii=False, separators=(",", ":"))}


def open_frames(path: Path) -> pq.ParquetFile:
    """Open a frames part.

    Raises:
        UserError: the file is damaged, or its footer is of another version.
    """
    try:
        part = pq.ParquetFile(path)
        footer = json.loads((part.metadata.metadata or {}).get(KEY.encode(), b'{"version": 0}'))
        version = footer["version"]
    except (pa.ArrowInvalid, ValueError, KeyError, TypeError) as error:
        reason = str(error).splitlines()[0]
        raise UserError(f"{path}: is a damaged frames part ({reason}); put back a copy, or make a new lake") from error
    if version != VERSION:
        todo = "update motionlake" if version > VERSION else "`motionlake migrate` brings a lake up to date"
        raise UserError(f"{path}: is a frames part of version {version}, and version {VERSION} is read here; {todo}")
    return part
