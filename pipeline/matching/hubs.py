"""Hubs: recordings that are near to most poses, so that most motions would begin in one of them.

In many dimensions a few rows are nearest to most others (Radovanović, Nanopoulos and Ivanović, "Hubs in Space", 2010):
of recordings those that are like all others, calm ones above all. One that is done in a manner of its own is hardly
ever begun in, and made motion is less various than what was recorded. What it costs to begin in each makes up for that
in part: by Sinkhorn's iteration with a relaxed marginal (Chizat and others, "Scaling algorithms for unbalanced optimal
transport", 2018), between frames from which motion might go on and recordings.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, Int64Array
from motionlake.matching.costs import RowCosts
from motionlake.matching.course import GIVEN
from motionlake.matching.database import APART, MotionDatabase
from motionlake.matching.played import Ending
from motionlake.matching.search import SPREAD

ASKED: Final = 256  # frames of a class that motion might go on from, at most
CHANCE: Final = SPREAD / 2  # tolerances further for which chance draws a recording e times less often
PULL: Final = 5.0  # tolerances that it costs to be begun in e times as often as usual
DRAWS: Final = 0.25  # added to how often each is begun in: few frames tell little
STEPS: Final = 60


def costs_of_beginning(database: MotionDatabase) -> Float64Array:
    """[M] tolerances that it costs to begin in each piece of a database: more of hubs, 0 in the mean of a class."""
    costs = np.zeros(len(database.pieces))
    for target in range(len(database.classes)):
        apart = apart_from_recordings(database, target)
        if len(apart):
            own = np.flatnonzero(database.pieces[:, 2] == target)
            owners = _recordings(database, target) % len(database.pieces)
            costs[own] = balanced(apart, np.searchsorted(own, owners))
    return costs


def balanced(apart: Float64Array, owners: Int64Array) -> Float64Array:
    """[P] costs by which recordings are drawn more nearly alike, 0 in the mean.

    Args:
        apart: [Q, C] tolerances from each of some frames to the nearest frame of each recording and of each mirror
            image; infinite of those that it may not draw.
        owners: [C] recordings that columns are of, 0 to P - 1.
    """
    costs = np.zeros(owners.max() + 1)
    others = np.isfinite(apart)
    usual = _by_owner(others / others.sum(axis=1, keepdims=True), owners)
    for _ in range(STEPS):
        logits = -(apart + costs[owners]) / CHANCE
        chances = np.exp(logits - logits.max(axis=1, keepdims=True))
        drawn = _by_owner(chances / chances.sum(axis=1, keepdims=True), owners)
        wanted = PULL * np.log((drawn + DRAWS) / (usual + DRAWS))
        costs += (wanted - wanted.mean() - costs) / (1 + PULL / CHANCE)
    return costs


def _by_owner(chances: Float64Array, owners: Int64Array) -> Float64Array:
    return np.asarray(np.bincount(owners, chances.sum(axis=0)))


def _recordings(database: MotionDatabase, target: int) -> Int64Array:
    """[C] the recordings of a class and their mirror images."""
    return np.unique(database.recordings[database.rows[target]])


def apart_from_recordings(database: MotionDatabase, target: int) -> Float64Array:
    """[Q, C] tolerances from the asked frames of a class to the nearest frame of each of its recordings and of each
    mirror image, as a motion is begun that goes on from the frame; infinite of those of its own clip.

    A frame that has no others is left out.
    """
    recordings, costs = _recordings(database, target), RowCosts(database, [target])
    clips, pieces = np.array(database.clips), recordings % len(database.pieces)
    column = np.searchsorted(recordings, database.recordings[database.rows[target]])
    found = []
    for frame in asked_frames(database, target):
        left, piece = float(database.left[frame]), database.piece_of[frame]
        ending = Ending.of(database, target, left)
        before = database.compared[max(frame - APART, database.pieces[piece, 0])]
        each = costs.of(
            target, database.compared[frame], database.pose_scales, float(database.aloft[frame]), 0, left,
            even=False, ending=ending, before=before,
        )  # fmt: skip
        nearest = np.full(len(recordings), np.inf)
        np.minimum.at(nearest, column, each / database.tolerance)
        nearest[clips[pieces] == clips[piece]] = np.inf
        if np.isfinite(nearest).any():
            found.append(nearest)
    return np.array(found)


def asked_frames(database: MotionDatabase, target: int) -> Int64Array:
    """Frames from which motion of a class might go on, as many of each piece: of an action the last that is given."""
    rng, own = np.random.default_rng(target), np.flatnonzero(database.pieces[:, 2] == target)
    asked = rng.permutation(own)[:ASKED]
    first, stop = database.pieces[asked, :2].T
    if database.is_action(target):
        return np.asarray(np.minimum(first + GIVEN, stop - 1) - 1)
    return np.asarray(rng.integers(first, stop - 1, size=(max(1, ASKED // len(own)), len(asked))).ravel())
