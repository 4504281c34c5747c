"""FBX: the bones of a scene, moved by each of its animation stacks. Read through ufbx, an optional library."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from motionlake.errors import ClipError
from motionlake.formats.parse.fbx_nodes import read_nodes
from motionlake.motion.clip import SourceClip

_BINARY: Final = b"Kaydara FBX Binary"


class FbxReader:
    """FBX scenes: a clip for every animation stack and every skeleton."""

    name = "FBX"
    suffixes = (".fbx",)

    def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
        """Read every stack of every skeleton at the scene's frame rate, metres and y up as ufbx turns them.

        Raises:
            ClipError: ufbx is not installed, cannot read the file, or finds no bones or no animation.
        """
        _check_whole(data)
        return read_nodes(data).clips(fps)


def _check_whole(data: bytes) -> None:
    """Reject text that is cut short, of which ufbx takes what is left."""
    if data.startswith(_BINARY):
        return
    from motionlake.formats.parse.fbx_braces import open_braces

    if open_braces(np.frombuffer(data, np.uint8)):
        raise ClipError("is cut short: it has braces that are not closed")


READER: Final = FbxReader()
