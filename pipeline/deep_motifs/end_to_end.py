"""Ranked windows of clips as answers that do not overlap and leave nothing between them out.

Windows are taken from the nearest on, as long as they overlap none before them. What lies between two answers and is
a quarter as long as a window at least is an answer of its own, as far as the windows over its middle are in the mean;
what is shorter goes to the farther of the two, so that the best ones stay as they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from motionlake.arrays import Float64Array, Int64Array
from motionlake.kernels import njit


@dataclass(frozen=True)
class Stretches:
    """[n] frames [start, stop) of clips, nearest first: by distance, clip and start."""

    clip: Int64Array
    start: Int64Array
    stop: Int64Array
    distance: Float64Array

    def sorted(self) -> Stretches:
        order = np.lexsort((self.start, self.clip, self.distance))
        return Stretches(self.clip[order], self.start[order], self.stop[order], self.distance[order])


def nearest_end_to_end(
    windows: Stretches, lengths: Int64Array, k: int, barred: tuple[int, int, int] | None = None
) -> Stretches:
    """The first k answers of `end_to_end`.

    A clip whose nearest window is farther than those of k others holds none of them, so others are not looked at.
    """
    least = np.full(len(lengths), np.inf)
    np.minimum.at(least, windows.clip, windows.distance)
    kept = np.isfinite(least)
    if k < kept.sum():
        kept &= least <= np.partition(least, k - 1)[k - 1]
    clips, among = np.flatnonzero(kept), kept[windows.clip]
    place = np.cumsum(kept) - 1
    some = Stretches(place[windows.clip[among]], windows.start[among], windows.stop[among], windows.distance[among])
    own = None if barred is None or not kept[barred[0]] else (int(place[barred[0]]), *barred[1:])
    found = end_to_end(some, lengths[clips], own)
    return Stretches(clips[found.clip[:k]], found.start[:k], found.stop[:k], found.distance[:k])


def end_to_end(windows: Stretches, lengths: Int64Array, barred: tuple[int, int, int] | None = None) -> Stretches:
    """The answers among some windows, nearest first.

    Args:
        windows: in any order; none of barred frames, and none within another.
        lengths: [clips] frames of each clip.
        barred: (clip, start, stop) frames that no answer may share.
    """
    if not len(windows.clip):
        return windows
    windows = windows.sorted()
    offsets = np.concatenate([[0], np.cumsum(lengths)])
    owner = np.full(offsets[-1], _NONE, dtype=np.int64)
    if barred is not None:
        owner[offsets[barred[0]] + barred[1] : offsets[barred[0]] + barred[2]] = _BARRED
    starts, stops = offsets[windows.clip] + windows.start, offsets[windows.clip] + windows.stop
    chosen = _apart(starts, stops, owner)
    begins, ends, distances = (values[chosen] for values in (starts, stops, windows.distance))
    least = np.zeros(len(lengths), dtype=np.int64)
    np.maximum.at(least, windows.clip, (windows.stop - windows.start + 3) // 4)
    order = np.argsort(starts, kind="stable")
    over = starts[order], stops[order], windows.distance[order]
    found = _between(offsets, least, owner, over, begins, ends, distances)
    begins, ends = (
        np.concatenate([own, gap.astype(np.int64)]) for own, gap in ((begins, found[:, 0]), (ends, found[:, 1]))
    )
    distances = np.concatenate([distances, found[:, 2]])
    clip = np.searchsorted(offsets, begins, side="right") - 1
    return Stretches(clip, begins - offsets[clip], ends - offsets[clip], distances).sorted()


_NONE = -1
_BARRED = -2


@njit(cache=True)
def _apart(starts: Int64Array, stops: Int64Array, owner: Int64Array) -> Int64Array:
    """Kernel: the windows, nearest first, that overlap none before; to `owner` [frames] it says which each is in."""
    chosen = np.empty(len(starts), dtype=np.int64)
    count = 0
    for window in range(len(starts)):
        frame = starts[window]
        while frame < stops[window] and owner[frame] == _NONE:
            frame += 1
        if frame == stops[window]:
            owner[starts[window] : stops[window]] = count
            chosen[count] = window
            count += 1
    return chosen[:count]


@njit(cache=True)
def _between(
    offsets: Int64Array, least: Int64Array, owner: Int64Array, over: tuple[Int64Array, Int64Array, Float64Array],
    begins: Int64Array, ends: Int64Array, distances: Float64Array,
) -> Float64Array:  # fmt: skip
    """Kernel: [g, 3] start, stop and distance of what is between answers and long enough; the rest lengthens them.

    Args:
        offsets: [clips + 1] of clips in the frames of all.
        least: [clips] frames of a quarter of a window.
        owner: [frames] answer that each is in.
        over: [v] starts and stops of the windows, one after the other, and their distances.
        begins, ends, distances: [n] of the answers; lengthened here.
    """
    found = []
    for clip in range(len(offsets) - 1):
        frame, end = offsets[clip], offsets[clip + 1]
        while frame < end:
            first = frame
            while frame < end and owner[frame] == _NONE:
                frame += 1
            middle = (first + frame) // 2
            before = owner[first - 1] if first > offsets[clip] else _NONE
            after = owner[frame] if frame < end else _NONE
            if frame > first:
                some = over[2][
                    np.searchsorted(over[1], middle, side="right") : np.searchsorted(over[0], middle, side="right")
                ]
                if frame - first >= least[clip] and len(some):
                    found.append((float(first), float(frame), some.mean()))
                elif before >= 0 and (after < 0 or distances[before] >= distances[after]):
                    ends[before] = frame
                elif after >= 0:
                    begins[after] = first
            frame += 1
    made = np.empty((len(found), 3))
    for i, (start, stop, distance) in enumerate(found):
        made[i, 0], made[i, 1], made[i, 2] = start, stop, distance
    return made
