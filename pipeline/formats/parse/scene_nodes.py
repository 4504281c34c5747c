"""The nodes of a scene as a process of its own sends them, and the clips that are made of them.

Libraries read FBX and USD (`own_process`); what they find of both is the same.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray, UInt8Array
from motionlake.formats.parse.placings import Placings
from motionlake.formats.parse.scene import (
    bind_pose,
    body_names,
    check_room,
    clip_of_worlds,
    joint_names,
    uneven_note,
    worlds,
)
from motionlake.formats.parse.scene_trees import JointTree, body_trees
from motionlake.motion.clip import SourceClip

_BYTES: Final = {"float32": 4, "float64": 8}


@dataclass(frozen=True)
class SceneHead:
    """What is said of the N nodes of a scene that are bones or above bones.

    Attributes:
        names: of the nodes.
        parents: of each its parent, -1 at the top; parents come first.
        skeletons: for each skeleton its bones, and its name.
        rate: frames a second.
        takes: names of the animations.
        frames: of each animation.
        metres_per_unit, up: as a `SourceClip` has them.
        notes: of every clip.
    """

    names: Sequence[str]
    parents: Sequence[int]
    skeletons: Sequence[tuple[Sequence[int], str]]
    rate: float
    takes: Sequence[str]
    frames: Sequence[int]
    metres_per_unit: float | None
    up: str
    notes: Sequence[str] = ()


@dataclass(frozen=True)
class SceneNodes:
    """A scene's nodes and how they are placed.

    Attributes:
        head: what is said of them.
        bound: [N, 4, 4] the inverse of the matrix at which each was bound to a skin; NaN where it was not.
        rest: how the nodes rest below their parents, F = 1.
        moved: of each animation how it places them; of single precision where the file is.
    """

    head: SceneHead
    bound: Float64Array
    rest: Placings
    moved: Sequence[Placings]

    def sent(self) -> list[memoryview]:
        """JSON, to whole numbers of eight bytes, with its length before it, and the arrays after it, each so too."""
        arrays = [self.bound, *(part for each in (self.rest, *self.moved) for part in vars(each).values())]
        kinds = [(array.dtype.name, array.shape) for array in arrays]
        head = json.dumps([vars(self.head), kinds]).encode()
        head += b" " * (-len(head) % 8)
        parts = [memoryview(len(head).to_bytes(8, "little")), memoryview(head)]
        for array in arrays:
            parts += [np.ascontiguousarray(array).data, memoryview(bytes(-array.nbytes % 8))]
        return [part for part in parts if part.nbytes]

    @classmethod
    def received(cls, sent: UInt8Array) -> SceneNodes:
        """The other side of `sent`."""
        begin = 8 + int.from_bytes(sent[:8].tobytes(), "little")
        head, kinds = json.loads(sent[8:begin].tobytes())
        arrays: list[FloatArray] = []
        for kind, shape in kinds:
            size = math.prod(shape) * _BYTES[kind]
            arrays.append(sent[begin : begin + size].view(kind).reshape(shape))
            begin += size + -size % 8
        bound, *parts = arrays
        rest, *moved = (Placings(*parts[at : at + 3]) for at in range(0, len(parts), 3))
        return cls(SceneHead(**head), np.asarray(bound, np.float64), rest, moved)

    def clips(self, fps: float | None) -> list[SourceClip]:
        """A clip for every animation and every skeleton, at `fps` in place of the scene's rate.

        Raises:
            ClipError: more than `limits` allow, or nodes that are scaled to nothing.
        """
        head = self.head
        trees = body_trees(head.parents, [bones for bones, _ in head.skeletons])
        takes = [(take, tree) for take in range(len(head.takes)) for tree in trees]
        check_room((head.frames[take], len(tree.nodes)) for take, tree in takes)
        names = body_names([(head.takes[take], self._name(tree)) for take, tree in takes])
        return [self._clip(take, tree, body, fps) for (take, tree), body in zip(takes, names, strict=True)]

    def _name(self, tree: JointTree) -> str:
        members = set(tree.joints)
        return next(name for bones, name in self.head.skeletons if members.intersection(bones))

    def _clip(self, take: int, tree: JointTree, body: str, fps: float | None) -> SourceClip:
        names = [self.head.names[node] if node >= 0 else "scene" for node in tree.nodes]
        moved = self.moved[take]
        bound = {node: self.bound[node] for node in tree.joints if node >= 0 and np.isfinite(self.bound[node]).all()}
        return clip_of_worlds(
            joint_names(names[tree.root :]),
            tree.joint_parents,
            worlds(tree, moved, self.head.frames[take], tree.nodes),
            bind_pose(tree, self.rest.of_nodes(tree.nodes), bound),
            fps=self.head.rate if fps is None else fps,
            body=body,
            metres_per_unit=self.head.metres_per_unit,
            up=self.head.up,
            notes=(*self.head.notes, *uneven_note(names, moved, tree.nodes)),
        )
