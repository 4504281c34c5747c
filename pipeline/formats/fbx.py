"""FBX: the bones of a scene, moved by each of its animation stacks. Read through ufbx, an optional library."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from motionlake.errors import ClipError
from motionlake.formats.parse.fbx_nodes import FbxNodes, read_nodes
from motionlake.formats.parse.scene import (
    JointTree,
    Placing,
    bind_pose,
    body_names,
    body_trees,
    check_room,
    clip_of_worlds,
    joint_names,
    uneven_note,
    worlds,
)
from motionlake.motion.clip import SourceClip

_BINARY: Final = b"Kaydara FBX Binary"
_WORDS: Final = re.compile(rb'"[^"]*"|;[^\n]*')  # and remarks, whose braces are none


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
        scene = read_nodes(data)
        trees = body_trees(scene.parents, _skeletons(scene))
        takes = [(stack, tree) for stack in range(len(scene.stacks)) for tree in trees]
        frames = [max(len(placing.translation) for placing in moved) for moved in scene.moved]
        check_room((frames[stack], len(tree.nodes)) for stack, tree in takes)
        names = body_names([(scene.stacks[stack], scene.names[tree.joints[0]]) for stack, tree in takes])
        return [
            _clip(scene, tree, stack, frames[stack], body, fps)
            for (stack, tree), body in zip(takes, names, strict=True)
        ]


def _check_whole(data: bytes) -> None:
    """Reject text that is cut short, of which ufbx takes what is left."""
    if data.startswith(_BINARY):
        return
    marks = _WORDS.sub(b"", data)
    if marks.count(b"{") != marks.count(b"}"):
        raise ClipError("is cut short: it has braces that are not closed")


def _clip(scene: FbxNodes, tree: JointTree, stack: int, frames: int, body: str, fps: float | None) -> SourceClip:
    names = [scene.names[node] if node >= 0 else "scene" for node in tree.nodes]
    moved = _of_tree(tree, scene.moved[stack])
    return clip_of_worlds(
        joint_names(names[tree.root :]),
        tree.joint_parents,
        worlds(tree, moved, frames),
        bind_pose(tree, _of_tree(tree, scene.rest), {}),
        fps=scene.rate if fps is None else fps,
        body=body,
        metres_per_unit=1.0,
        up="y",
        notes=uneven_note(names, moved),
    )


def _of_tree(tree: JointTree, placings: tuple[Placing, ...]) -> list[Placing]:
    return [Placing() if node < 0 else placings[node] for node in tree.nodes]


def _skeletons(scene: FbxNodes) -> list[list[int]]:
    """Bones that hang from one bone."""
    top: dict[int, int] = {}
    found: dict[int, list[int]] = {}
    known = set(scene.bones)
    for node, parent in enumerate(scene.parents):  # parents first
        above = top.get(parent, -1)
        top[node] = node if above < 0 and node in known else above
        if node in known:
            found.setdefault(top[node], []).append(node)
    return list(found.values())


READER: Final = FbxReader()
