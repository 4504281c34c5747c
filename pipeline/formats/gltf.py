"""glTF 2.0 (.glb, .gltf): the skeletons of skins, moved by the file's animations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.parse.gltf_document import (
    GltfDocument,
    external_names,
    indices,
    json_of,
    numbers,
    objects,
    whole,
)
from motionlake.formats.parse.keys import even_count, even_rate, sample
from motionlake.formats.parse.placings import Placing, Placings
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
from motionlake.formats.registry import load_bytes
from motionlake.motion.clip import SourceClip
from motionlake.motion.rotations import MIN_LENGTH

# What animations turn in a file without a skin is taken for a body from so many nodes on.
FEWEST_TURNED: Final = 10
_WIDTHS: Final = {"translation": "VEC3", "rotation": "VEC4", "scale": "VEC3"}


class GltfReader:
    """glTF scenes: a clip for every animation and every body that it moves."""

    name = "glTF"
    suffixes = (".glb", ".gltf")

    def companions(self, path: Path) -> list[Path]:
        """The buffers beside the file; `ClipError` where one is outside of its folder, or there is no JSON."""
        document, _ = json_of(load_bytes(path))
        return [path.parent / name for name in external_names(document)]

    def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
        """Read every animation of every body, sampled at one rate each, which a note says.

        Raises:
            ClipError: no glTF 2.0, no skin or no animation that moves one, or numbers that are not there.
        """
        text, binary = json_of(data)
        beside = {name: _beside(path.parent / name) for name in external_names(text)}
        scene = _Scene.of(GltfDocument(text, binary, beside))
        trees = scene.trees()
        takes = [take for number in range(scene.animations) for take in scene.takes(number, trees)]
        if not takes:
            raise ClipError("has no animation that moves a skin's joints")
        long = [take for take in takes if take.frames > 1] or takes[:1]
        check_room((take.frames, len(take.tree.nodes)) for take in long)
        names = body_names([(take.name, scene.body_name(take.tree)) for take in long])
        short = sorted({take.name for take in takes} - {take.name for take in long})
        notes = (f"left out, since they are no motion: {', '.join(map(repr, short))}",) if short else ()
        return [scene.clip(take, name, fps, notes) for take, name in zip(long, names, strict=True)]


def _beside(path: Path) -> bytes:
    try:
        return load_bytes(path)
    except ClipError as error:
        raise ClipError(f"its buffer {path.name} {error.reason}") from error


@dataclass(frozen=True)
class _Track:
    """The keys of one property of one node; `keys` is the index of the accessor of their times."""

    node: int
    what: str
    keys: int
    values: int
    how: str


@dataclass(frozen=True)
class _Take:
    """One animation of one body: `frames` instants from `start` on, seconds."""

    name: str
    tree: JointTree
    tracks: tuple[_Track, ...]
    rate: float
    start: float
    frames: int
    note: str


@dataclass(frozen=True)
class _Scene:
    """The nodes of a file, and what moves them."""

    document: GltfDocument
    names: tuple[str, ...]
    parents: tuple[int, ...]
    rest: tuple[Placing, ...]
    times: dict[int, Float64Array]

    @classmethod
    def of(cls, document: GltfDocument) -> _Scene:
        nodes = document.objects("nodes")
        parents = [-1] * len(nodes)
        for number, node in enumerate(nodes):
            for child in indices(node, "children", len(nodes)):
                if parents[child] >= 0:
                    raise ClipError(f"node {child} is below two others")
                parents[child] = number
        names = tuple(node["name"] if isinstance(node.get("name"), str) else "" for node in nodes)
        return cls(document, names, tuple(parents), tuple(map(_placing, nodes)), {})

    @property
    def animations(self) -> int:
        return len(self.document.objects("animations"))

    def trees(self) -> list[JointTree]:
        """The bodies' joints; without skins, the nodes that animations turn, where they are many."""
        skins = self.document.objects("skins")
        joints = [found for skin in skins if (found := indices(skin, "joints", len(self.names)))]
        if not joints:
            turned = {t.node for a in range(self.animations) for t in self.tracks(a) if t.what == "rotation"}
            if len(turned) < FEWEST_TURNED:
                raise ClipError("has no skin, and hence no skeleton")
            joints = [sorted(turned)]
        return body_trees(self.parents, joints)

    def tracks(self, animation: int) -> list[_Track]:
        """What an animation moves: translations, rotations and scales of nodes."""
        animations = self.document.objects("animations")
        samplers = objects(animations[animation], "samplers")
        found = []
        for channel in objects(animations[animation], "channels"):
            target = channel.get("target")
            what = target.get("path") if isinstance(target, dict) else None
            if not isinstance(target, dict) or what not in _WIDTHS or "node" not in target:
                continue  # weights of shapes, and what extensions move
            node = whole(target, "node", most=len(self.names))
            sampler = samplers[whole(channel, "sampler", most=len(samplers))]
            how = sampler.get("interpolation", "LINEAR")
            if how not in ("LINEAR", "STEP", "CUBICSPLINE"):
                raise ClipError(f"has keys that are interpolated as {str(how)[:20]!r}")
            found.append(_Track(node, what, whole(sampler, "input"), whole(sampler, "output"), how))
        return found

    def takes(self, animation: int, trees: Sequence[JointTree]) -> list[_Take]:
        """An animation as it moves each body that it moves."""
        name = self.document.objects("animations")[animation].get("name")
        found = []
        moved = self.tracks(animation)
        for tree in trees:
            members = set(tree.nodes)
            tracks = tuple(track for track in moved if track.node in members)
            if not tracks:
                continue
            keys = np.unique(np.concatenate([self.keys(number) for number in {track.keys for track in tracks}]))
            rate, note = even_rate(keys)
            frames = even_count(keys, rate)
            title = name if isinstance(name, str) else ""
            found.append(_Take(title, tree, tracks, rate, float(keys[0]), frames, note))
        return found

    def keys(self, accessor: int) -> Float64Array:
        """[K] the times of keys; read once, since tracks share them."""
        if accessor not in self.times:
            self.times[accessor] = self.document.accessor(accessor, ("SCALAR",))[:, 0]
        return self.times[accessor]

    def body_name(self, tree: JointTree) -> str:
        """The name of a skin that moves the body, or of its root."""
        joints = set(tree.joints)
        for skin in self.document.objects("skins"):
            name = skin.get("name")
            if isinstance(name, str) and name and joints.intersection(indices(skin, "joints", len(self.names))):
                return name
        return self.names[tree.joints[0]] if tree.joints[0] >= 0 else ""

    def clip(self, take: _Take, body: str, fps: float | None, notes: tuple[str, ...]) -> SourceClip:
        tree = take.tree
        rest = [self.rest[node] if node >= 0 else Placing() for node in tree.nodes]
        moved = Placings.of(self._moved(take, rest))
        names = [self.names[node] if node >= 0 else "scene" for node in tree.nodes]
        sampled = (take.note,) if fps is None else ()
        return clip_of_worlds(
            joint_names(names[tree.root :]),
            tree.joint_parents,
            worlds(tree, moved, take.frames),
            bind_pose(tree, rest, self._bound(tree)),
            fps=take.rate if fps is None else fps,
            body=body,
            metres_per_unit=1.0,
            up="y",
            notes=(*sampled, *uneven_note(names, moved), *notes),
        )

    def _moved(self, take: _Take, rest: Sequence[Placing]) -> list[Placing]:
        at = take.start + np.arange(take.frames) / take.rate
        found: dict[tuple[int, str], Float64Array] = {}
        for track in take.tracks:
            values = self.document.accessor(track.values, (_WIDTHS[track.what],))
            turns = track.what == "rotation"
            sampled = sample(self.keys(track.keys), values, at, track.how, turns)
            found[track.node, track.what] = sampled[:, [3, 0, 1, 2]] if turns else sampled
        return [
            Placing(*(found.get((node, what), getattr(own, what)) for what in _WIDTHS))
            for node, own in zip(take.tree.nodes, rest, strict=True)
        ]

    def _bound(self, tree: JointTree) -> dict[int, Float64Array]:
        """By node, the matrix [4, 4] at which it was bound to a skin, in that skin's mesh."""
        members = set(tree.joints)
        found: dict[int, Float64Array] = {}
        for skin in self.document.objects("skins"):
            joints = indices(skin, "joints", len(self.names))
            if "inverseBindMatrices" not in skin or not members.intersection(joints):
                continue
            matrices = self.document.accessor(whole(skin, "inverseBindMatrices"), ("MAT4",))
            for joint, columns in zip(joints, matrices.reshape(-1, 4, 4), strict=False):
                found.setdefault(joint, columns.T)
        return found


def _placing(node: dict[str, Any]) -> Placing:
    if "matrix" in node:
        columns = numbers(node, "matrix", (0.0,) * 16)
        return Placing.of_matrices(columns.reshape(1, 4, 4).transpose(0, 2, 1))
    turn = numbers(node, "rotation", (0.0, 0.0, 0.0, 1.0))[[3, 0, 1, 2]]
    length = float(np.linalg.norm(turn))
    if not length > MIN_LENGTH:
        raise ClipError("has a node whose rotation has length zero")
    translation = numbers(node, "translation", (0.0, 0.0, 0.0))
    return Placing(translation[None], (turn / length)[None], numbers(node, "scale", (1.0, 1.0, 1.0))[None])


READER: Final = GltfReader()
