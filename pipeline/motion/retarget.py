"""A canonical motion on somebody's character: its own joints, bones, unit and axes, with feet where they should stand.

The canonical global rotation of a joint is G = W Gsrc (S A R)^-1 (`motion.canonicalise`). So the character's joint
takes Gsrc = W^-1 G (S A R), with W and S A R of the character. What canonical joints do not say is shared out: joints
between two of the spine or neck turn by a share of the way from the one to the other, joints between two of a limb take
a share of the twist, and fingers and the like keep their rest pose.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array
from motionlake.errors import ClipError
from motionlake.motion.canonicalise import CanonicalMotion, turn_to_y_up
from motionlake.motion.character import Character, leg_length
from motionlake.motion.clip import POSITION_CHANNELS, SourceClip
from motionlake.motion.kinematics import continuous_signs, world_rotations
from motionlake.motion.posing import posed
from motionlake.motion.rotations import IDENTITY, conjugate, from_axis_angle, multiply, normalise, rotate, swing
from motionlake.motion.skeleton import BONES, INDEX, JOINTS, chained
from motionlake.motion.standing import SIDES, FlatFoot, contacts, measured_foot
from motionlake.motion.two_bones import REACH, bent

# Joints that bear a chain of the trunk to the next one above: what lies between turns by a share.
TRUNK: Final = frozenset(INDEX[name] for name in ("hips", "spine", "chest", "neck", "head"))
# The bones of the trunk that point where the recorded ones do.
POINTED: Final = (("spine", "chest"), ("neck", "head"))
LIMBS: Final = frozenset(INDEX[f"{side}_{part}"] for side in SIDES for part in ("shoulder", "elbow", "hip", "knee"))
FORWARD: Final = np.array([0.0, 0.0, 1.0])  # of a thigh in the T-pose
# A knee that is less to a side than this share of the thigh bends forward as the thigh has it: its side is noise of the
# recording, or it is stretched beyond straight.
STRAIGHT: Final = 0.15
LEG: Final = ("hip", "knee", "ankle")
# Where a leg is too short for where its foot stands, the body goes down by at most this share of the leg, smoothly over
# so many seconds.
DEEPEST: Final = 0.2
SPREAD: Final = 0.05
SAME_PLACE: Final = 1e-4  # metres; ankles that are nearer than this to where they should be stay


def retarget(motion: CanonicalMotion, character: Character, source: Character | None = None) -> SourceClip:
    """The motion on a character, in its file's units and axes.

    Its way is scaled by the length of its legs, and ankles are brought to where the scaled ones of the motion are, by
    hip and knee alone. Where rigs put the ankle at another height over the toe, feet are tilted by the difference.

    Args:
        motion: F frames.
        character: of whom the clip is to be.
        source: the character that the motion was recorded on; without it, how its feet stand is read off the motion.

    Raises:
        ClipError: the character lacks hips, or has no legs.
    """
    legs = leg_length(motion.rest_offsets), leg_length(character.rest_offsets)
    if not min(legs) > 0:
        raise ClipError("has no legs to scale a motion by")
    if INDEX["hips"] not in character.source:
        raise ClipError("has no hips")
    scale = legs[1] / legs[0]
    was = source.foot if source is not None and source.foot is not None else measured_foot(motion)
    canonical = world_rotations(motion.rotations)
    raised = 0.0
    if was is not None and character.foot is not None:
        raised = character.foot.height - scale * was.height
        _tilt_feet(canonical, was, character.foot)
    targets = motion.positions * scale + np.array([0.0, raised, 0.0])
    body = _Body(character, len(motion))
    body.turn(canonical, motion.positions)
    stands = contacts(motion.positions, motion.fps, motion.body_height)
    root = body.reached(body.root_for(targets[:, INDEX["hips"]]), targets, stands, motion.fps)
    for side in SIDES:
        body.bend(side, root, targets)
    return body.clip(root, motion.fps)


def t_pose(character: Character, place: Float64Array, fps: float) -> SourceClip:
    """One frame of a character in the T-pose, facing +z, feet flat, its toes as high as a place [3] (metres, y up)."""
    body, pose, height = _Body(character, 1), np.tile(IDENTITY, (1, len(JOINTS), 1)), leg_length(character.rest_offsets)
    if character.foot is not None:  # the canonical T-pose stretches the feet; here they are flat
        _tilt_feet(pose, FlatFoot(0.0, 0.0), character.foot)
        height += character.foot.height
    body.turn(pose, None)
    return body.clip(body.root_for((place + np.array([0.0, height, 0.0]))[None]), fps)


def _tilt_feet(canonical: Float64Array, was: FlatFoot, wanted: FlatFoot) -> None:
    """Turn the ankles of [F, 21, 4] so that a foot which stood flat on the one body does so on the other."""
    tilt = from_axis_angle(np.array([1.0, 0.0, 0.0]), np.rad2deg(was.rise - wanted.rise))
    for side in SIDES:
        ankle = INDEX[f"{side}_ankle"]
        canonical[:, ankle] = multiply(np.ascontiguousarray(canonical[:, ankle]), tilt)


class _Body:
    """A character in F poses, y up and in metres while it is worked on."""

    def __init__(self, character: Character, frames: int) -> None:
        self.character = character
        self.parents = character.hierarchy.parents
        self.offsets = character.offsets * character.metres_per_unit
        self.world = np.tile(IDENTITY, (frames, len(self.parents), 1))
        self.canonical_of = {source: joint for joint, source in character.source.items()}

    def turn(self, canonical: Float64Array, measured: Float64Array | None) -> None:
        """Take on canonical global rotations [F, 21, 4]; bones of the trunk point as in `measured` [F, 21, 3]."""
        done = set()
        for joint, source in self.character.source.items():
            self.world[:, source] = multiply(np.ascontiguousarray(canonical[:, joint]), self.character.in_rest[joint])
            done.add(source)
        for joint, source in self.character.source.items():
            done |= self._share(joint, self._between(source), canonical)
        if measured is not None:
            for start, end in POINTED:
                self._point(INDEX[start], INDEX[end], measured)
        for joint, parent in enumerate(self.parents):
            if joint not in done:
                above = turn_to_y_up(self.character.up) if parent < 0 else np.ascontiguousarray(self.world[:, parent])
                self.world[:, joint] = multiply(above, self.character.relative_rest[joint])

    def _between(self, source: int) -> list[int]:
        """The joints between one and the next canonical joint above it, that one first; [] where there is none."""
        chain, parent = [], self.parents[source]
        while parent >= 0 and parent not in self.canonical_of:
            chain.append(parent)
            parent = self.parents[parent]
        return [parent, *chain[::-1]] if parent >= 0 else []

    def _share(self, joint: int, between: list[int], canonical: Float64Array) -> set[int]:
        """Turn the joints between a canonical joint and the next one above; those that were turned."""
        if len(between) < 2:
            return set()
        start, count = self.canonical_of[between[0]], len(between)
        trunk = joint in TRUNK and start in TRUNK
        if not trunk and not (start in LIMBS and BONES[JOINTS[start]][0] == JOINTS[joint]):
            return set()
        first, last = (np.ascontiguousarray(canonical[:, each]) for each in (start, joint))
        rest = self.character.in_rest[start]
        for at, own in enumerate(between[1:], 1):
            rest = multiply(rest, self.character.relative_rest[own])
            share = at / count
            turned = _blend(first, last, share) if trunk else multiply(first, _twist(first, last, start, share))
            self.world[:, own] = multiply(turned, rest)
        return set(between[1:])

    def _point(self, start: int, end: int, measured: Float64Array) -> None:
        """Turn the chain between two canonical joints so that the second lies where it was measured, seen from the
        first."""
        source = self.character.source
        if start not in source or end not in source:
            return
        between = self._between(source[end])
        if not between or between[0] != source[start]:
            return
        bone = sum(
            rotate(np.ascontiguousarray(self.world[:, above]), self.offsets[below])
            for above, below in zip(between, [*between[1:], source[end]], strict=True)
        )
        turned = swing(np.asarray(bone), measured[:, end] - measured[:, start])
        for joint in between:
            self.world[:, joint] = multiply(turned, np.ascontiguousarray(self.world[:, joint]))

    def places(self, root: Float64Array) -> Float64Array:
        """[F, J, 3] of all joints, the root at [F, 3]."""
        bones = rotate(self.world[:, list(self.parents)], self.offsets)
        bones[:, 0] = root
        return chained(bones, self.parents)

    def root_for(self, hips: Float64Array) -> Float64Array:
        """[F, 3] where the root is, for hips at [F, 3]."""
        at = self.character.source[INDEX["hips"]]
        return np.asarray(hips - self.places(np.zeros_like(hips))[:, at])

    def leg(self, side: str, places: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array] | None:
        """Hip, knee and ankle [F, 3] of a side in places of all joints; None where the character lacks one."""
        joints = [self.character.source.get(INDEX[f"{side}_{part}"]) for part in LEG]
        if None in joints:
            return None
        hip, knee, ankle = (places[:, joint] for joint in joints)
        return hip, knee, ankle

    def reached(self, root: Float64Array, targets: Float64Array, stands: BoolArray, fps: float) -> Float64Array:
        """The root [F, 3], lowered where else a foot that stands would be out of a leg's reach."""
        from scipy.ndimage import gaussian_filter1d, maximum_filter1d

        places, drop = self.places(root), np.zeros(len(root))
        for at, side in enumerate(SIDES):
            leg = self.leg(side, places)
            if leg is None:
                continue
            hip, knee, ankle = leg
            long = REACH * (np.linalg.norm(knee - hip, axis=1) + np.linalg.norm(ankle - knee, axis=1))
            long = np.maximum(long, np.linalg.norm(ankle - hip, axis=1))
            way = hip - targets[:, INDEX[f"{side}_ankle"]]
            level = np.hypot(way[:, 0], way[:, 2])
            missing = way[:, 1] - np.sqrt(np.maximum(long**2 - level**2, 0))
            drop = np.maximum(drop, np.where(stands[:, at], np.clip(missing, 0, DEEPEST * long), 0))
        if drop.max() > SAME_PLACE:
            spread = max(1, round(fps * SPREAD))
            drop = gaussian_filter1d(maximum_filter1d(drop, 4 * spread + 1), spread)
        return np.asarray(root - drop[:, None] * np.array([0.0, 1.0, 0.0]))

    def bend(self, side: str, root: Float64Array, targets: Float64Array) -> None:
        """Bring an ankle to where it is wanted, [F, 21, 3], by hip and knee."""
        leg, wanted = self.leg(side, self.places(root)), targets[:, INDEX[f"{side}_ankle"]]
        if leg is None or np.linalg.norm(leg[2] - wanted, axis=1).max() < SAME_PLACE:
            return
        joints = [INDEX[f"{side}_{part}"] for part in LEG]
        hip, knee, ankle = leg
        # The whole leg points to the place before it bends, so that the knee bends in its own plane.
        points = swing(ankle - hip, wanted - hip)
        thigh = np.ascontiguousarray(self.world[:, self.character.source[joints[0]]])
        ahead = rotate(points, rotate(multiply(thigh, conjugate(self.character.in_rest[joints[0]])), FORWARD))
        towards = (hip + rotate(points, knee - hip), hip + rotate(points, ankle - hip))
        new_knee, new_ankle = bent(hip, *towards, wanted, ahead, STRAIGHT)
        self._swing_bone(joints[0], multiply(swing(towards[0] - hip, new_knee - hip), points))
        shin = swing(rotate(points, ankle - knee), new_ankle - new_knee)
        self._swing_bone(joints[1], multiply(shin, points))

    def _swing_bone(self, start: int, turned: Float64Array) -> None:
        """Turn a joint, and all that hangs on it before the next canonical joint, about itself."""
        source = self.character.source
        moved = {source[start]}
        for joint, parent in enumerate(self.parents):
            if parent in moved and joint not in self.canonical_of:
                moved.add(joint)
        for joint in sorted(moved):
            self.world[:, joint] = multiply(turned, np.ascontiguousarray(self.world[:, joint]))

    def clip(self, root: Float64Array, fps: float) -> SourceClip:
        """The poses as a clip of the character's file."""
        character, hierarchy = self.character, self.character.hierarchy
        back = conjugate(turn_to_y_up(character.up))
        local = multiply(conjugate(self.world[:, list(self.parents)]), self.world)
        local[:, 0] = multiply(back, np.ascontiguousarray(self.world[:, 0]))
        places = np.tile(character.offsets, (len(root), 1, 1))
        places[:, 0] = rotate(back, root) / character.metres_per_unit
        hips = character.source[INDEX["hips"]]
        if self.parents[hips] == 0 and set(POSITION_CHANNELS) <= set(hierarchy.channels[hips]):
            self._walk_by_hips(places, local, hips)
        return posed(hierarchy, continuous_signs(normalise(local)), places, fps)

    def _walk_by_hips(self, places: Float64Array, local: Float64Array, hips: int) -> None:
        """Leave a root that only carries the hips where the file has it, and let the hips go the way."""
        rest = self.character.hierarchy.offsets[0]
        turn = conjugate(np.ascontiguousarray(local[:, 0]))
        places[:, hips] += rotate(turn, places[:, 0] - rest)
        places[:, 0] = rest


def _blend(first: Float64Array, last: Float64Array, share: float) -> Float64Array:
    """[F, 4] a share of the way from one rotation to another, by the shorter arc."""
    near = np.where(np.sum(first * last, axis=-1, keepdims=True) < 0, -last, last)
    return normalise(first * (1 - share) + near * share)


def _twist(first: Float64Array, last: Float64Array, start: int, share: float) -> Float64Array:
    """[F, 4] a share of the turn from one rotation to another about the bone of a canonical joint."""
    axis = np.array(BONES[JOINTS[start]][1])
    turn = multiply(conjugate(first), last)
    angles = np.unwrap(2 * np.arctan2(turn[:, 1:] @ axis, turn[:, 0]))
    return from_axis_angle(axis, np.rad2deg(angles) * share)
