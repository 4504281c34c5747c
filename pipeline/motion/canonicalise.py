"""From a file's motion to the canonical skeleton (one set of joints, one world, one rest pose), and back for export."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.motion.clip import POSITION_CHANNELS, ChannelKind, Hierarchy, SolvedMotion, SourceClip
from motionlake.motion.kinematics import (
    bone_vectors,
    continuous_signs,
    joints_of_bones,
    local_rotations,
    world_from_positions,
)
from motionlake.motion.rest import Binding, bind, place, place_offsets, to_canonical_rest
from motionlake.motion.rigs import Rest, RigMap
from motionlake.motion.rotations import IDENTITY, conjugate, from_axis_angle, multiply, normalise, rotate, to_euler
from motionlake.motion.shown import ShownMotion
from motionlake.motion.skeleton import INDEX, JOINTS, PARENTS, chained
from motionlake.motion.units import UNITS, is_height, is_persons_height, unit_of_height
from motionlake.motion.upright import goes_on_all_fours, up_of_file

# No recording goes this far (metres) from where it starts: a number is damaged, or the unit is wrong.
FARTHEST: Final = 1000.0
# Up axis of the file -> axis and degrees of the turn that brings it to +y.
_TURNS: Final[dict[str, tuple[tuple[float, float, float], float]]] = {
    "y": ((1.0, 0.0, 0.0), 0.0),
    "-y": ((1.0, 0.0, 0.0), 180.0),
    "z": ((1.0, 0.0, 0.0), -90.0),
    "-z": ((1.0, 0.0, 0.0), 90.0),
    "x": ((0.0, 0.0, 1.0), 90.0),
    "-x": ((0.0, 0.0, 1.0), -90.0),
}


@dataclass(frozen=True, repr=False)
class CanonicalMotion(ShownMotion):
    """A motion of the canonical skeleton.

    `motion[start:stop]` is a part of it; `len(motion)` counts its F frames. A notebook plays it.

    Attributes:
        fps: frames a second.
        root: [F, 3] position of the hips in the world: metres, y up, heading and place as recorded.
        rotations: [F, 21, 4] local rotations (w, x, y, z) relative to the canonical rest pose, continuous in
            sign. With identity rotations the body stands in a T-pose and faces +z.
        positions: [F, 21, 3] joints in the world, metres.
        rest_offsets: [21, 3] offset of every joint from its parent in the canonical rest pose, metres: the
            mean over the clip of what the motion shows.
        body_height: metres from the ankles to the head joint in the rest pose.
        twist: False where rotations come from positions only, here or before the file was written, so that turns about
            a bone's axis are unknown.
        filled: joints that the rig lacks, or that the reader made up.
        up, metres_per_unit: what was used for the file.
        fk_error, fk_error_mean: metres, the largest and the mean distance between `positions` and forward
            kinematics of `root`, `rotations` and `rest_offsets`; 0 for a rigid body with these joints.
        notes: what a person should know.
    """

    fps: float
    root: Float64Array
    rotations: Float64Array
    positions: Float64Array
    rest_offsets: Float64Array
    body_height: float
    twist: bool
    filled: tuple[str, ...]
    up: str
    metres_per_unit: float
    fk_error: float
    fk_error_mean: float
    notes: tuple[str, ...] = ()

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the 21 joints; parents come before their children."""
        return JOINTS

    @property
    def parents(self) -> tuple[int, ...]:
        """The index of each joint's parent; -1 of the hips."""
        return PARENTS

    @property
    def seconds(self) -> float:
        """How long it lasts."""
        return len(self) / self.fps

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, frames: slice) -> CanonicalMotion:
        """Frames [start, stop); raises `ValueError` for a step, which would change `fps`."""
        if frames.step not in (None, 1):
            raise ValueError(f"step {frames.step}: a motion has every frame of a range")
        parts = {name: getattr(self, name)[frames] for name in ("root", "rotations", "positions")}
        return replace(self, **parts)

    def __repr__(self) -> str:
        return f"<CanonicalMotion: {len(self)} frames, {self.fps:g} a second, {self.seconds:.4g} s>"


