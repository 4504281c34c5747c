"""Actions: classes that are done once, from beginning to end (a kick), and not gone on with (a walk)."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray, Int64Array
from motionlake.motion.sides import apart_of_another

LONGEST: Final = 150  # frames that half of the recordings have at most of an action that comes to rest
RESTING: Final = 5  # last frames of a recording, in which its mean squared speed is less than this share of the class's
RESTS: Final = 0.2
# Of the frames in which joints are fastest, the share of a recording by which places lie apart at which two recordings
# are alike: of 26 actions of utd_mhad and eleven of hdm05 .02 to .10, of walks, runs and dances of four sets .21 to .35
# (by chance .33), of what guides of bandai1 do .16.
COURSE: Final = 0.13
FASTEST: Final = 0.3  # share of frames: one who stands may do so before or after


def comes_to_rest(speeds: Float64Array, pieces: Int64Array) -> bool:
    """Whether the recordings of a class are short, and most come to rest.

    Args:
        speeds: [N] mean squared speeds of the joints in all frames of a database.
        pieces: [M, 2] first frame of each recording of the class and the one after its last.
    """
    rest = np.median([speeds[stop - RESTING : stop].mean() for _, stop in pieces])
    usual = np.concatenate([speeds[start:stop] for start, stop in pieces]).mean()
    return bool(np.median(pieces[:, 1] - pieces[:, 0]) <= LONGEST and rest < RESTS * usual)


def has_a_course(
    poses: FloatArray, clips: Int64Array, places: Float64Array,
    others: FloatArray, clips_of_others: Int64Array, places_of_others: Float64Array,
) -> bool:  # fmt: skip
    """Whether poses of a class tell how much of the recording is over: where another is alike, as much of it is.

    Args:
        poses: [n, d] some poses with their velocities, of the `FASTEST`.
        clips: [n] of which clips they are.
        places: [n] at which share of these, 0 to 1.
        others: [m, d] those that they are compared with.
        clips_of_others, places_of_others: [m] likewise.
    """
    apart = apart_of_another(poses, clips, others, clips_of_others)
    there = np.isfinite(apart.min(axis=1, initial=np.inf))
    if not there.any():
        return False
    alike = places_of_others[apart[there].argmin(axis=1)]
    return bool(np.abs(places[there] - alike).mean() < COURSE)
