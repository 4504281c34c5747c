"""How people read each format in Python: as the libraries' documentation shows, to the numbers of every joint.

A library is imported where it is called, so that a bench leaves out what is not installed.
"""

from __future__ import annotations

import ctypes
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.humanml3d import REST_BONES, SMOOTHING_FRAMES
from motionlake.motion.marker_sets import fitting_sets, joint_centres
from motionlake.motion.smpl import BODY_JOINTS, INDEX

from bench.format_files import POINTS

# Joints along which HumanML3D's program turns bones, from the pelvis or the chest on.
CHAINS: Final = ((0, 2, 5, 8, 11), (0, 1, 4, 7, 10), (0, 3, 6, 9, 12, 15), (9, 14, 17, 19, 21), (9, 13, 16, 18, 20))
_SIDES: Final = ("hip", "shoulder")
# ufbx's binding frees some of what it hands out twice, so none of it is ever let go: this list outlives Python.
_HELD: Final[list[Any]] = []
ctypes.pythonapi.Py_IncRef(ctypes.py_object(_HELD))


def amass(path: Path) -> object:
    """Quaternions of the body's joints by NumPy and SciPy, and where the body is."""
    from scipy.spatial.transform import Rotation

    with np.load(path) as archive:
        vectors = archive["poses"][:, : 3 * BODY_JOINTS].reshape(-1, 3)
        return Rotation.from_rotvec(vectors).as_quat(), archive["trans"]


def glb(path: Path) -> object:
    """Where the animated joints are, as matrices: numbers by pygltflib, turned by SciPy, chained."""
    import pygltflib
    from scipy.spatial.transform import Rotation

    gltf = pygltflib.GLTF2().load(str(path))
    blob, widths = gltf.binary_blob(), {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
    animation, moved = gltf.animations[0], {}
    for channel in animation.channels:
        accessor = gltf.accessors[animation.samplers[channel.sampler].output]
        start = gltf.bufferViews[accessor.bufferView].byteOffset + (accessor.byteOffset or 0)
        width = widths[accessor.type]
        values = np.frombuffer(blob, "<f4", accessor.count * width, start).reshape(-1, width)
        moved[channel.target.node, channel.target.path] = values
    worlds: dict[int, np.ndarray[Any, Any]] = {}
    waiting: list[tuple[int, int | None]] = [(gltf.skins[0].skeleton, None)]
    while waiting:
        node, parent = waiting.pop()
        rotations = moved[node, "rotation"]
        local = np.tile(np.eye(4), (len(rotations), 1, 1))
        local[:, :3, :3] = Rotation.from_quat(rotations).as_matrix()
        local[:, :3, 3] = moved.get((node, "translation"), gltf.nodes[node].translation)
        worlds[node] = local if parent is None else worlds[parent] @ local
        waiting += [(child, node) for child in gltf.nodes[node].children or []]
    return worlds


def csv(path: Path) -> object:
    """The numbers of a table as text, by pandas."""
    import pandas

    return pandas.read_csv(path).to_numpy()


def parquet(path: Path) -> object:
    """The numbers of a Parquet table, by pandas."""
    import pandas

    return pandas.read_parquet(path).to_numpy()


def trc(path: Path) -> object:
    """The joints of Pose2Sim's points, whose numbers pandas reads; which points make which joint, motionlake says."""
    import pandas

    numbers = pandas.read_csv(path, sep="\t", skiprows=5, header=None).to_numpy()
    return joint_centres(fitting_sets(POINTS)[0], numbers[:, 2:].reshape(len(numbers), -1, 3), list(POINTS))


def motive(path: Path) -> object:
    """The numbers below the header, by pandas: quaternions and places of bones in the world."""
    import pandas

    return pandas.read_csv(path, skiprows=7).to_numpy()


def mot(path: Path) -> object:
    """The numbers below the header, by pandas: angles of joints."""
    import pandas

    return pandas.read_csv(path, sep="\t", skiprows=8).to_numpy()


def joints(path: Path) -> object:
    """The joints of HumanML3D's `new_joints`, by NumPy."""
    return np.load(path)


def joints_turned(path: Path) -> Float64Array:
    """[F, 22, 4] rotations of the bones of `new_joints`, by NumPy and SciPy."""
    return _inverse_kinematics(np.load(path))


def features_turned(path: Path) -> Float64Array:
    """[F, 22, 4] rotations of the bones where HumanML3D's features put them, by NumPy and SciPy."""
    return _inverse_kinematics(features(path))


def _inverse_kinematics(places: Float64Array) -> Float64Array:
    """[F, 22, 4] rotations of bones of joints [F, 22, 3], in the steps of HumanML3D's program.

    Heading smoothed in time, then along each chain the smallest turn of every bone, relative to the bone before.
    """
    from scipy.ndimage import gaussian_filter1d

    def unit(vectors: Float64Array) -> Float64Array:
        return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))

    def between(start: Float64Array, end: Float64Array) -> Float64Array:
        real = 1 + (start * end).sum(axis=-1, keepdims=True)
        return unit(np.concatenate([real, np.cross(np.broadcast_to(start, end.shape), end)], axis=-1))

    def product(one: Float64Array, other: Float64Array) -> Float64Array:
        real = one[:, :1] * other[:, :1] - (one[:, 1:] * other[:, 1:]).sum(axis=1, keepdims=True)
        rest = one[:, :1] * other[:, 1:] + other[:, :1] * one[:, 1:] + np.cross(one[:, 1:], other[:, 1:])
        return np.concatenate([real, rest], axis=1)

    left = {joint: places[:, INDEX[f"left_{joint}"]] - places[:, INDEX[f"right_{joint}"]] for joint in _SIDES}
    facing = np.cross(unit(left["hip"] + left["shoulder"]), [0.0, 1.0, 0.0])
    facing = unit(gaussian_filter1d(facing, SMOOTHING_FRAMES, axis=0, mode="nearest"))
    heading = between(facing, np.broadcast_to([0.0, 0.0, 1.0], facing.shape))
    found = np.zeros((len(places), BODY_JOINTS, 4))
    found[:, 0] = heading
    for chain in CHAINS:
        before = heading
        for parent, joint in pairwise(chain):
            own = between(REST_BONES[joint], unit(places[:, joint] - places[:, parent]))
            found[:, joint] = product(before * [1, -1, -1, -1], own)
            before = product(before, found[:, joint])
    return found


