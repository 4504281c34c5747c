"""Near-duplicate clips: the same recording again, exported to another rig, at another rate, cut, or mirrored.

Two clips that perform the same action have near signatures too, so signatures only rule out: pairs whose Earth
Mover's Distance exceeds a radius are left out, most of them by lower bounds. The others are laid over each other frame
by frame at one tempo (`align`). They are duplicates when what differs between the directions of their bones
is a small part of what these directions change within the clips. Two takes of one action differ by more even
where one person repeats it at once: nobody moves twice in the same time. Clips in which nothing moves have
nothing to tell them apart, and are never duplicates.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.deep_motifs.emd import emd
from motionlake.deep_motifs.emd_search import SignatureIndex
from motionlake.kernels import njit
from motionlake.motion.features import WordConfig, mirrored_features
from motionlake.motion.rotations import to_matrix
from motionlake.motion.skeleton import INDEX

MAX_DISTANCE: Final = 0.1  # part of the movement that may differ
RADIUS: Final = 0.3  # of signatures, in mean distances of two motifs
SHARE: Final = 0.8  # least overlap, as a share of the shorter clip: a copy may have been cut
STILL: Final = 0.01  # movement (radians, mean over bones and frames) below which a clip stands still
# Clips of a block are compared with those of another; clips held ready to be aligned, some 50 kB each.
_BLOCK: Final = 1024
_HELD: Final = 4 * _BLOCK
# Copies need not be cut on the words' frames: (part of a frame, whole frames) by which the best offset is refined.
FRACTIONS: Final = (*((i / 8, 0) for i in range(1, 5)), *((i / 8, 1) for i in range(4, 8)))
# Trunk, head and limbs. Shoulders and hips are left out: rigs differ in where they attach limbs to the trunk.
_LIMBS: Final = (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))
BONES: Final = (
    *(("hips", "neck"), ("neck", "head")),
    *((f"{side}_{start}", f"{side}_{end}") for side in ("left", "right") for start, end in _LIMBS),
)
SHORTEST: Final = 1e-6  # body lengths; what is shorter points nowhere


@dataclass(frozen=True)
class SignatureSet:
    """n clips that may be duplicates.

    Attributes:
        names: n, by name.
        datasets: n.
        signatures: [n, K].
        mirrored: [n, K] signatures of the mirrored clips, or None where mirrored copies are not looked for.
        ground: [K, K] distances of the motifs.
    """

    names: Sequence[str]
    datasets: Sequence[str]
    signatures: Float32Array
    mirrored: Float32Array | None
    ground: Float64Array

    @property
    def radius(self) -> float:
        """Earth Mover's Distance beyond which no two clips are duplicates."""
        n = len(self.ground)
        return RADIUS * float(self.ground.sum() / max(1, n * (n - 1)))


@dataclass(frozen=True)
class Duplicate:
    """Two clips of one motion.

    Attributes:
        distance: what differs, as a part of the movement of the clip that moves less.
        mirrored: the other clip is a mirror image.
        offset_seconds: how much later than the clip the other begins.
        overlap_seconds: how long both show the same.
        signatures: Earth Mover's Distance of the signatures, the other's mirrored where it is a mirror image.
    """

    clip: str
    other: str
    distance: float
    mirrored: bool
    offset_seconds: float
    overlap_seconds: float
    signatures: float


def find_duplicates(
    clips: SignatureSet,
    features: Callable[[str], Float32Array],
    config: WordConfig,
    *,
    max_distance: float = MAX_DISTANCE,
    across: bool = False,
) -> list[Duplicate]:
    """Pairs of near-duplicates, nearest first; a pair is one row, the clips in the order of their names.

    Args:
        clips: what to compare.
        features: [T, D] of a clip by its name, as `word_features` gives them under `config`.
        config: of the words.
        max_distance: see `Duplicate.distance`.
        across: only pairs of two datasets.
    """

    @lru_cache(maxsize=_HELD)
    def track(clip: str, mirrored: bool) -> Track:
        frames = features(clip)
        return Track.of(poses(mirrored_features(frames, config) if mirrored else frames, config))

    found: dict[tuple[int, int], Duplicate] = {}
    for mirrored, i, j in _candidates(clips, across).tolist():
        first, second = track(clips.names[i], bool(mirrored)), track(clips.names[j], False)
        moved = min(first.movement, second.movement)
        if moved <= STILL:
            continue
        best = align(first, second, SHARE, max_distance * moved)
        distance = best.distance / moved
        if not np.isfinite(distance) or ((i, j) in found and distance >= found[i, j].distance):
            continue
        own = clips.mirrored if mirrored and clips.mirrored is not None else clips.signatures
        apart = emd(own[i], clips.signatures[j], clips.ground)
        if apart <= clips.radius:
            seconds = best.offset / config.fps, best.overlap / config.fps
            found[i, j] = Duplicate(clips.names[i], clips.names[j], distance, bool(mirrored), *seconds, apart)
    return sorted(found.values(), key=lambda d: (d.distance, d.clip, d.other))


