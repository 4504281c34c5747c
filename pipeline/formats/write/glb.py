"""Writing a clip as a skinned .glb: a skeleton, one animation, and a body of sticks that shows it."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.parse.gltf_document import MAGIC
from motionlake.formats.write.registry import ClipToWrite
from motionlake.formats.write.whole import whole_file
from motionlake.motion.canonicalise import turn_to_y_up
from motionlake.motion.clip import POSITION_CHANNELS
from motionlake.motion.kinematics import solve
from motionlake.motion.rotations import IDENTITY, conjugate, multiply, rotate
from motionlake.motion.skeleton import chained
from motionlake.names import printable
from numpy.typing import NDArray

_FLOAT: Final = 5126
_SHORT: Final = 5123
_ARRAY: Final = 34962
_ELEMENTS: Final = 34963
WAIST: Final = 0.15  # of a bone: how far from its joint it is thickest
WIDTH: Final = 0.06  # of a bone
LOOSE: Final = 0.25  # of its length; a joint that goes farther from its parent hangs on it by no bone
_KINDS: Final = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
# A bone is an octahedron: its joint, four corners around its waist, its tip.
_FACES: Final = np.array(
    [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [5, 2, 1], [5, 3, 2], [5, 4, 3], [5, 1, 4]], np.uint16
)


class GlbWriter:
    """glTF 2.0 in one file, in the clip's own rig: metres, y up."""

    name = "glb"
    suffix = ".glb"
    rig = ""

    def write(self, motion: ClipToWrite, path: Path) -> None:
        """Write the file, whole or not at all."""
        data = glb_bytes(motion)
        with whole_file(path) as stream:
            stream.write(data)


