"""Whether two clips show one motion: their frames laid over each other at the best offset in time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.motion.features import WordConfig
from motionlake.motion.rotations import to_matrix
from motionlake.motion.skeleton import INDEX
from numba import njit

# Copies need not be cut on the words' frames: (part of a frame, whole frames) by which the best offset is refined.
FRACTIONS: Final = (*((i / 8, 0) for i in range(1, 5)), *((i / 8, 1) for i in range(4, 8)))
# Trunk, head and limbs. Shoulders and hips are left out: rigs differ in where they attach limbs to the trunk.
BONES: Final = (
    ("hips", "neck"),
    ("neck", "head"),
    *(
        (f"{side}_{start}", f"{side}_{end}")
        for side in ("left", "right")
        for start, end in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))
    ),
)
SHORTEST: Final = 1e-6  # body lengths; what is shorter points nowhere


@dataclass(frozen=True)
class Alignment:
    """The best of all offsets.

    Attributes:
        distance: mean over the bones and the frames of the overlap; inf where no offset stays within the limit.
        offset: frames at the words' rate that the second clip begins after the first.
        overlap: frames that both share.
    """

    distance: float
    offset: float
    overlap: int


def poses(features: Float32Array, config: WordConfig) -> Float32Array:
    """What `align` compares of a clip's features: which way each bone points, seen from the body.

    Directions survive what exports do to a clip: other bone lengths, and rigid bones where sensors gave none.

    Returns:
        [T, 10, 3] unit vectors along `BONES`; for words of rotations [T, joints, 6], the first two columns of the
        rotations' matrices, which unlike quaternions have one sign.
    """
    joints = len(config.joint_indices)
    if config.representation == "rotations":
        matrices = to_matrix(features.reshape(len(features), joints, 4).astype(np.float64))
        return np.ascontiguousarray(matrices[..., :2].reshape(len(features), joints, 6), dtype=np.float32)
    positions = features[:, : 3 * joints].reshape(len(features), joints, 3)
    from_hips = np.concatenate([positions, np.zeros_like(positions[:, :1])], axis=1)
    place = {INDEX["hips"]: joints} | {joint: i for i, joint in enumerate(config.joint_indices)}
    starts, ends = zip(*((place[INDEX[start]], place[INDEX[end]]) for start, end in BONES), strict=True)
    bones = from_hips[:, list(ends)] - from_hips[:, list(starts)]
    lengths = np.linalg.norm(bones, axis=-1, keepdims=True)
    return np.ascontiguousarray(bones / np.maximum(lengths, SHORTEST), dtype=np.float32)


@dataclass(frozen=True)
class Track:
    """A clip prepared to be aligned with many others.

    Attributes:
        frames: [T, J, C] `poses`.
        sums: [T + 1, J, C] sums of all frames before each.
        movement: mean distance of the bones from what they are on average: how much the clip moves.
        step: mean distance of the bones from what they are a frame later.
    """

    frames: Float32Array
    sums: Float64Array
    movement: float
    step: float

    @classmethod
    def of(cls, frames: Float32Array) -> Track:
        """From `poses` [T, J, C].

        Raises:
            ValueError: no frames.
        """
        if not len(frames):
            raise ValueError("a clip without frames cannot be aligned")
        movement = np.linalg.norm(frames - frames.mean(axis=0), axis=-1).mean()
        step = np.linalg.norm(np.diff(frames, axis=0), axis=-1).mean() if len(frames) > 1 else 0.0
        return cls(frames, _running(frames), float(movement), float(step))


def align(first: Track, second: Track, share: float, limit: float = np.inf) -> Alignment:
    """Lay one clip over another, frame on frame at one tempo.

    The distance of two frames is that of their bones less the mean difference of each bone over the overlap, so
    a constant difference does not count: rigs attach limbs in slightly different places.

    Args:
        first: a clip of n frames.
        second: a clip of m frames.
        share: least overlap, as a share of the shorter clip, in (0, 1].
        limit: offsets with a larger distance are of no interest.

    Raises:
        ValueError: a share out of range.
    """
    if not 0 < share <= 1:
        raise ValueError(f"a share of {share} is not in (0, 1]")
    n, m = len(first.frames), len(second.frames)
    least = max(1, int(np.ceil(share * min(n, m))))
    # The best offset is up to half a frame from a whole one.
    loose = limit + max(first.step, second.step) / 2
    distance, offset = _best_offset(first.frames, second.frames, first.sums, second.sums, least, float(loose))
    best = Alignment(float(distance), float(offset), _overlap(n, m, offset))
    for fraction, begin in FRACTIONS if np.isfinite(distance) else ():
        between = second.frames[:-1] + np.float32(fraction) * (second.frames[1:] - second.frames[:-1])
        overlap = _overlap(n, m - 1, offset + begin)
        if overlap >= max(1, least - 1):
            found = _offset_distance(
                first.frames, between, first.sums, _running(between), offset + begin, best.distance
            )
            if found < best.distance:
                best = Alignment(float(found), offset + begin - fraction, overlap)
    return best if best.distance <= limit else Alignment(float("inf"), 0.0, 0)


def _overlap(n: int, m: int, offset: int) -> int:
    return min(m, n - offset) - max(0, -offset)


def _running(clip: Float32Array) -> Float64Array:
    """[T + 1, J, C] sums of all frames before each."""
    sums = np.zeros((len(clip) + 1, *clip.shape[1:]))
    np.cumsum(clip, axis=0, out=sums[1:])
    return sums


@njit(cache=True)  # type: ignore[untyped-decorator]
def _offset_distance(
    first: Float32Array,
    second: Float32Array,
    first_sums: Float64Array,
    second_sums: Float64Array,
    offset: int,
    limit: float,
) -> float:
    """Mean distance of bones with second[j] on first[j + offset]; inf once it is certain to exceed `limit`."""
    begin, end = max(0, -offset), min(len(second), len(first) - offset)
    n_joints, width = first.shape[1], first.shape[2]
    count = (end - begin) * n_joints
    constant = np.empty((n_joints, width))
    for joint in range(n_joints):
        for c in range(width):
            ours = first_sums[end + offset, joint, c] - first_sums[begin + offset, joint, c]
            theirs = second_sums[end, joint, c] - second_sums[begin, joint, c]
            constant[joint, c] = (ours - theirs) / (end - begin)
    total = 0.0
    for j in range(begin, end):
        for joint in range(n_joints):
            square = 0.0
            for c in range(width):
                gap = first[j + offset, joint, c] - second[j, joint, c] - constant[joint, c]
                square += gap * gap
            total += np.sqrt(square)
        if total > limit * count:
            return np.inf
    return float(total / count)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _best_offset(
    first: Float32Array,
    second: Float32Array,
    first_sums: Float64Array,
    second_sums: Float64Array,
    least: int,
    limit: float,
) -> tuple[float, int]:
    best, best_offset = np.inf, 0
    for offset in range(least - len(second), len(first) - least + 1):
        distance = _offset_distance(first, second, first_sums, second_sums, offset, min(best, limit))
        if distance < best:
            best, best_offset = distance, offset
    return best, best_offset