def _candidates(clips: SignatureSet, across: bool) -> Int64Array:
    """[c, 3] (mirrored, i, j), i < j, of the pairs that lower bounds do not put beyond the radius.

    In an order in which the clips of neighbouring rows are few.
    """
    index = SignatureIndex.build(clips.signatures, clips.ground)
    datasets = np.array(clips.datasets, dtype=object)
    pairs = [np.zeros((0, 3), dtype=np.int64)]
    sides = [clips.signatures] if clips.mirrored is None else [clips.signatures, clips.mirrored]
    for mirrored, signatures in enumerate(sides):
        for i, signature in enumerate(signatures):
            later = np.arange(i + 1, len(datasets))
            later = later[datasets[later] != datasets[i]] if across else later
            mass = signature.astype(np.float64) / signature.sum(dtype=np.float64)
            later = later[index.cheap_bounds(mass, later) <= clips.radius]
            later = later[index.tight_bounds(mass, later, clips.radius) <= clips.radius]
            pairs.append(np.column_stack([np.full((len(later), 2), (mirrored, i)), later]))
    rows = np.concatenate(pairs)
    mirrored_ones, first, second = rows.T
    return rows[np.lexsort((second, first, mirrored_ones, second // _BLOCK, first // _BLOCK))]


def poses(features: Float32Array, config: WordConfig) -> Float32Array:
    """Which way each bone points, seen from the body: what `align` compares of a clip's features.

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


class Track(NamedTuple):
    """A clip prepared to be aligned with many others.

    Attributes:
        frames, sums: [T, J, C] `poses`, and [T + 1, J, C] sums of all before each.
        movement: mean distance of the bones from what they are on average: how much the clip moves.
        step: mean distance of the bones from what they are a frame later.
    """

    frames: Float32Array
    sums: Float64Array
    movement: float = 0.0
    step: float = 0.0

    @classmethod
    def of(cls, frames: Float32Array) -> Track:
        """From `poses` [T, J, C] of at least one frame."""
        movement = np.linalg.norm(frames - frames.mean(axis=0), axis=-1).mean()
        step = np.linalg.norm(np.diff(frames, axis=0), axis=-1).mean() if len(frames) > 1 else 0.0
        return cls(frames, _running(frames), float(movement), float(step))


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


def align(first: Track, second: Track, share: float, limit: float = np.inf) -> Alignment:
    """Lay one clip over another, frame on frame at one tempo.

    The distance of two frames is that of their bones less the mean difference of each bone over the overlap, so
    a constant difference does not count: rigs attach limbs in slightly different places.

    Args:
        first, second: the clips.
        share: least overlap, as a share of the shorter clip, in (0, 1].
        limit: offsets with a larger distance are of no interest.
    """
    n, m = len(first.frames), len(second.frames)
    least = max(1, int(np.ceil(share * min(n, m))))
    # The best offset is up to half a frame from a whole one.
    loose = limit + max(first.step, second.step) / 2
    distance, offset = _best_offset(first, second, least, float(loose))
    best = Alignment(float(distance), float(offset), _overlap(n, m, offset))
    for fraction, begin in FRACTIONS if np.isfinite(distance) else ():
        overlap = _overlap(n, m - 1, offset + begin)
        if overlap >= max(1, least - 1):
            between = second.frames[:-1] + np.float32(fraction) * (second.frames[1:] - second.frames[:-1])
            found = _offset_distance(first, Track(between, _running(between)), offset + begin, best.distance)
            if found < best.distance:
                best = Alignment(float(found), offset + begin - fraction, overlap)
    return best if best.distance <= limit else Alignment(float("inf"), 0.0, 0)


def _overlap(n: int, m: int, offset: int) -> int:
    return min(m, n - offset) - max(0, -offset)


def _running(frames: Float32Array) -> Float64Array:
    """[T + 1, J, C] sums of all frames before each."""
    sums = np.zeros((len(frames) + 1, *frames.shape[1:]))
    np.cumsum(frames, axis=0, out=sums[1:])
    return sums


@njit(cache=True)
def _offset_distance(first: Track, second: Track, offset: int, limit: float) -> float:
    """Mean distance of bones with second[j] on first[j + offset]; inf once it is certain to exceed `limit`."""
    ours, theirs = first.frames, second.frames
    begin, end = max(0, -offset), min(len(theirs), len(ours) - offset)
    n_joints, width = ours.shape[1], ours.shape[2]
    count = (end - begin) * n_joints
    constant = np.empty((n_joints, width))
    for joint in range(n_joints):
        for c in range(width):
            shown = first.sums[end + offset, joint, c] - first.sums[begin + offset, joint, c]
            other = second.sums[end, joint, c] - second.sums[begin, joint, c]
            constant[joint, c] = (shown - other) / (end - begin)
    total = 0.0
    for j in range(begin, end):
        for joint in range(n_joints):
            square = 0.0
            for c in range(width):
                gap = ours[j + offset, joint, c] - theirs[j, joint, c] - constant[joint, c]
                square += gap * gap
            total += np.sqrt(square)
        if total > limit * count:
            return np.inf
    return float(total / count)


@njit(cache=True)
def _best_offset(first: Track, second: Track, least: int, limit: float) -> tuple[float, int]:
    best, best_offset = np.inf, 0
    for offset in range(least - len(second.frames), len(first.frames) - least + 1):
        distance = _offset_distance(first, second, offset, min(best, limit))
        if distance < best:
            best, best_offset = distance, offset
    return best, best_offset
