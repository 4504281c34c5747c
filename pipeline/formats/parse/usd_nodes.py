"""The skeletons of a USD stage and how its animations place them, read through usd-core in a process of its own."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.clip_checks import MAX_FPS, MIN_FPS
from motionlake.formats.limits_config import limits
from motionlake.formats.parse.keys import SPARSE_FPS, even_count, even_rate
from motionlake.formats.parse.own_process import read_apart, serve
from motionlake.formats.parse.scene import Placing, Placings, beside_each_other, check_room
from motionlake.formats.parse.scene_nodes import SceneHead, SceneNodes
from motionlake.formats.parse.usd_stage import KINDS, LONGEST, open_alone
from motionlake.formats.parse.usd_tracks import QUATERNION, Track, check_turns, numbers_of_attribute
from motionlake.names import printable

_MISSING: Final = "needs usd-core: pip install 'motionlake[usd]'"
_PLACE: Final = re.compile(r":(\d+):\d+: ([^'\n]+)")  # in a message of the parser of text
_MOST_CODES: Final = 1e6  # a second


def read_nodes(data: bytes) -> SceneNodes:
    """The skeletons of a file that animations move, and what is above them, in the stage's unit and axes.

    Raises:
        ClipError: usd-core is not installed, cannot read the file or ends with it, or the file names other files, has
            no animated skeleton, or more than `limits` allow.
    """
    return SceneNodes.received(read_apart(__name__, "USD", data))


@dataclass(frozen=True)
class _Skeleton:
    """One `UsdSkel.Skeleton` that is animated.

    Attributes:
        above: the prims that place it, from the top on, itself last.
        joints: J paths.
        animation: the `UsdSkel.Animation` that moves it.
        animated: paths of the joints that the animation has, in its order.
    """

    above: tuple[Any, ...]
    joints: tuple[str, ...]
    animation: Any
    animated: tuple[str, ...]

    @property
    def path(self) -> str:
        return str(self.above[-1].GetPath())

    @property
    def parents(self) -> list[int]:
        """For each joint the one whose path is the longest above its own; -1 where there is none."""
        place = {joint: number for number, joint in enumerate(self.joints)}
        if len(place) < len(self.joints):
            raise ClipError("has two joints of one path")
        return [next((place[path] for path in _paths_above(joint) if path in place), -1) for joint in self.joints]

    @cached_property
    def tracks(self) -> list[Track]:
        """What the animation says of its joints: of how they are moved, turned and scaled."""
        return [Track(self.animation.GetPrim().GetAttribute(name)) for name in ("translations", "rotations", "scales")]

    def times(self) -> Float64Array:
        """Time codes at which something of it has a key, growing."""
        keyed = [*(track.times for track in self.tracks), *(prim.GetTimeSamples() for prim in self.above)]
        return np.unique(np.concatenate(keyed))

    def matrices(self, name: str) -> Float64Array | None:
        """[J, 4, 4] "restTransforms" or "bindTransforms", for column vectors; None where there is not one a joint."""
        found = numbers_of_attribute(self.above[-1].GetPrim().GetAttribute(name))
        return found.transpose(0, 2, 1) if found.shape == (len(self.joints), 4, 4) else None


def _names(attribute: Any) -> tuple[str, ...]:
    """The names of an attribute; `ClipError` where it holds something else."""
    value = attribute.Get()
    if value is None or hasattr(value, "__len__"):
        return tuple(map(str, value or ()))
    raise ClipError(f"its {attribute.GetName()} are no names")


def _paths_above(path: str) -> Iterator[str]:
    while "/" in path:
        path = path.rpartition("/")[0]
        yield path


def _sent(data: bytes, folder: Path) -> list[memoryview]:
    """What the process of its own sends."""
    try:
        from pxr import Tf
    except ImportError as error:
        raise ClipError(_MISSING) from error
    try:
        try:
            return _nodes(data, folder).sent()
        except Tf.ErrorException as error:
            told = _PLACE.search(str(error))
            where = f": line {told[1]}: {printable(told[2])[:LONGEST]}" if told else ""
            raise ClipError(f"USD cannot read it{where}") from error
    except UnicodeDecodeError as error:  # of names, or of the words of an error
        raise ClipError("USD cannot read it: it has text that is no UTF-8") from error


def _nodes(data: bytes, folder: Path) -> SceneNodes:
    from pxr import UsdGeom

    stage = open_alone(data, folder)
    skeletons = {skeleton: times for skeleton in _skeletons(stage) if len(times := skeleton.times()) > 1}
    if not skeletons:
        raise ClipError("has no skeleton that an animation moves (skel:animationSource)")
    codes, rate, note = _instants(stage, np.unique(np.concatenate(list(skeletons.values()))))
    names: list[str] = []
    parents: list[int] = []
    bones: list[tuple[Sequence[int], str]] = []
    bound: list[Float64Array] = []
    check_room((len(codes), len(each.above) + len(each.joints)) for each in skeletons)
    for skeleton in skeletons:
        first = len(names)
        names += [prim.GetPrim().GetName() for prim in skeleton.above]
        parents += [-1, *range(first, len(names) - 1)]
        joints = len(names)
        names += [joint.rpartition("/")[2] for joint in skeleton.joints]
        parents += [parent + joints if parent >= 0 else joints - 1 for parent in skeleton.parents]
        bones.append((list(range(joints, len(names))), _body_name(skeleton, skeletons)))
        bound += [np.full((joints - first, 4, 4), np.nan), _bound(skeleton)]
    resting, moving = zip(*(each for skeleton in skeletons for each in _placings(skeleton, codes)), strict=True)
    head = SceneHead(
        names=names,
        parents=parents,
        skeletons=bones,
        rate=rate,
        takes=[""],
        frames=[len(codes)],
        metres_per_unit=_metres(stage),
        up=str(UsdGeom.GetStageUpAxis(stage)).lower(),
        notes=[note],
    )
    return SceneNodes(head, np.concatenate(bound), beside_each_other(resting), [beside_each_other(moving)])


def _skeletons(stage: Any) -> list[_Skeleton]:
    """The skeletons of a stage, those of instances too, that have joints and an animation of joints."""
    from pxr import Usd, UsdSkel

    found = []
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        if not prim.IsA(UsdSkel.Skeleton):
            continue
        joints = _names(UsdSkel.Skeleton(prim).GetJointsAttr())
        limits().check("joints", len(joints), f"has {len(joints)} joints")
        source = UsdSkel.BindingAPI(prim).GetInheritedAnimationSource()
        if not joints or not source or not source.IsA(UsdSkel.Animation):
            continue
        animation = UsdSkel.Animation(source)
        animated = _names(animation.GetJointsAttr())
        if set(animated) & set(joints):
            found.append(_Skeleton(_above(prim), joints, animation, animated))
            limits().check("bodies", len(found), f"holds {len(found)} skeletons")
    return found


def _above(prim: Any) -> tuple[Any, ...]:
    """The prims that place a skeleton, from the top on, up to one that leaves what is above it; itself last."""
    from pxr import UsdGeom

    found: list[Any] = []
    here = prim
    while here and not here.IsPseudoRoot():
        placing = UsdGeom.Xformable(here)
        if placing:
            found.append(placing)
            if placing.GetResetXformStack():
                break
        here = here.GetParent()
    return tuple(reversed(found))


def _instants(stage: Any, keys: Float64Array) -> tuple[Float64Array, float, str]:
    """[F] time codes at an even rate, that rate a second, and a note: from the stage's start to its end, if it says.

    Args:
        stage: of USD.
        keys: [K] time codes of keys, growing.
    """
    a_second = float(stage.GetTimeCodesPerSecond())
    if not 0 < a_second < _MOST_CODES:
        raise ClipError(f"has {a_second:g} time codes a second")
    begin, end = float(keys[0]), float(keys[-1])
    if stage.HasAuthoredTimeCodeRange() and stage.GetEndTimeCode() > stage.GetStartTimeCode():
        begin, end = float(stage.GetStartTimeCode()), float(stage.GetEndTimeCode())
    within = np.array([begin, *keys[(keys > begin) & (keys < end)], end]) / a_second
    shown = float(stage.GetFramesPerSecond())
    rate, note = even_rate(within, shown if MIN_FPS <= shown <= MAX_FPS else SPARSE_FPS)
    count = even_count(within, rate)
    limits().check("frames", count, f"has {count} frames")
    return begin + np.arange(count) / rate * a_second, rate, note


def _metres(stage: Any) -> float | None:
    from pxr import UsdGeom

    if not UsdGeom.StageHasAuthoredMetersPerUnit(stage):
        return None
    metres = float(UsdGeom.GetStageMetersPerUnit(stage))
    if not 0 < metres < np.inf:
        raise ClipError(f"metersPerUnit is {metres:g}")
    return metres


def _body_name(skeleton: _Skeleton, others: Iterable[_Skeleton]) -> str:
    """The name of its prim, or all of its path where another skeleton is called the same."""
    name = skeleton.path.rpartition("/")[2]
    same = [other for other in others if other.path.endswith(f"/{name}")]
    return name if len(same) == 1 else skeleton.path.strip("/").replace("/", " ")


def _bound(skeleton: _Skeleton) -> Float64Array:
    """[J, 4, 4] inverses of the bind transforms; NaN where there are none that can be undone."""
    bind = skeleton.matrices("bindTransforms")
    if bind is None or not np.isfinite(bind).all() or not np.linalg.det(bind).all():
        return np.full((len(skeleton.joints), 4, 4), np.nan)
    return np.asarray(np.linalg.inv(bind), np.float64)


def _rest(skeleton: _Skeleton) -> Placings | None:
    """How joints rest below their parents: as the skeleton says, or as they were bound, if it says that."""
    rest = skeleton.matrices("restTransforms")
    if rest is None:
        bind, inverse = skeleton.matrices("bindTransforms"), _bound(skeleton)
        if bind is None or not np.isfinite(inverse).all():
            return None
        rest = np.stack([inverse[p] @ own if p >= 0 else own for p, own in zip(skeleton.parents, bind, strict=True)])
    return Placings(*(part[None] for part in vars(Placing.of_matrices(rest)).values()))


def _placings(skeleton: _Skeleton, codes: Float64Array) -> Iterator[tuple[Placings, Placings]]:
    """How what is above the joints rests and is placed at time codes, one after the other, then how they are."""
    for prim in skeleton.above:
        moving = codes.tolist() if prim.TransformMightBeTimeVarying() else codes[:1].tolist()
        matrices = np.array([np.array(prim.GetLocalTransformation(code)).T for code in moving])
        moved = Placings.of([Placing() if (matrices == np.eye(4)).all() else Placing.of_matrices(matrices)])
        yield moved.first, moved
    yield _of_joints(skeleton, codes)


def _of_joints(skeleton: _Skeleton, codes: Float64Array) -> tuple[Placings, Placings]:
    """How joints rest, and how they are at time codes; what the animation does not say is as it rests."""
    rest = _rest(skeleton)
    place = {joint: number for number, joint in enumerate(skeleton.animated)}
    chosen = [number for number, joint in enumerate(skeleton.joints) if joint in place]
    columns = [place[skeleton.joints[number]] for number in chosen]
    if rest is None and len(chosen) < len(skeleton.joints):
        raise ClipError("has a skeleton without restTransforms, whose animation leaves joints out")
    still = Placings.of([Placing()] * len(skeleton.joints)) if rest is None else rest
    moved = []
    for track, part in zip(skeleton.tracks, vars(still).values(), strict=True):
        width = part.shape[2]
        if track.has_value:
            values = track.sampled(codes, len(skeleton.animated), width)
            if len(chosen) < len(skeleton.joints):
                part = np.repeat(part, len(values), axis=0)
                part[:, chosen] = values[:, columns]
            else:
                part = values if columns == list(range(len(skeleton.animated))) else values[:, columns]
            if width == QUATERNION:
                check_turns(part, codes)
        moved.append(part)
    found = Placings(*moved)
    return rest or found.first, found


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
