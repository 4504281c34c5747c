"""How far arms' twist in HDM05 is the recordings' own: `python -m bench.joint_twist` (docs/skeletons.md).

Prints how mean twists of shoulder and wrist differ between subjects of one class, by how far the elbow is bent,
and how words of rotations retrieve with and without that twist. Needs MOTIONLAKE_DATA.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations, pairwise
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.features import WordConfig
from motionlake.motion.kinematics import local_rotations, world_from_positions
from motionlake.motion.rotations import rotate, swing
from motionlake.motion.skeleton import INDEX, TWIST_AXES

from bench.canonical_sets import LabelledClip, features, load
from bench.record import record
from bench.representation import score, shallow

STEP: Final = 12
BENDS: Final = (0, 15, 30, 60, 180)
MIN_FRAMES: Final = 20
ARM: Final = ("shoulder", "wrist")


def twist(rotations: Float64Array, joint: str) -> Float64Array:
    """[F] radians of [F, 21, 4] local rotations about the joint's own bone."""
    own = rotations[:, INDEX[joint]]
    return np.asarray(2 * np.arctan2(own[:, 1:] @ np.array(TWIST_AXES[joint]), own[:, 0]))


def bend(rotations: Float64Array, joint: str) -> Float64Array:
    """[F] degrees between a joint's bone and the one before."""
    axis = np.array(TWIST_AXES[joint])
    turned = rotate(np.ascontiguousarray(rotations[:, INDEX[joint]]), axis)
    return np.asarray(np.degrees(np.arccos(np.clip(turned @ axis, -1, 1))))


def between_subjects(clips: list[LabelledClip], side: str, low: float, high: float) -> dict[str, float]:
    """Median over classes and pairs of subjects of the difference in mean twist, degrees; none without a pair."""
    means: dict[str, list[Float64Array]] = {}
    for label in sorted({clip.label for clip in clips}):
        for subject in sorted({clip.subject for clip in clips}):
            own = [c.rotations[::STEP] for c in clips if (c.label, c.subject) == (label, subject)]
            frames = np.concatenate([*own, np.empty((0, 21, 4))])
            angle = bend(frames, f"{side}_elbow")
            frames = frames[(angle >= low) & (angle < high)]
            if len(frames) >= MIN_FRAMES:
                shoulder, wrist = (twist(frames, f"{side}_{part}") for part in ARM)
                directions = np.exp(1j * np.stack([shoulder, wrist, shoulder + wrist]))
                means.setdefault(label, []).append(np.angle(directions.mean(axis=1)))
    pairs = [np.abs(np.angle(np.exp(1j * (a - b)))) for each in means.values() for a, b in combinations(each, 2)]
    if not pairs:
        return {}
    return dict(zip((*ARM, "sum"), np.degrees(np.median(pairs, axis=0)).round(1).tolist(), strict=True))


def without_twist(clip: LabelledClip) -> Float64Array:
    """The clip's rotations with the smallest turns at shoulders and wrists that point bones the same way."""
    rotations = clip.rotations.copy()
    for joint in (f"{side}_{part}" for side in ("left", "right") for part in ARM):
        axis = np.array(TWIST_AXES[joint])
        own = np.ascontiguousarray(rotations[:, INDEX[joint]])
        rotations[:, INDEX[joint]] = swing(np.broadcast_to(axis, (len(own), 3)), rotate(own, axis))
    return rotations


def retrieval(clips: list[LabelledClip]) -> dict[str, float]:
    """Leave-one-out MAP of shallow words."""
    variants: dict[str, Callable[[LabelledClip], Float64Array]] = {
        "rotations as recorded": lambda clip: clip.rotations,
        "without twist of shoulders and wrists": without_twist,
        "rotations from positions": lambda clip: local_rotations(world_from_positions(clip.positions)),
    }
    paper, default = WordConfig.deep_motifs(), WordConfig()
    found = {}
    for name, rotations in variants.items():
        changed = [replace(clip, rotations=rotations(clip)) for clip in clips]
        found[name] = round(score(shallow(features(changed, paper), paper, 0), clips, 0).map, 3)
    found["positions"] = round(score(shallow(features(clips, default), default, 0), clips, 0).map, 3)
    return found


def main() -> None:
    clips = load("hdm05")
    twists = {
        f"{side} elbow bent {low} to {high}": between_subjects(clips, side, low, high)
        for side in ("left", "right")
        for low, high in pairwise(BENDS)
    }
    maps = retrieval(clips)
    for name, figures in twists.items():
        print(name, figures)
    print(maps)
    print(record("twist", {"degrees_between_subjects": twists, "map": maps}))


if __name__ == "__main__":
    main()
