"""Near-duplicate clips: the same recording again, exported to another rig, at another rate, cut, or mirrored.

Two clips that perform the same action have near signatures too, so signatures only rule out: pairs whose Earth
Mover's Distance exceeds a radius are left out, most of them by lower bounds. The others are laid over each other frame
by frame at one tempo (`alignment`). They are duplicates when what differs between the directions of their bones
is a small part of what these directions change within the clips. Two takes of one action differ by more even
where one person repeats it at once: nobody moves twice in the same time. Clips in which nothing moves have
nothing to tell them apart, and are never duplicates.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.deep_motifs.emd import emd
from motionlake.deep_motifs.emd_search import SignatureIndex
from motionlake.motion.features import WordConfig
from motionlake.motion.frame_overlap import Track, align, poses
from motionlake.motion.mirror import mirrored_features

# Part of the movement that may differ.
MAX_DISTANCE: Final = 0.1
# Radius of signatures, in mean distances of two motifs.
RADIUS: Final = 0.3
# Overlap asked for, as a share of the shorter clip: a copy may have been cut.
SHARE: Final = 0.8
# Movement (radians, on average over bones and frames) below which a clip stands still.
STILL: Final = 0.01
# Clips of a block are compared with those of another; clips held ready to be aligned, some 50 kB each.
_BLOCK: Final = 1024
_HELD: Final = 4 * _BLOCK


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
    within: str | None = None,
    across: bool = False,
) -> list[Duplicate]:
    """Pairs of near-duplicates, nearest first; a pair is one row, the clips in the order of their names.

    Args:
        clips: what to compare.
        features: [T, D] of a clip by its name, as `word_features` gives them under `config`.
        config: of the words.
        max_distance: see `Duplicate.distance`.
        within: a dataset that both clips must belong to.
        across: only pairs of two datasets.
    """
    datasets = np.array(clips.datasets, dtype=object)
    kept = np.flatnonzero(datasets == within) if within is not None else np.arange(len(datasets))

    @lru_cache(maxsize=_HELD)
    def track(clip: str, turned: bool) -> Track:
        frames = features(clip)
        return Track.of(poses(mirrored_features(frames, config) if turned else frames, config))

    found: dict[tuple[int, int], Duplicate] = {}
    for turned, i, j in _candidates(clips, kept, across).tolist():
        duplicate = _confirmed(clips, track, config.fps, i, j, bool(turned), max_distance)
        if duplicate and ((i, j) not in found or duplicate.distance < found[i, j].distance):
            found[i, j] = duplicate
    return sorted(found.values(), key=lambda d: (d.distance, d.clip, d.other))


def _candidates(clips: SignatureSet, kept: Int64Array, across: bool) -> Int64Array:
    """[c, 3] (mirrored, i, j), i < j, of the pairs that lower bounds do not put beyond the radius.

    In an order in which the clips of neighbouring rows are few.
    """
    index = SignatureIndex.build(clips.signatures, clips.ground)
    radius = _radius(clips.ground)
    datasets = np.array(clips.datasets, dtype=object)
    pairs = [np.zeros((0, 3), dtype=np.int64)]
    sides = [clips.signatures] if clips.mirrored is None else [clips.signatures, clips.mirrored]
    for mirrored, signatures in enumerate(sides):
        for place, i in enumerate(kept.tolist()):
            later = kept[place + 1 :]
            later = later[datasets[later] != datasets[i]] if across else later
            mass = signatures[i].astype(np.float64) / signatures[i].sum(dtype=np.float64)
            later = later[index.cheap_bounds(mass, later) <= radius]
            later = later[index.tight_bounds(mass, later, radius) <= radius]
            pairs.append(np.column_stack([np.full((len(later), 2), (mirrored, i)), later]))
    rows = np.concatenate(pairs)
    turned, first, second = rows.T
    return rows[np.lexsort((second, first, turned, second // _BLOCK, first // _BLOCK))]


def _radius(ground: Float64Array) -> float:
    n = len(ground)
    return RADIUS * float(ground.sum() / max(1, n * (n - 1)))


def _confirmed(
    clips: SignatureSet,
    tracks: Callable[[str, bool], Track],
    fps: float,
    i: int,
    j: int,
    mirrored: bool,
    max_distance: float,
) -> Duplicate | None:
    first, second = tracks(clips.names[i], mirrored), tracks(clips.names[j], False)
    moved = min(first.movement, second.movement)
    if moved <= STILL:
        return None
    found = align(first, second, SHARE, max_distance * moved)
    if not np.isfinite(found.distance):
        return None
    signature = clips.signatures[i] if not mirrored or clips.mirrored is None else clips.mirrored[i]
    distance = emd(signature, clips.signatures[j], clips.ground)
    if distance > _radius(clips.ground):
        return None
    return Duplicate(
        clips.names[i],
        clips.names[j],
        found.distance / moved,
        mirrored,
        found.offset / fps,
        found.overlap / fps,
        distance,
    )
