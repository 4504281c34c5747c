"""USD files as usd-core reads them, in a process of its own, which this module is where it is run as a program."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array, UInt8Array
from motionlake.errors import ClipError
from motionlake.formats.parse.own_process import read_apart, serve
from motionlake.formats.parse.usd_scene import (
    TRACKS,
    UsdSkeleton,
    UsdStage,
    checked_joints,
    nodes_of,
    of_all_joints,
)
from motionlake.formats.parse.usd_stage import KINDS, LONGEST, open_alone
from motionlake.formats.parse.usd_tracks import Track, numbers_of_attribute
from motionlake.names import printable

_MISSING: Final = "needs usd-core: pip install 'motionlake[usd]'"
_PLACE: Final = re.compile(r":(\d+):\d+: ([^'\n]+)")  # in a message of the parser of text


def sent_by_library(data: bytes) -> UInt8Array:
    """What the process of its own sends of a file: `SceneNodes`.

    Raises:
        ClipError: usd-core is not installed, cannot read the file or ends with it, or the file names other files, has
            no animated skeleton, or more than `limits` allow.
    """
    return read_apart(__name__, "USD", data)


class _Node:
    """A prim that places what is below it."""

    def __init__(self, placing: Any) -> None:
        self._placing = placing

    @property
    def name(self) -> str:
        return str(self._placing.GetPrim().GetName())

    @property
    def times(self) -> list[float]:
        return list(self._placing.GetTimeSamples())

    def matrices(self, codes: Float64Array) -> Float64Array:
        moving = codes.tolist() if self._placing.TransformMightBeTimeVarying() else codes[:1].tolist()
        return np.array([np.array(self._placing.GetLocalTransformation(code)).T for code in moving])


def _names(attribute: Any) -> tuple[str, ...]:
    """The names of an attribute; `ClipError` where it holds something else."""
    value = attribute.Get()
    if value is None or hasattr(value, "__len__"):
        return tuple(map(str, value or ()))
    raise ClipError(f"its {attribute.GetName()} are no names")


def _sent(data: bytes, folder: Path) -> list[memoryview]:
    """What the process of its own sends."""
    try:
        from pxr import Tf
    except ImportError as error:
        raise ClipError(_MISSING) from error
    try:
        try:
            stage = open_alone(data, folder)
            return nodes_of(_said(stage), _skeletons(stage)).sent()
        except Tf.ErrorException as error:
            told = _PLACE.search(str(error))
            where = f": line {told[1]}: {printable(told[2])[:LONGEST]}" if told else ""
            raise ClipError(f"USD cannot read it{where}") from error
    except UnicodeDecodeError as error:  # of names, or of the words of an error
        raise ClipError("USD cannot read it: it has text that is no UTF-8") from error


def _said(stage: Any) -> UsdStage:
    from pxr import UsdGeom

    has_metres = UsdGeom.StageHasAuthoredMetersPerUnit(stage)
    return UsdStage(
        float(stage.GetTimeCodesPerSecond()),
        (float(stage.GetStartTimeCode()), float(stage.GetEndTimeCode())) if stage.HasAuthoredTimeCodeRange() else None,
        float(stage.GetFramesPerSecond()),
        float(UsdGeom.GetStageMetersPerUnit(stage)) if has_metres else None,
        str(UsdGeom.GetStageUpAxis(stage)).lower(),
    )


def _skeletons(stage: Any) -> Iterator[UsdSkeleton]:
    """The skeletons of a stage, those of instances too, that have joints and an animation of joints."""
    from pxr import Usd, UsdSkel

    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        if not prim.IsA(UsdSkel.Skeleton):
            continue
        joints = checked_joints(_names(UsdSkel.Skeleton(prim).GetJointsAttr()))
        source = UsdSkel.BindingAPI(prim).GetInheritedAnimationSource()
        if not joints or not source or not source.IsA(UsdSkel.Animation):
            continue
        animated = _names(UsdSkel.Animation(source).GetJointsAttr())
        if set(animated) & set(joints):
            yield UsdSkeleton(
                str(prim.GetPath()),
                _above(prim),
                joints,
                animated,
                [Track(source.GetAttribute(name)) for name in TRACKS],
                of_all_joints(numbers_of_attribute(prim.GetAttribute("restTransforms")), len(joints)),
                of_all_joints(numbers_of_attribute(prim.GetAttribute("bindTransforms")), len(joints)),
            )


def _above(prim: Any) -> tuple[_Node, ...]:
    """The prims that place a skeleton, from the top on, up to one that leaves what is above it; itself last."""
    from pxr import UsdGeom

    found: list[_Node] = []
    here = prim
    while here and not here.IsPseudoRoot():
        placing = UsdGeom.Xformable(here)
        if placing:
            found.append(_Node(placing))
            if placing.GetResetXformStack():
                break
        here = here.GetParent()
    return tuple(reversed(found))


def _prepare() -> None:
    """Have USD load its plugins, which it does for the first stage of a process."""
    import scipy.spatial.transform  # noqa: F401
    from pxr import Sdf, Usd, UsdGeom, UsdSkel

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.GetStageUpAxis(stage)
    UsdSkel.Animation.Define(stage, "/Animation").CreateRotationsAttr()
    for kind in KINDS.values():
        Sdf.FileFormat.FindByExtension(kind)


if __name__ == "__main__":
    serve(_sent, _prepare)
