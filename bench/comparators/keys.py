"""Motion keys of Kapadia, Chiang, Thomas, Badler and Kider (2013): sequences of the values of a few features.

A key is a structural, geometric or dynamic feature of the body (after Laban) that takes one of a few values at a
time; a clip is a sequence of values for each key, and a trie finds the clips that hold a sequence. Which keys there
are, and where one value ends and the next begins, users of the paper choose; here there are 22 keys of `VALUES`
values, as many frames of the set in each, and a value that lasts less than an eighth of a second is taken for the one
before. The paper finds clips and does not rank them: here clips are ranked by how many sequences of up to `LONGEST`
values they share, key by key (twice those in common over those of both).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, product
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array

from bench.comparators.seen import SIDES, WORDS, Seen, bend

VALUES: Final = 3
LONGEST: Final = 4
SHORTEST: Final = 3  # frames of a value
# Sequences of values of which no two that follow each other are alike: what a trie of that depth has room for.
SEQUENCES: Final = tuple(
    run
    for length in range(1, LONGEST + 1)
    for run in product(range(VALUES), repeat=length)
    if all(a != b for a, b in pairwise(run))
)


def measured(clip: Seen) -> Float64Array:
    """[T, 22] what the keys are values of."""
    wrists, ankles = ([clip.joint(f"{side}_{part}") for side in SIDES] for part in ("wrist", "ankle"))
    columns = [bend(clip, side, limb) for side in SIDES for limb in ("arm", "leg")]
    for place in wrists:
        columns += [place[:, 1], place[:, 2], np.abs(place[:, 0])]
    columns += [place[:, 2] for place in ankles]
    columns += [np.linalg.norm(pair[0] - pair[1], axis=1) for pair in (wrists, ankles)]
    extent = np.ptp(clip.joints, axis=1)
    columns += [extent.prod(axis=1), clip.joint("head")[:, 1] - np.minimum(ankles[0][:, 1], ankles[1][:, 1])]
    for part in ("wrist", "ankle"):
        columns += [np.linalg.norm(clip.velocity(f"{side}_{part}"), axis=1) for side in SIDES]
    columns.append(np.linalg.norm(clip.root[:, [0, 2]], axis=1))
    effort = np.gradient(clip.velocities, axis=0) * WORDS.fps if len(clip.joints) > 1 else np.zeros_like(clip.joints)
    columns.append(np.linalg.norm(effort, axis=2).mean(axis=1))
    return np.column_stack(columns)


def values(clips: Sequence[Seen]) -> list[Int64Array]:
    """The value [T, keys] of every key in each frame of each clip."""
    found = [measured(clip) for clip in clips]
    edges = np.quantile(np.concatenate(found), np.arange(1, VALUES) / VALUES, axis=0)
    return [(rows[None] > edges[:, None]).sum(axis=0) for rows in found]


def runs(values: Int64Array, shortest: int = SHORTEST) -> tuple[int, ...]:
    """The values [T] of a key in their order, none twice in a row; one that lasts less is taken for the one before."""
    edges = [0, *(np.flatnonzero(np.diff(values)) + 1).tolist(), len(values)]
    kept: list[int] = []
    for start, stop in pairwise(edges):
        lasts = stop - start >= shortest or not kept
        if lasts and (not kept or kept[-1] != values[start]):
            kept.append(int(values[start]))
    return tuple(kept)


def counted(sequence: tuple[int, ...]) -> Float32Array:
    """[S] how often each of `SEQUENCES` is in a sequence."""
    place = {run: i for i, run in enumerate(SEQUENCES)}
    counts = np.zeros(len(SEQUENCES), dtype=np.float32)
    for length in range(1, LONGEST + 1):
        for start in range(len(sequence) - length + 1):
            counts[place[sequence[start : start + length]]] += 1
    return counts


def distances(clips: Sequence[Seen]) -> Float64Array:
    """[n, n] one less the mean share of sequences that clips have in common."""
    of_clips = values(clips)
    found = np.zeros((len(clips), len(clips)))
    for key in range(of_clips[0].shape[1]):
        counts = np.stack([counted(runs(rows[:, key])) for rows in of_clips])
        sizes = counts.sum(axis=1, dtype=np.float64)
        for i, own in enumerate(counts):
            found[i] += 1.0 - 2.0 * np.minimum(own, counts).sum(axis=1) / (sizes[i] + sizes)
    return np.asarray(found / of_clips[0].shape[1])
