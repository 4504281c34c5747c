"""What of a query and of an answer is alike: which frames their alignment matches, and how far each joint is apart."""

from __future__ import annotations

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.frames import frame_range
from motionlake.lake.layout import Lake
from motionlake.motion.dtw import clip_path
from motionlake.motion.skeleton import COMMON
from motionlake.retrieval.hits import Match, PathStep
from motionlake.retrieval.protocol import Query


def asked_frames(lake: Lake, query: Query) -> tuple[int, int]:
    """The frames [start, stop) of the clip or file of a query that it asks for. Raises `UserError` as a search does."""
    if query.clip is None:
        from motionlake.retrieval.encode import query_motion

        return query_motion(lake, query).asked
    with reading(lake) as con:
        frames = fetch(con, "clip", {"clip": query.clip})[0]["frames"]
    return frame_range(query.name, query.start, query.stop, frames)


def matched_moves(query: Float32Array, clip: Float32Array, asked: tuple[int, int], frames: int) -> Match:
    """What dynamic time warping matches of the moves [n, D] of a query and [m, D] of a clip.

    Args:
        query, clip: x y z of each of the fifteen joints, once or several times over.
        asked: the frames of the query at its own rate.
        frames: of the clip at its own.
    """
    path = clip_path(query, clip)
    gaps = (query[path[:, 0]] - clip[path[:, 1]]).astype(np.float64).reshape(len(path), -1, len(COMMON), 3)
    apart = np.sqrt((gaps**2).sum(axis=(1, 3))).mean(axis=0)
    order = np.argsort(apart, kind="stable")
    of_query, of_clip = _edges(len(query), *asked), _edges(len(clip), 0, frames)
    first = np.flatnonzero(np.diff(path[:, 0], prepend=-1))
    last = np.append(first[1:], len(path)) - 1
    steps = tuple(
        PathStep(
            (int(of_query[row]), int(of_query[row + 1])),
            (int(of_clip[path[start, 1]]), int(of_clip[path[stop, 1] + 1])),
        )
        for row, (start, stop) in enumerate(zip(first.tolist(), last.tolist(), strict=True))
    )
    return Match({COMMON[joint]: float(apart[joint]) for joint in order}, steps)


def _edges(count: int, start: int, stop: int) -> Float64Array:
    """[count + 1] between which frames of [start, stop) each of so many samples from first to last lies."""
    places = np.linspace(start, stop - 1, count)
    return np.concatenate([[start], np.ceil((places[:-1] + places[1:]) / 2), [stop]])
