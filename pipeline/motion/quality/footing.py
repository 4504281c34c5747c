"""Feet on the ground: a body that slides or sinks is put back by its root, and what feet still wander legs take."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array
from motionlake.motion.kinematics import forward_kinematics, local_rotations, world_rotations
from motionlake.motion.quality.faults import Fault, Recording
from motionlake.motion.quality.feet import NEAR, RISING, SPAN, Ground
from motionlake.motion.runs import runs
from motionlake.motion.skeleton import INDEX
from motionlake.motion.standing import SIDES, staying
from motionlake.motion.two_bones import bent, level_ahead, turn_leg

STEADY: Final = 0.03  # seconds over which the way of a foot that slides is smoothed
EDGE: Final = 0.1  # seconds over which a body is raised, and feet come to where they stand
FAR: Final = 0.08  # metres that legs take at most


@dataclass
class Body:
    """A motion while it is mended: root [F, 3], local rotations [F, 21, 4], of bones [21, 3]."""

    root: Float64Array
    rotations: Float64Array
    rest_offsets: Float64Array
    fps: float

    def places(self) -> Float64Array:
        return forward_kinematics(self.root, self.rotations, self.rest_offsets)

    def recording(self) -> Recording:
        return Recording(self.places(), self.rotations, self.fps)


def footed(body: Body, fault: Fault) -> bool:
    """Mend a slide, or feet that sink, in place; whether that was done: not where the body would jump for it."""
    if fault.kind == "slide":
        done = smoothly(body, fault, _held)
        return done and (smoothly(body, fault, pinned) or done)
    return fault.joint.endswith(("ankle", "toe")) and smoothly(body, fault, _raised)


def smoothly(body: Body, fault: Fault, mend: Callable[[Body, Fault], None]) -> bool:
    """Whether a change was kept: one by which the largest jerk of the clip grows is taken back."""
    kept, before = (body.root, body.rotations), _jerk(body.places())
    mend(body, fault)
    if _jerk(body.places()) <= before:
        return True
    body.root, body.rotations = kept
    return False


def _held(body: Body, fault: Fault) -> None:
    """Take the level way of the slowest low point of the feet from the root; what comes after is moved as far."""
    from scipy.ndimage import gaussian_filter1d

    ground = Ground.of(body.recording())
    reach = round(SPAN * body.fps) + 1  # speeds are taken over some time, so that ends are known no better
    first, last = max(0, fault.start - reach), min(len(body.root) - 1, fault.stop + reach)
    low = (np.abs(ground.above) < NEAR) & (np.abs(ground.rising) < RISING)
    steps = np.diff(ground.points[first : last + 1][..., [0, 2]], axis=0)
    lengths = np.where(low[first:last] & low[first + 1 : last + 1], np.linalg.norm(steps, axis=2), np.inf)
    known = np.flatnonzero(np.isfinite(lengths).any(axis=1))
    if not len(known):
        return
    frames = np.arange(last - first)
    moved = steps[known, lengths[known].argmin(axis=1)]
    moved = np.stack([np.interp(frames, known, moved[:, axis]) for axis in range(2)], axis=1)
    slides = runs(np.linalg.norm(moved, axis=1) * body.fps > fault.severity / 2, reach)
    if not slides:
        return
    start, stop = max(slides, key=lambda each: each[1] - each[0])
    moved = gaussian_filter1d(moved[start:stop], STEADY * body.fps, axis=0, mode="nearest")
    way = np.zeros((len(body.root), 2))
    way[first + start + 1 : first + stop + 1] = np.cumsum(moved, axis=0)
    way[first + stop + 1 :] = way[first + stop]
    body.root = body.root.copy()
    body.root[:, [0, 2]] -= way


def _raised(body: Body, fault: Fault) -> None:
    """Raise the root by how deep the lowest point of the feet is below the ground."""
    from scipy.ndimage import gaussian_filter1d

    ground = Ground.of(body.recording())
    reach = round(2 * EDGE * body.fps)
    about = np.zeros(len(body.root), dtype=np.bool_)
    about[max(0, fault.start - reach) : fault.stop + reach] = True
    depth = np.where(about, np.maximum(-ground.above.min(axis=1), 0.0), 0.0)
    body.root = body.root.copy()
    body.root[:, 1] += gaussian_filter1d(depth, STEADY * body.fps)


def pinned(body: Body, fault: Fault) -> None:
    """Bring feet that stand in a range to one place each, by hip and knee; feet keep how they are turned."""
    places = body.places()
    ground = Ground.of(Recording(places, body.rotations, body.fps))
    ahead = level_ahead(places[:, INDEX["left_hip"]], places[:, INDEX["right_hip"]])
    world = world_rotations(body.rotations)
    for at, side in enumerate(SIDES):
        hip, knee, ankle, toe = (INDEX[f"{side}_{part}"] for part in ("hip", "knee", "ankle", "toe"))
        stands: BoolArray = np.all(np.abs(ground.above[:, [at, at + 2]]) < NEAR, axis=1)
        stands &= ground.speeds[:, [at, at + 2]].min(axis=1) < 2 * NEAR / EDGE
        stands[: fault.start] = stands[fault.stop :] = False
        change = staying(places[:, [ankle, toe]], stands, FAR, max(1, round(EDGE * body.fps)))
        if not change.any():
            continue
        leg = (places[:, hip], places[:, knee], places[:, ankle])
        knees, ankles = bent(*leg, leg[2] + change, ahead)
        moved = np.flatnonzero(np.abs(change).max(axis=1) > 0)
        hips, old_knees, old_ankles = (joint[moved] for joint in leg)
        turned = world[moved]
        turn_leg(turned, (hip, knee), (hips, old_knees, old_ankles), knees[moved], ankles[moved])
        world[moved] = turned
    body.rotations = local_rotations(world)


def _jerk(places: Float64Array) -> float:
    """The largest third difference of a joint."""
    return float(np.abs(np.diff(places, 3, axis=0)).max(initial=0.0))