def features(path: Path) -> Float64Array:
    """[F, 22, 3] joints of HumanML3D's features by NumPy, in the steps of its program: heading, way, places."""
    rows = np.load(path)

    def turned(quaternion: Float64Array, vectors: Float64Array) -> Float64Array:
        axis = np.broadcast_to(quaternion[..., 1:], vectors.shape)
        across = np.cross(axis, vectors)
        return np.asarray(vectors + 2 * (quaternion[..., :1] * across + np.cross(axis, across)))

    angle = np.zeros(len(rows), rows.dtype)
    angle[1:] = np.cumsum(rows[:-1, 0])
    back = np.zeros((len(rows), 4), rows.dtype)
    back[:, 0], back[:, 2] = np.cos(angle), -np.sin(angle)
    way = np.zeros((len(rows), 3), rows.dtype)
    way[1:, [0, 2]] = rows[:-1, 1:3]
    root = np.cumsum(turned(back, way), axis=0)
    root[:, 1] = rows[:, 3]
    places = turned(back[:, None], rows[:, 4 : 4 + 3 * (BODY_JOINTS - 1)].reshape(len(rows), -1, 3))
    places[..., [0, 2]] += root[:, None, [0, 2]]
    return np.concatenate([root[:, None], places], axis=1)


def fbx(path: Path) -> object:
    """How the bones turn and stand below their parents in every frame, by ufbx."""
    import ufbx

    scene = ufbx.load_file(str(path))
    nodes, stacks = list(scene.nodes), list(scene.anim_stacks)
    _HELD.append((scene, nodes, stacks))
    [stack], rate = stacks, scene.settings.frames_per_second
    frames, found = round((stack.time_end - stack.time_begin) * rate) + 1, []
    for node in nodes:
        if node.bone is None:
            continue
        for frame in range(frames):
            at = ufbx.evaluate_transform(stack.anim, node, stack.time_begin + frame / rate)
            turn, place = at.rotation, at.translation
            found.append((turn.w, turn.x, turn.y, turn.z, place.x, place.y, place.z))
    return np.array(found).reshape(-1, frames, 7)


def usd(path: Path) -> object:
    """Where the joints are in the scene, as matrices, at every time code with a key, by usd-core."""
    from pxr import Usd, UsdGeom, UsdSkel

    stage = Usd.Stage.Open(str(path))
    cache, found = UsdSkel.Cache(), []
    for prim in stage.Traverse():
        if prim.IsA(UsdSkel.Skeleton):
            query = cache.GetSkelQuery(UsdSkel.Skeleton(prim))
            for code in query.GetAnimQuery().GetJointTransformTimeSamples():
                found.append(np.array(query.ComputeJointWorldTransforms(UsdGeom.XformCache(code))))
    return found
