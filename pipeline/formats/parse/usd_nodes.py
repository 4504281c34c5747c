"""The skeletons of a USD file and how its animations place them."""

from __future__ import annotations

from motionlake.formats.parse.scene_nodes import SceneNodes
from motionlake.formats.parse.usd_library import sent_by_library
from motionlake.formats.parse.usd_packed import NotPlainError
from motionlake.formats.parse.usd_plain import plain_nodes


def read_nodes(data: bytes) -> SceneNodes:
    """The skeletons of a file that animations move, and what is above them, in the stage's unit and axes.

    A binary layer that is made of nothing else is read here, which takes a third of the time; all others, and those of
    which something is in doubt, by usd-core in a process of its own.

    Raises:
        ClipError: usd-core is needed and not installed, cannot read the file or ends with it; or the file names other
            files, has no animated skeleton, or more than `limits` allow.
    """
    try:
        return plain_nodes(data)
    except NotPlainError:
        return SceneNodes.received(sent_by_library(data))