def canonicalise(
    clip: SourceClip, motion: SolvedMotion, rig: RigMap, *, up: str | None = None, metres_per_unit: float | None = None
) -> CanonicalMotion:
    """Map a motion onto the canonical skeleton.

    A joint's canonical global rotation is G(t) = W Gsrc(t) (S A R)^-1: W turns the file's up axis to +y, and
    S A R is the orientation of the source joint in the canonical rest pose (`to_canonical_rest`). So the
    canonical bones point along the measured ones.

    Args:
        clip: what the file holds.
        motion: its forward kinematics.
        rig: the map for its joints.
        up: up axis of the file, x y z -x -y -z; by default what the file says, else what the body tells, with a note
            (`up_of_file`), else the rig's.
        metres_per_unit: length unit of the file; by default what the file says, else the rig's. Where neither does, or
            the body would not be 0.4 to 3 m tall by it (0.65 to 2.2 m by the rig's: programs share names of joints, not
            units), it is found by body height (`unit_of_height`), with a note.

    Raises:
        ClipError: the rig does not fit, no length unit is known, a joint goes more than 1 km from the first
            frame's root, or the body is outside 0.4 to 3 m.
    """
    up = clip.up if up is None else up
    turn_to_y_up(up or rig.up)  # what is no axis is told before the rig
    binding = bind(rig, clip.hierarchy)
    notes = []
    if up is None:
        up = up_of_file(binding, motion) or rig.up
        if up != rig.up:
            notes.append(f"up is {up}, by the body")
    said = metres_per_unit if metres_per_unit is not None else clip.metres_per_unit
    scale = rig.metres_per_unit if said is None else said
    # What goes too far by the smallest unit is a damaged number, before anything is told by it.
    _check_reach(motion.positions, clip.hierarchy.joints, metres_per_unit or min(UNITS.values()))
    placed = _placed(binding, motion, up, scale or 1.0)
    believed = is_persons_height if said is None else is_height
    if metres_per_unit is None and (scale is None or not believed(placed.height)):
        found = unit_of_height(placed.height / (scale or 1.0))
        if found is not None and found != scale:
            notes.append(f"unit {found:g} m, by body height")
            scale, placed = found, _placed(binding, motion, up, found)
    if scale is None:
        raise ClipError("the length unit is unknown, and by none is the body as tall as a person: say --unit")
    _check_reach(motion.positions, clip.hierarchy.joints, scale)
    positions, world, in_rest, height = placed.positions, placed.world, placed.in_rest, placed.height
    if not is_height(height):
        raise ClipError(f"body height {height:.4g} m with unit {scale:.4g} m: say --unit")
    notes = [*_orientation_notes(positions, up), *placed.notes, *notes]
    if goes_on_all_fours(positions):
        notes.append("goes on all fours: an animal by a person's names of joints, or a person who does so")
    bones = placed.bones
    if place_offsets(binding, positions, world, height):
        bones = bone_vectors(positions, world)
    made_up = [joint for joint, at in binding.source.items() if clip.hierarchy.joints[at] in clip.filled]
    rest_offsets = bones.mean(axis=0)
    rotations = continuous_signs(normalise(local_rotations(world)))
    root = np.array(positions[:, 0])
    errors = np.linalg.norm(joints_of_bones(root, world, rest_offsets) - positions, axis=-1)
    return CanonicalMotion(
        fps=clip.fps,
        root=root,
        rotations=rotations,
        positions=positions,
        rest_offsets=rest_offsets,
        body_height=height,
        twist=in_rest is not None and clip.twist,
        filled=tuple(JOINTS[joint] for joint in sorted([*binding.rules, *made_up])),
        up=up,
        metres_per_unit=scale,
        fk_error=float(errors.max()),
        fk_error_mean=float(errors.mean()),
        notes=tuple(notes),
    )


@dataclass(frozen=True)
class _Placed:
    """The canonical joints of a motion by some length unit, before what the rig lacks is placed by body height."""

    positions: Float64Array
    world: Float64Array
    bones: Float64Array
    in_rest: Float64Array | None
    height: float
    notes: tuple[str, ...]


def _placed(binding: Binding, motion: SolvedMotion, up: str, scale: float) -> _Placed:
    turn = turn_to_y_up(up)
    source_positions = rotate(turn, motion.positions) * scale
    source_world = None if motion.world is None else multiply(turn, motion.world)
    positions = place(binding, source_positions, source_world, scale)
    notes, in_rest = [], None
    if source_world is not None and binding.rig.rest is not Rest.POSITIONS:
        in_rest = to_canonical_rest(binding, motion, scale)
        if in_rest is None:
            notes.append("the zero pose is no standing human: rotations come from positions, without twist")
    if in_rest is None or source_world is None:
        world = world_from_positions(positions)
    else:
        world = _world_rotations(binding, source_world, in_rest)
    bones = bone_vectors(positions, world)
    return _Placed(positions, world, bones, in_rest, body_height(bones.mean(axis=0)), tuple(notes))


