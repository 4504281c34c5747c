"""The skeletons of a binary USD layer that stands for itself: it is made of no other layer, nor of parts of itself.

What composes a stage (layers, references, payloads, classes, variants, instances, clips) and values between keys are
for the library (`usd_library`), and so is every file of which something is in doubt: `NotPlainError`.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray
from motionlake.formats.parse.scene_nodes import SceneNodes
from motionlake.formats.parse.usd_crate import MAGIC, Crate
from motionlake.formats.parse.usd_packed import NotPlainError
from motionlake.formats.parse.usd_scene import (
    QUATERNION,
    TRACKS,
    UsdSkeleton,
    UsdStage,
    checked_joints,
    nodes_of,
    of_all_joints,
    real_first,
    rows_at,
)
from motionlake.formats.parse.usd_values import HALF_VECTORS, QUATERNIONS, VECTORS, Samples, Values

# Fields of a layer or prim that make it of something else, or leave it or parts of it out.
_COMPOSED: Final = frozenset(
    (
        "active", "clips", "clipSets", "inheritPaths", "instanceable", "layerRelocates", "payload", "primOrder",
        "propertyOrder", "references", "relocates", "specializes", "spline", "subLayers", "variantSelection",
        "variantSetNames",
    )
)  # fmt: skip
_PLACING: Final = ("Xform", "SkelRoot", "Skeleton")  # types of prims that place what is below them
_LEAVING: Final = ("Scope", "")  # and that do not
_KINDS: Final = (VECTORS, QUATERNIONS, HALF_VECTORS)  # of the numbers of `TRACKS`
_DEFINED: Final = 0
_BINDING: Final = "SkelBindingAPI"
_SOURCE: Final = "skel:animationSource"
_AXES: Final = {"Y": "y", "Z": "z"}
_CODES_A_SECOND: Final = 24.0  # where a layer does not say
_ORDERS: Final = ("X", "Y", "Z", "XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
_TURNED: Final = {f"rotate{order}": order.lower() for order in _ORDERS}


def plain_nodes(data: bytes) -> SceneNodes:
    """The skeletons of a file, as `usd_library` finds them.

    Raises:
        ClipError: as `usd_scene.nodes_of`.
        NotPlainError: it is for the library.
    """
    if not data.startswith(MAGIC):
        raise NotPlainError("is no binary layer")
    try:
        layer = _Layer(data)
        return nodes_of(layer.stage(), layer.skeletons())
    except (ValueError, IndexError, KeyError, OverflowError, struct.error) as error:
        raise NotPlainError("is damaged") from error


class _Layer:
    """The prims of a layer, by path."""

    def __init__(self, data: bytes) -> None:
        crate = Crate(data)
        self.fields, self.values = crate.fields, Values(crate)
        if any(not _COMPOSED.isdisjoint(fields) for fields in self.fields.values()):
            raise NotPlainError("is composed")

    def stage(self) -> UsdStage:
        root, number = self.fields["/"], self.values.number
        shown = number(root["framesPerSecond"]) if "framesPerSecond" in root else _CODES_A_SECOND
        begins, ends = root.get("startTimeCode"), root.get("endTimeCode")
        return UsdStage(
            number(root["timeCodesPerSecond"]) if "timeCodesPerSecond" in root else shown,
            None if begins is None or ends is None else (number(begins), number(ends)),
            shown,
            number(root["metersPerUnit"]) if "metersPerUnit" in root else None,
            _AXES[self.values.word(root["upAxis"])] if "upAxis" in root else "y",
        )

    def skeletons(self) -> Iterator[UsdSkeleton]:
        """Those that have joints and an animation of joints, in the order of the layer."""
        for path in self._defined():
            if self._kind(path) != "Skeleton":
                continue
            joints = checked_joints(self._names(f"{path}.joints"))
            source = self._source(path)
            if not joints or source is None:
                continue
            animated = self._names(f"{source}.joints")
            if set(animated) & set(joints):
                yield UsdSkeleton(
                    path,
                    self._above(path),
                    joints,
                    animated,
                    [self._track(f"{source}.{name}", kind) for name, kind in zip(TRACKS, _KINDS, strict=True)],
                    of_all_joints(self._matrices(f"{path}.restTransforms"), len(joints)),
                    of_all_joints(self._matrices(f"{path}.bindTransforms"), len(joints)),
                )

    def _defined(self) -> Iterator[str]:
        """Paths of the prims that are there, each once, before those below it."""
        waiting, seen = ["/"], set[str]()
        while waiting:
            path = waiting.pop()
            if path in seen:  # one that is named twice would be so again and again below others
                raise NotPlainError("names a prim twice")
            seen.add(path)
            fields = self.fields[path]
            if path != "/":
                if self.values.specifier(fields["specifier"]) != _DEFINED:
                    continue
                yield path
            if "primChildren" in fields:
                begin = path.rstrip("/")
                waiting += [f"{begin}/{name}" for name in reversed(self.values.words(fields["primChildren"]))]

    def _kind(self, path: str) -> str:
        said = self.fields[path].get("typeName")
        return "" if said is None else self.values.word(said)

    def _names(self, path: str) -> list[str]:
        """What an attribute that does not move says; none where it says nothing."""
        said = self._still(path)
        return [] if said is None else self.values.words(said)

    def _matrices(self, path: str) -> Float64Array:
        said = self._still(path)
        return np.empty(0) if said is None else np.asarray(self.values.numbers(said), np.float64)

    def _still(self, path: str) -> int | None:
        fields = self.fields.get(path, {})
        if "timeSamples" in fields:
            raise NotPlainError("has an attribute that moves and should not")
        return fields.get("default")

    def _source(self, path: str) -> str | None:
        """The animation that the nearest prim from a skeleton upwards names, if one does."""
        here = path
        while here:
            fields = self.fields[here]
            rel = self.fields.get(f"{here}.{_SOURCE}")
            if rel is not None:
                applied = self.values.applied(fields["apiSchemas"]) if "apiSchemas" in fields else []
                targets = self.values.targets(rel["targetPaths"]) if "targetPaths" in rel else []
                if _BINDING not in applied or len(targets) != 1 or targets[0] not in self._defined():
                    raise NotPlainError("has a binding of another kind")
                if self._kind(targets[0]) != "SkelAnimation":
                    raise NotPlainError("is moved by something else")
                return targets[0]
            here = here.rpartition("/")[0]
        return None

    def _track(self, path: str, kind: int) -> _Track:
        fields = self.fields.get(path, {})
        if "timeSamples" in fields:
            return _Track(self.values.samples(fields["timeSamples"], kind))
        if "default" in fields:
            return _Track(Samples(np.empty(0), self.values.array(fields["default"], kind)[None]))
        return _Track(None)

    def _above(self, path: str) -> list[_Node]:
        """The prims that place a skeleton, from the top on, itself last."""
        names = path.strip("/").split("/")
        found = []
        for depth, name in enumerate(names, start=1):
            here = "/" + "/".join(names[:depth])
            kind = self._kind(here)
            if kind in _PLACING:
                found.append(_Node(name, self._placed(here)))
            elif kind not in _LEAVING:
                raise NotPlainError("has a prim of another kind above a skeleton")
        return found

    def _placed(self, path: str) -> Float64Array:
        """[4, 4] how a prim that does not move is placed below its parent, for column vectors."""
        matrix = np.eye(4)
        for name in self._names(f"{path}.xformOpOrder"):
            said = self._still(f"{path}.{name}")
            begin, kind, *_ = name.split(":")
            if begin != "xformOp" or said is None:
                raise NotPlainError("is placed otherwise")
            matrix = matrix @ _operation(kind, np.asarray(self.values.numbers(said), np.float64))
        return matrix


@dataclass(frozen=True)
class _Node:
    """A prim that places what is below it and does not move."""

    name: str
    matrix: Float64Array
    times: Sequence[float] = ()

    def matrices(self, codes: Float64Array) -> Float64Array:
        return self.matrix[None]


@dataclass(frozen=True)
class _Track:
    """What an animation says of its joints, at keys or once for all."""

    said: Samples | None

    @property
    def has_value(self) -> bool:
        return self.said is not None

    @property
    def times(self) -> Float64Array:
        return np.empty(0) if self.said is None else self.said.times

    def sampled(self, codes: Float64Array, joints: int, width: int) -> FloatArray:
        assert self.said is not None
        values = self.said.values
        if values.shape[1:] != (joints, width):
            raise NotPlainError("does not say one thing of each joint")
        if len(values) > 1:
            rows = rows_at(self.said.times, codes)
            if rows is None:
                raise NotPlainError("is asked for between its keys")
            values = values[rows]
        return real_first(values) if width == QUATERNION else values


def _operation(kind: str, value: Float64Array) -> Float64Array:
    """[4, 4] what one operation does, for column vectors."""
    from scipy.spatial.transform import Rotation

    found = np.eye(4)
    if kind == "transform" and value.shape == (4, 4):
        return value.T
    if kind in _TURNED and value.size == len(_TURNED[kind]):
        angles = value.reshape(-1)[[_TURNED["rotateXYZ"].index(axis) for axis in _TURNED[kind]] if value.ndim else [0]]
        found[:3, :3] = Rotation.from_euler(_TURNED[kind], angles, degrees=True).as_matrix()
    elif kind == "orient" and value.shape == (4,):
        found[:3, :3] = Rotation.from_quat(value).as_matrix()
    elif kind == "translate" and value.shape == (3,):
        found[:3, 3] = value
    elif kind == "scale" and value.shape == (3,):
        found[[0, 1, 2], [0, 1, 2]] = value
    else:
        raise NotPlainError("is placed otherwise")
    return found
