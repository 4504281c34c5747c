"""Copies of motions with what can be mended: T-poses, spikes, flips, noise, and feet that slide or sink."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.canonicalise import CanonicalMotion
from motionlake.motion.kinematics import continuous_signs, forward_kinematics
from motionlake.motion.quality.faults import Fault
from motionlake.motion.quality.footing import Body, footed
from motionlake.motion.rotations import conjugate, multiply, normalise
from motionlake.motion.skeleton import INDEX, PARENTS

WINDOW: Final = 0.15  # seconds over which noise is smoothed
ORDER: Final = 2
FOOTING: Final = {"slide": "pinned", "penetration": "raised"}
APART: Final = 0.6  # seconds at most between a flip and the one back


@dataclass(frozen=True)
class Mended:
    """What was done to frames [start, stop) of the source.

    Attributes:
        how: cut, filled, turned back, smoothed, pinned (feet that slid), or raised (a body that sank).
        fault: its kind.
        joint: the highest joint that changed; "" where all did.
    """

    how: str
    fault: str
    joint: str
    start: int
    stop: int

    def as_row(self) -> dict[str, Any]:
        return asdict(self)


def mended(motion: CanonicalMotion, faults: Sequence[Fault]) -> tuple[CanonicalMotion, list[Mended]]:
    """A motion without its T-poses, spikes, flips that flip back, jitter, slides and sunk feet; other faults stay.

    Bones have their rest lengths afterwards: joints follow from rotations (forward kinematics).

    Args:
        motion: stays as it is.
        faults: of it, as `check` finds them.

    Returns:
        The mended copy, and what was done, by frames of `motion`. The same motion where nothing can be mended.

    Raises:
        ValueError: nothing is left beside T-poses.
    """
    root, rotations = motion.root.copy(), motion.rotations.copy()
    done = [_filled(root, rotations, fault) for fault in faults if fault.kind == "spike"]
    done += _unflipped(rotations, [fault for fault in faults if fault.kind == "flip"], motion.fps)
    done += [_smoothed(root, rotations, fault, motion.fps) for fault in faults if fault.kind == "jitter"]
    body = Body(root, continuous_signs(normalise(rotations)), motion.rest_offsets, motion.fps)
    for fault in (fault for fault in faults if fault.kind in FOOTING):
        if footed(body, fault):
            done.append(Mended(FOOTING[fault.kind], fault.kind, fault.joint, fault.start, fault.stop))
    root, rotations = body.root, body.rotations
    first = max((fault.stop for fault in faults if fault.kind == "tpose_start"), default=0)
    last = min((fault.start for fault in faults if fault.kind == "tpose_end"), default=len(motion))
    if first >= last:
        raise ValueError("nothing is left beside T-poses")
    if first or last < len(motion):
        cuts = [fault for fault in faults if fault.kind.startswith("tpose")]
        done += [Mended("cut", fault.kind, "", fault.start, fault.stop) for fault in cuts]
    if not done:
        return motion, []
    rotations = continuous_signs(normalise(rotations))[first:last]
    root = root[first:last]
    places = forward_kinematics(root, rotations, motion.rest_offsets)
    return replace(motion, root=root, rotations=rotations, positions=places, fk_error=0.0, fk_error_mean=0.0), done


def _bridge(values: Float64Array, start: int, stop: int) -> None:
    """Fill frames [start, stop) of values [F, ...] from the frame before to the one after; at an end, by that one."""
    before, after = max(start - 1, 0), min(stop, len(values) - 1)
    if start == 0:
        before = after
    if stop == len(values):
        after = before
    share = (np.arange(start, stop) - (start - 1)) / (stop - start + 1)
    share = share.reshape(-1, *(1,) * (values.ndim - 1))
    values[start:stop] = (1 - share) * values[before] + share * values[after]


def _below(joint: int) -> list[int]:
    """A joint and those of its limb below it."""
    found = [joint]
    for other in range(joint + 1, len(PARENTS)):
        if PARENTS[other] in found:
            found.append(other)
    return found


def _turned(rotations: Float64Array, joints: list[int], start: int, stop: int) -> None:
    """Fill the rotations of joints; few frames, so that the shortest way is as good as the arc."""
    part = rotations[:, joints]
    if start > 0 and stop < len(part):
        part[stop] *= np.where((part[start - 1] * part[stop]).sum(axis=-1, keepdims=True) < 0, -1.0, 1.0)
    _bridge(part, start, stop)
    rotations[:, joints] = part


def _filled(root: Float64Array, rotations: Float64Array, fault: Fault) -> Mended:
    # What bends to throw a joint out is the joint above it.
    joint = INDEX[fault.joint]
    if joint == 0:
        _bridge(root, fault.start, fault.stop)
    _turned(rotations, _below(max(PARENTS[joint], 0)), fault.start, fault.stop)
    return Mended("filled", fault.kind, fault.joint, fault.start, fault.stop)


def _unflipped(rotations: Float64Array, flips: Sequence[Fault], fps: float) -> list[Mended]:
    """Undo a flip up to the next one of the same joint, where that turns it back: joints below stay as they are."""
    done: list[Mended] = []
    last: dict[str, Fault] = {}
    for flip in flips:
        begun = last.pop(flip.joint, None)
        if begun is not None and flip.stop - begun.start <= APART * fps:
            start, stop = begun.start + 1, flip.stop - 1
            joint = INDEX[flip.joint]
            turn = multiply(conjugate(rotations[start - 1, joint]), rotations[start, joint])
            within = slice(start, stop)
            undone = multiply(rotations[within, joint], conjugate(turn))
            if (
                _apart(undone[-1], rotations[stop, joint])
                > _apart(rotations[stop - 1, joint], rotations[stop, joint]) / 2
            ):
                last[flip.joint] = flip  # it turns to somewhere else
                continue
            rotations[within, joint] = undone
            for below in (j for j, parent in enumerate(PARENTS) if parent == joint):
                rotations[within, below] = multiply(turn, rotations[within, below])
            done.append(Mended("turned back", "flip", flip.joint, start, stop))
        else:
            last[flip.joint] = flip
    return done


def _apart(one: Float64Array, other: Float64Array) -> float:
    """The angle between two rotations [4], radians."""
    return float(2 * np.arccos(np.clip(np.abs(one @ other), 0.0, 1.0)))


def _smoothed(root: Float64Array, rotations: Float64Array, fault: Fault, fps: float) -> Mended:
    from scipy.signal import savgol_filter

    start, stop = fault.start, fault.stop
    window = min(max(5, round(WINDOW * fps) // 2 * 2 + 1), (stop - start - 1) // 2 * 2 + 1)
    if window > ORDER:
        root[start:stop] = savgol_filter(root[start:stop], window, ORDER, axis=0)
        rotations[start:stop] = savgol_filter(rotations[start:stop], window, ORDER, axis=0)
    return Mended("smoothed", fault.kind, "", start, stop)