def _check_reach(positions: Float64Array, joints: tuple[str, ...], scale: float) -> None:
    """`ClipError` where one of the file's joints [F, J, 3], in units of `scale` metres, goes absurdly far."""
    with np.errstate(over="ignore", invalid="ignore"):
        if 2 * np.sqrt(3) * max(positions.max(), -positions.min()) * scale <= FARTHEST:
            return  # within the ball around the origin that holds all joints
        distance = np.linalg.norm(positions - positions[0, 0], axis=-1) * scale
    far = ~(distance <= FARTHEST)
    if far.any():
        frame, joint = (int(index) for index in np.argwhere(far)[0])
        raise ClipError(
            f"frame {frame}: {joints[joint]} is {distance[frame, joint]:.4g} m from the first frame's "
            f"{joints[0]} with unit {scale:.4g} m: a damaged number, or say --unit"
        )


def turn_to_y_up(up: str) -> Float64Array:
    """The rotation [4] that brings a file's up axis to +y; `ClipError` for what is no axis."""
    if up not in _TURNS:
        raise ClipError(f"up axis {up!r} is not one of {', '.join(_TURNS)}")
    axis, degrees = _TURNS[up]
    return from_axis_angle(np.array(axis), degrees)


def _world_rotations(binding: Binding, source_world: Float64Array, in_rest: Float64Array) -> Float64Array:
    turning = list[int]()  # of every joint the one whose turn it has: its own, or its parent's where it is filled
    for joint, parent in enumerate(PARENTS):
        turning.append(joint if joint in binding.source else turning[parent])
    measured = source_world[:, [binding.source[joint] for joint in turning]]
    return multiply(measured, conjugate(in_rest[turning]))


def body_height(rest_offsets: Float64Array) -> float:
    """Height of the head joint over the ankles in the rest pose with these offsets."""
    heights = chained(rest_offsets)[:, 1]
    return float(heights[INDEX["head"]] - (heights[INDEX["left_ankle"]] + heights[INDEX["right_ankle"]]) / 2)


def _orientation_notes(positions: Float64Array, up: str) -> list[str]:
    """A note where the body is long along another axis than up in most frames: lying, or a wrong up axis."""
    body = positions[:, INDEX["head"]] - (positions[:, INDEX["left_ankle"]] + positions[:, INDEX["right_ankle"]]) / 2
    upright = np.mean((np.argmax(np.abs(body), axis=1) == 1) & (body[:, 1] > 0))
    if upright >= 0.5:
        return []
    longest = rotate(conjugate(turn_to_y_up(up)), np.median(body, axis=0))
    strongest = int(np.argmax(np.abs(longest)))
    name = ("-" if longest[strongest] < 0 else "") + "xyz"[strongest]
    share = f"the head is not above the ankles in {1 - upright:.0%} of frames"
    return [f"{share}: the body lies or hangs, or up is {name} and not {up} (--up)"]


METRES_PER_UNIT: Final = 0.01
_ROTATIONS: Final = ("Zrotation", "Yrotation", "Xrotation")
# End sites as shares of the body height, where the last joints' bones end.
_TIPS: Final[dict[str, tuple[float, float, float]]] = {
    "head": (0.0, 0.12, 0.0),
    "left_wrist": (0.1, 0.0, 0.0),
    "right_wrist": (-0.1, 0.0, 0.0),
    "left_toe": (0.0, 0.0, 0.05),
    "right_toe": (0.0, 0.0, 0.05),
}


def to_source_clip(motion: CanonicalMotion) -> SourceClip:
    """The motion in BVH terms: root position and ZYX rotations in degrees, centimetres, y up.

    The zero pose is the canonical rest pose with the clip's own bone offsets. Where the source was not rigid,
    positions differ from `motion.positions` by up to `motion.fk_error`.
    """
    order = _depth_first(0)
    angles = to_euler(motion.rotations, "ZYX")[:, order].reshape(len(motion.root), -1)
    size = motion.body_height / METRES_PER_UNIT
    hierarchy = Hierarchy(
        joints=tuple(JOINTS[joint] for joint in order),
        parents=tuple(order.index(PARENTS[joint]) if PARENTS[joint] >= 0 else -1 for joint in order),
        offsets=(motion.rest_offsets / METRES_PER_UNIT)[order],
        channels=(POSITION_CHANNELS + _ROTATIONS, *(_ROTATIONS for _ in order[1:])),
        kind=ChannelKind.EULER,
        axes=np.tile(IDENTITY, (len(JOINTS), 1)),
        end_sites=tuple(
            (order.index(INDEX[name]), (x * size, y * size, z * size)) for name, (x, y, z) in _TIPS.items()
        ),
    )
    channels = np.concatenate([motion.root / METRES_PER_UNIT, angles], axis=1)
    return SourceClip(hierarchy, channels, motion.fps, metres_per_unit=METRES_PER_UNIT, notes=motion.notes)


def _depth_first(joint: int) -> list[int]:
    """A canonical joint and those below it in the order in which a BVH file writes its tree."""
    return [joint, *(j for child, parent in enumerate(PARENTS) if parent == joint for j in _depth_first(child))]