class _Buffer:
    """Arrays one after another, and the accessors that tell of them."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, values: NDArray[Any], target: int | None = None, bounds: bool = False) -> int:
        """The index of the accessor of an array [n] or [n, k], of 16-bit whole numbers or else single precision."""
        component = _SHORT if values.dtype == np.uint16 else _FLOAT
        stored = values.astype("<u2" if component == _SHORT else "<f4")
        width = 1 if stored.ndim == 1 else stored.shape[1]
        self.data += bytes(-len(self.data) % 4)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": stored.nbytes}
        self.views.append(view if target is None else view | {"target": target})
        accessor: dict[str, Any] = {"bufferView": len(self.views) - 1, "componentType": component}
        accessor |= {"count": len(stored), "type": _KINDS[width]}
        if bounds:
            table = stored.reshape(len(stored), width)
            accessor |= {"min": table.min(axis=0).tolist(), "max": table.max(axis=0).tolist()}
        self.data += stored.tobytes()
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def glb_bytes(motion: ClipToWrite) -> bytes:
    """The file's bytes: in its rest pose the body is the clip's zero pose, of positions the first frame.

    Raises:
        ClipError: the channels cannot be solved, or the up axis is unknown.
    """
    clip, hierarchy = motion.clip, motion.clip.hierarchy
    turn = turn_to_y_up(motion.up)
    solved = solve(clip)
    parents = np.array(hierarchy.parents)
    joints = len(parents)
    positions = rotate(turn, solved.positions) * motion.metres_per_unit
    moved = set(range(joints))
    bones = np.where(parents[:, None] < 0, 0.0, positions[0] - positions[0, parents])
    below = positions - positions[:, parents]
    rotations: Float64Array | None = None
    if solved.local is not None and solved.world is not None:
        rotations = multiply(multiply(turn, solved.local), conjugate(turn))
        world = multiply(multiply(turn, solved.world), conjugate(turn))
        below = rotate(conjugate(world[:, parents]), below)
        bones = rotate(turn, hierarchy.offsets) * motion.metres_per_unit
        bones[0] = 0.0
        moved = {0, *(j for j, names in enumerate(hierarchy.channels) if set(names) & set(POSITION_CHANNELS))}
    below[:, 0] = positions[:, 0]
    sites = [(j, rotate(turn, np.array(offset)) * motion.metres_per_unit) for j, offset in hierarchy.end_sites]
    buffer = _Buffer()
    times = buffer.add(np.arange(len(positions)) / clip.fps, bounds=True)
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    for joint in range(joints):
        tracks = {"translation": below[:, joint]} if joint in moved else {}
        if rotations is not None:
            tracks["rotation"] = rotations[:, joint][:, [1, 2, 3, 0]]
        for what, values in tracks.items():
            channels.append({"sampler": len(samplers), "target": {"node": joint, "path": what}})
            samplers.append({"input": times, "output": buffer.add(values), "interpolation": "LINEAR"})
    nodes: list[dict[str, Any]] = []
    for joint, name in enumerate(hierarchy.joints):
        node: dict[str, Any] = {"name": printable(name), "translation": bones[joint].tolist()}
        children = [child for child in range(joints) if parents[child] == joint]
        nodes.append(node | ({"children": children} if children else {}))
    name = printable(motion.name)
    nodes.append({"name": name or "body", "mesh": 0, "skin": 0})
    standing = chained(bones, hierarchy.parents)
    inverse = np.tile(np.eye(4), (joints, 1, 1))
    inverse[:, 3, :3] = -standing  # columns one after another
    lengths = np.linalg.norm(below, axis=-1)
    loose = {
        joint for joint in moved if rotations is not None and np.ptp(lengths[:, joint]) > LOOSE * lengths[0, joint]
    }
    held = [(parent, joint) for joint, parent in enumerate(hierarchy.parents) if parent >= 0 and joint not in loose]
    primitive = _sticks(buffer, standing, held, sites)
    material = {"pbrMetallicRoughness": {"baseColorFactor": [0.45, 0.6, 0.8, 1.0], "metallicFactor": 0.0}}
    document = {
        "asset": {"version": "2.0", "generator": "motionlake", "extras": _told(motion)},
        "scene": 0,
        "scenes": [{"nodes": [0, joints]}],
        "nodes": nodes,
        "meshes": [{"primitives": [primitive]}],
        "materials": [material],
        "skins": [
            {
                "joints": list(range(joints)),
                "skeleton": 0,
                "inverseBindMatrices": buffer.add(inverse.reshape(joints, 16)),
            }
        ],
        "animations": [{"name": name, "samplers": samplers, "channels": channels}],
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": len(buffer.data)}],
    }
    return _packed(document, bytes(buffer.data))


def _told(motion: ClipToWrite) -> dict[str, str]:
    return {name: str(value) for name, value in motion.facts.items() if value is not None}


def _sticks(
    buffer: _Buffer, standing: Float64Array, held: list[tuple[int, int]], sites: list[tuple[int, Float64Array]]
) -> dict[str, Any]:
    """An octahedron for each pair of joints, `held`; its tip moves with the second one, so that it stays there.

    Raises:
        ClipError: more bones than 16-bit indices count.
    """
    bones = [(parent, joint, standing[joint]) for parent, joint in held]
    bones += [(joint, joint, standing[joint] + offset) for joint, offset in sites]
    if not bones:
        bones = [(0, 0, standing[0] + [0.0, 0.1, 0.0])]
    if len(bones) * 6 > np.iinfo(np.uint16).max:
        raise ClipError(f"has {len(bones)} bones, more than one mesh of a GLB holds")
    corners, owners, faces = [], [], []
    for number, (joint, end, tip) in enumerate(bones):
        along = tip - standing[joint]
        aside = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
        length = np.linalg.norm(aside)
        aside = aside / length * np.linalg.norm(along) * WIDTH if length > 0 else np.zeros(3)
        across = np.cross(along, aside) / max(float(np.linalg.norm(along)), np.finfo(float).tiny)
        waist = standing[joint] + WAIST * along
        corners += [standing[joint], waist + aside, waist + across, waist - aside, waist - across, tip]
        owners += [joint] * 5 + [end]
        faces.append(_FACES + 6 * number)
    owner = np.zeros((len(owners), 4), np.uint16)
    owner[:, 0] = owners
    weights = np.tile(IDENTITY, (len(owners), 1))
    attributes = {
        "POSITION": buffer.add(np.array(corners), _ARRAY, bounds=True),
        "JOINTS_0": buffer.add(owner, _ARRAY),
        "WEIGHTS_0": buffer.add(weights, _ARRAY),
    }
    indices = buffer.add(np.concatenate(faces).ravel().astype(np.uint16), _ELEMENTS)
    return {"attributes": attributes, "indices": indices, "material": 0}


def _packed(document: dict[str, Any], binary: bytes) -> bytes:
    text = json.dumps(document, separators=(",", ":")).encode()
    chunks = b""
    for kind, content, filler in ((b"JSON", text, b" "), (b"BIN\0", binary, b"\0")):
        content += filler * (-len(content) % 4)
        chunks += struct.pack("<I4s", len(content), kind) + content
    return MAGIC + struct.pack("<II", 2, 12 + len(chunks)) + chunks


WRITER: Final = GlbWriter()
