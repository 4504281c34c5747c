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
from motionlake.matching.played import Ending, costs_of_before
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
        own = np.flatnonzero(database.pieces[:, 2] == target)
        recordings = np.unique(database.recordings[database.rows[target]])
        apart = _apart(database, target, own, recordings)
        if len(apart):
            costs[own] = balanced(apart, np.searchsorted(own, recordings % len(database.pieces)))
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


def _apart(database: MotionDatabase, target: int, own: Int64Array, recordings: Int64Array) -> Float64Array:
    """[Q, C] tolerances from frames of a class to its recordings and their mirror images [C], but for those of its own
    clip, as a motion is begun that goes on from the frame.
    """
    rows = database.rows[target]
    costs = RowCosts(database, [target])
    clips, pieces = np.array(database.clips), recordings % len(database.pieces)
    column = np.searchsorted(recordings, database.recordings[rows])
    found = []
    for frame in _asked(database, target, own):
        left, piece = float(database.left[frame]), database.piece_of[frame]
        ending = Ending.of(database, target, left)
        before = database.compared[max(frame - APART, database.pieces[piece, 0])]
        each = costs.of(
            target, database.compared[frame], database.pose_scales, float(database.aloft[frame]), 0, left,
            even=False, ending=ending,
        )  # fmt: skip
        each += costs_of_before(database, target, before, database.pose_scales)
        nearest = np.full(len(recordings), np.inf)
        np.minimum.at(nearest, column, each / database.tolerance)
        nearest[clips[pieces] == clips[piece]] = np.inf
        if np.isfinite(nearest).any():
            found.append(nearest)
    return np.array(found)


def _asked(database: MotionDatabase, target: int, own: Int64Array) -> Int64Array:
    """Frames from which motion of a class might go on, as many of each piece: of an action the last that is given."""
    rng = np.random.default_rng(target)
    asked = rng.permutation(own)[:ASKED]
    first, stop = database.pieces[asked, :2].T
    if database.is_action(target):
        return np.asarray(np.minimum(first + GIVEN, stop - 1) - 1)
    return np.asarray(rng.integers(first, stop - 1, size=(max(1, ASKED // len(own)), len(asked))).ravel())
