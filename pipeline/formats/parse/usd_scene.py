"""The nodes of a USD stage, of what is said of its skeletons and their animations, whoever read that."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from motionlake.arrays import Float64Array, FloatArray, Int64Array
from motionlake.errors import ClipError
from motionlake.formats.clip_checks import MAX_FPS, MIN_FPS
from motionlake.formats.limits_config import limits
from motionlake.formats.parse.keys import SPARSE_FPS, even_count, even_rate
from motionlake.formats.parse.placings import Placing, Placings, beside_each_other
from motionlake.formats.parse.scene import check_room
from motionlake.formats.parse.scene_nodes import SceneHead, SceneNodes
from motionlake.motion.rotations import MIN_LENGTH

TRACKS: Final = ("translations", "rotations", "scales")  # attributes of an animation
QUATERNION: Final = 4  # numbers
AT_KEY: Final = 1e-8  # time codes: how far from an instant a key may be and still be at it
_MOST_CODES: Final = 1e6  # a second


class UsdNode(Protocol):
    """A prim that places what is below it.

    Attributes:
        name: its own.
        times: the time codes of its keys.
    """

    @property
    def name(self) -> str: ...

    @property
    def times(self) -> Sequence[float]: ...

    def matrices(self, codes: Float64Array) -> Float64Array:
        """[F, 4, 4] how it is placed at time codes, for column vectors; [1, 4, 4] where it stays."""


class UsdTrack(Protocol):
    """What an animation says of its joints: of how they are moved, turned or scaled.

    Attributes:
        has_value: whether it says anything.
        times: [K] the time codes of its keys, growing.
    """

    @property
    def has_value(self) -> bool: ...

    @property
    def times(self) -> Float64Array: ...

    def sampled(self, codes: Float64Array, joints: int, width: int) -> FloatArray:
        """[F, A, width] what is said of its A joints at time codes, or [1, A, width] where it says one thing.

        Of quaternions the real part comes first.
        """


@dataclass(frozen=True, eq=False)
class UsdSkeleton:
    """One `UsdSkel.Skeleton` that is animated.

    Attributes:
        path: of its prim.
        above: the prims that place it, from the top on, itself last.
        joints: J paths.
        animated: paths of the joints that the animation has, in its order.
        tracks: of the animation, as `TRACKS` names them.
        rest, bind: [J, 4, 4] its restTransforms and bindTransforms, for column vectors; None where there is not one a
            joint.
    """

    path: str
    above: Sequence[UsdNode]
    joints: Sequence[str]
    animated: Sequence[str]
    tracks: Sequence[UsdTrack]
    rest: Float64Array | None
    bind: Float64Array | None

    @property
    def parents(self) -> list[int]:
        """For each joint the one whose path is the longest above its own; -1 where there is none."""
        place = {joint: number for number, joint in enumerate(self.joints)}
        if len(place) < len(self.joints):
            raise ClipError("has two joints of one path")
        return [next((place[path] for path in _paths_above(joint) if path in place), -1) for joint in self.joints]

    def times(self) -> Float64Array:
        """Time codes at which something of it has a key, growing."""
        placed = [np.asarray(node.times, np.float64) for node in self.above]
        return np.unique(np.concatenate([*(track.times for track in self.tracks), *placed]))


@dataclass(frozen=True)
class UsdStage:
    """What a stage says of all that is in it.

    Attributes:
        codes_a_second: time codes.
        span: the time codes of its start and end, where it says both.
        shown_fps: frames a second at which it is meant to be shown.
        metres_per_unit: None where it does not say.
        up: "y" or "z".
    """

    codes_a_second: float
    span: tuple[float, float] | None
    shown_fps: float
    metres_per_unit: float | None
    up: str


def nodes_of(stage: UsdStage, animated: Iterable[UsdSkeleton]) -> SceneNodes:
    """The skeletons that animations move, and what is above them, in the stage's unit and axes.

    Raises:
        ClipError: no skeleton is moved; numbers that are none; more than `limits` allow.
    """
    skeletons: dict[UsdSkeleton, Float64Array] = {}
    for number, skeleton in enumerate(animated, start=1):
        limits().check("bodies", number, f"holds {number} skeletons")
        if len(times := skeleton.times()) > 1:
            skeletons[skeleton] = times
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
        names += [node.name for node in skeleton.above]
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
        up=stage.up,
        notes=[note],
    )
    return SceneNodes(head, np.concatenate(bound), beside_each_other(resting), [beside_each_other(moving)])


def checked_joints(joints: Sequence[str]) -> Sequence[str]:
    """The joints of a skeleton, as many as `limits` allow."""
    limits().check("joints", len(joints), f"has {len(joints)} joints")
    return joints


def of_all_joints(matrices: Float64Array, joints: int) -> Float64Array | None:
    """[J, 4, 4] matrices for column vectors, of those of an attribute; None where there is not one a joint."""
    return matrices.transpose(0, 2, 1) if matrices.shape == (joints, 4, 4) else None


def real_first(turns: FloatArray) -> FloatArray:
    """Quaternions [..., 4] whose real part comes last."""
    found = np.empty(turns.shape, turns.dtype)
    found[..., 0], found[..., 1:] = turns[..., 3], turns[..., :3]
    return found


def rows_at(times: Float64Array, codes: Float64Array) -> slice | Int64Array | None:
    """Which of K growing time codes `codes` are; None where one is none of them."""
    at = np.minimum(np.searchsorted(times, codes - AT_KEY), len(times) - 1)
    if not (np.abs(times[at] - codes) <= AT_KEY).all():
        return None
    return slice(None) if len(at) == len(times) and (np.diff(at) == 1).all() else at


def _paths_above(path: str) -> Iterator[str]:
    while "/" in path:
        path = path.rpartition("/")[0]
        yield path


def _instants(stage: UsdStage, keys: Float64Array) -> tuple[Float64Array, float, str]:
    """[F] time codes at an even rate, that rate a second, and a note: from the stage's start to its end, if it says.

    Args:
        stage: of USD.
        keys: [K] time codes of keys, growing.
    """
    a_second = stage.codes_a_second
    if not 0 < a_second < _MOST_CODES:
        raise ClipError(f"has {a_second:g} time codes a second")
    begin, end = float(keys[0]), float(keys[-1])
    if stage.span is not None and stage.span[1] > stage.span[0]:
        begin, end = stage.span
    within = np.array([begin, *keys[(keys > begin) & (keys < end)], end]) / a_second
    rate, note = even_rate(within, stage.shown_fps if MIN_FPS <= stage.shown_fps <= MAX_FPS else SPARSE_FPS)
    count = even_count(within, rate)
    limits().check("frames", count, f"has {count} frames")
    return begin + np.arange(count) / rate * a_second, rate, note


def _metres(stage: UsdStage) -> float | None:
    metres = stage.metres_per_unit
    if metres is not None and not 0 < metres < np.inf:
        raise ClipError(f"metersPerUnit is {metres:g}")
    return metres


def _body_name(skeleton: UsdSkeleton, others: Iterable[UsdSkeleton]) -> str:
    """The name of its prim, or all of its path where another skeleton is called the same."""
    name = skeleton.path.rpartition("/")[2]
    same = [other for other in others if other.path.endswith(f"/{name}")]
    return name if len(same) == 1 else skeleton.path.strip("/").replace("/", " ")


def _bound(skeleton: UsdSkeleton) -> Float64Array:
    """[J, 4, 4] inverses of the bind transforms; NaN where there are none that can be undone."""
    bind = skeleton.bind
    with np.errstate(all="ignore"):
        if bind is None or not np.isfinite(bind).all() or not np.linalg.det(bind).all():
            return np.full((len(skeleton.joints), 4, 4), np.nan)
        return np.asarray(np.linalg.inv(bind), np.float64)


def _rest(skeleton: UsdSkeleton) -> Placings | None:
    """How joints rest below their parents: as the skeleton says, or as they were bound, if it says that."""
    rest = skeleton.rest
    if rest is None:
        bind, inverse = skeleton.bind, _bound(skeleton)
        if bind is None or not np.isfinite(inverse).all():
            return None
        rest = np.stack([inverse[p] @ own if p >= 0 else own for p, own in zip(skeleton.parents, bind, strict=True)])
    return Placings(*(part[None] for part in vars(Placing.of_matrices(rest)).values()))


def _placings(skeleton: UsdSkeleton, codes: Float64Array) -> Iterator[tuple[Placings, Placings]]:
    """How what is above the joints rests and is placed at time codes, one after the other, then how they are."""
    for node in skeleton.above:
        matrices = node.matrices(codes)
        moved = Placings.of([Placing() if (matrices == np.eye(4)).all() else Placing.of_matrices(matrices)])
        yield moved.first, moved
    yield _of_joints(skeleton, codes)


def _of_joints(skeleton: UsdSkeleton, codes: Float64Array) -> tuple[Placings, Placings]:
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
                _check_turns(part, codes)
        moved.append(part)
    found = Placings(*moved)
    return rest or found.first, found


def _check_turns(turns: FloatArray, codes: Float64Array) -> None:
    """Reject quaternions [F, J, 4] at time codes that have no length."""
    sound = (np.einsum("fjn,fjn->fj", turns, turns) > MIN_LENGTH**2).all(axis=1)
    if not sound.all():
        raise ClipError(f"has a rotation of length zero at {codes[sound.argmin()]:g}")
