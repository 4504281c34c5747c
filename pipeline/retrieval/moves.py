"""Whole clips, and ranges of them, by dynamic time warping of moves."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.deep_motifs.signatures import CorpusClip
from motionlake.errors import UserError
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.frames import frame_range
from motionlake.lake.layout import Lake
from motionlake.motion.moves import FPS, LEAST, MOST, Track
from motionlake.motion.moves_index import MovesIndex, moves_distance
from motionlake.motion.moves_windows import distances_about, nearest_place, nearest_places
from motionlake.retrieval.encode import query_motion
from motionlake.retrieval.hits import Hit, Match, clip_hit, range_hit
from motionlake.retrieval.matched import asked_frames, matched_moves
from motionlake.retrieval.protocol import ClipFilter, Finds, LakeSearcher, Query, Scope, about, not_ready
from motionlake.stages.moves import Tracks, joints_of, read_tracks

TOGETHER: Final = 512  # clips whose places are looked for at once
THREADS: Final = 2


class _Tracks(LakeSearcher):
    """What both searchers read of the lake: the clips, by name, that have tracks, and these."""

    name = "moves"

    def __init__(self, lake: Lake, some: tuple[Sequence[CorpusClip], Tracks] | None = None) -> None:
        """Of the whole lake, or of some of its clips, given what is known of them, and tracks.

        Raises:
            UserError: it has no moves yet.
        """
        super().__init__(lake)
        if some is None:
            with reading(lake) as con:
                rows = fetch(con, "clips_with_parts")
                parts = {row["clip"]: row.pop("part") for row in rows}
                self._tracks = read_tracks(lake, parts)
            clips = [CorpusClip(**row) for row in rows]
        else:
            clips, self._tracks = sorted(some[0], key=lambda clip: clip.clip), some[1]
        if not self._tracks:
            raise UserError(f"{lake.root}: has no moves yet; make them with `motionlake run all`")
        self.clips = [clip for clip in clips if clip.clip in self._tracks]
        self._clips = {clip.clip: clip for clip in self.clips}

    def _known(self, clip: str) -> Track:
        if clip not in self._tracks:
            raise not_ready(self.lake, clip, "moves")
        return self._tracks[clip]

    def _cut(self, query: Query, *, mirrored: bool = False) -> Track:
        """The track of a query, cut out of that of its clip or file."""
        if query.clip is not None and not mirrored:
            track = self._known(query.clip)
            if query.whole:
                return track
            known = self._clips[query.clip]
            start, stop = frame_range(query.name, query.start, query.stop, known.frames)
            return track.cut(*in_track(track, known.frames, start, stop))
        return track_of_motion(self.lake, query, mirrored=mirrored)


def track_of_motion(lake: Lake, query: Query, *, mirrored: bool = False) -> Track:
    """The track of a query, from the frames of its clip or file. Raises `UserError` as `query_motion`."""
    motion = query_motion(lake, query, mirrored=mirrored, rotations=False)
    with about(query.name):
        track = Track.of(joints_of(motion.positions, motion.fps))
    return track.cut(*in_track(track, len(motion.positions), *motion.asked))


def track_of(lake: Lake, query: Query, *, mirrored: bool = False) -> Track:
    """The same, from what the stage has made of a clip of the lake, of which no other is read."""
    if query.clip is None or mirrored:
        return track_of_motion(lake, query, mirrored=mirrored)
    with reading(lake) as con:
        rows = fetch(con, "clip", {"clip": query.clip})
        known = read_tracks(lake, {row["clip"]: row["part"] for row in rows})
    if query.clip not in known:
        raise not_ready(lake, query.clip, "moves")
    track, frames = known[query.clip], rows[0]["frames"]
    return track.cut(*in_track(track, frames, *frame_range(query.name, query.start, query.stop, frames)))


def in_track(track: Track, frames: int, start: int, stop: int) -> tuple[int, int]:
    """Frames [start, stop) of a clip of so many as those of its track."""
    pace = max(1, frames - 1) / (len(track.joints) - 1)
    return round(start / pace), min(len(track.joints), round((stop - 1) / pace) + 1)


class MovesSearcher(_Tracks):
    """Search by the moves of whole clips; a `Searcher`."""

    finds: Finds = "clip"

    def __init__(self, lake: Lake) -> None:
        super().__init__(lake)
        self._index = cache(self._new_index)

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        known = [self._moves(query) for query in gallery]
        found = [[moves_distance(self._moves(query), clip) for clip in known] for query in queries]
        return np.array(found, dtype=np.float64).reshape(len(queries), len(gallery))

    def nearest(self, queries: Sequence[Query], k: int, scope: Scope, *, mirrored: bool) -> list[list[Hit]]:
        chosen, index = self._index(scope.clips)
        answers = []
        for query in queries:
            if query.clip is not None:
                self._known(query.clip)
            near = index.nearest(self._moves(query, mirrored=mirrored), k + 1)
            pairs = zip(chosen[near.indices].tolist(), near.distances.tolist(), strict=True)
            hits = [clip_hit(self.clips[row], distance) for row, distance in pairs]
            answers.append([hit for hit in hits if scope.own or hit.clip != query.clip][:k])
        return answers

    def matches(self, query: Query, hits: Sequence[Hit], *, mirrored: bool) -> dict[str, Match]:
        moves, asked = self._moves(query, mirrored=mirrored), asked_frames(self.lake, query)
        return {hit.clip: matched_moves(moves, self._tracks[hit.clip].moves(), asked, self._clips[hit.clip].frames)
                for hit in hits if hit.clip in self._tracks}  # fmt: skip

    def _moves(self, query: Query, *, mirrored: bool = False) -> Float32Array:
        return self._cut(query, mirrored=mirrored).moves()

    def _new_index(self, kept: ClipFilter) -> tuple[Int64Array, MovesIndex]:
        """The rows of the clips that may be answers, and an index of them."""
        admits = kept.admission(self.lake)
        rows = np.array([row for row, clip in enumerate(self.clips) if admits(clip)], dtype=np.int64)
        return rows, MovesIndex(self._tracks.moves([self.clips[row].clip for row in rows]))


class MovesRangeSearcher(_Tracks):
    """Ranges by their moves; a `Searcher`. Each clip is an answer once, by its nearest range.

    The query may last from a third of a second to thirteen seconds.
    """

    finds: Finds = "range"

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        tracks = [self._cut(query) for query in gallery]
        found = np.full((len(queries), len(gallery)), np.inf)
        for row, query in zip(found, queries, strict=True):
            moves = self.moves(query)
            for column, track in enumerate(tracks):
                place = nearest_place(moves, track)
                row[column] = np.inf if place is None else place.distance
        return found

    def nearest(self, queries: Sequence[Query], k: int, scope: Scope, *, mirrored: bool) -> list[list[Hit]]:
        return [self._answers(query, k, scope, mirrored=mirrored)[:k] for query in queries]

    def _answers(self, query: Query, k: int, scope: Scope, *, mirrored: bool) -> list[Hit]:
        if query.clip is not None:
            self._known(query.clip)
        moves, admits = self.moves(query, mirrored=mirrored), scope.admission(self.lake)
        compared, found = self._compared(query, k, scope, mirrored=mirrored), list[Hit]()
        clips = [clip for clip in compared if admits(clip)]
        for first in range(0, len(clips), TOGETHER):
            found += self._placed(moves, clips[first : first + TOGETHER], query, own=scope.own)
        return sorted(found, key=lambda hit: (hit.distance, hit.clip))

    def _compared(self, query: Query, k: int, scope: Scope, *, mirrored: bool) -> Sequence[CorpusClip]:
        """The clips that may hold the k nearest: all."""
        return self.clips

    def _placed(self, moves: Float32Array, clips: Sequence[CorpusClip], query: Query, *, own: bool) -> list[Hit]:
        """Where in each of some clips the moves of a query lie, without those that are too short."""
        joints = [self._tracks.joints(clip.clip) for clip in clips]
        # Frames of a clip for one of its track.
        paces = [max(1, clip.frames - 1) / (len(each) - 1) for clip, each in zip(clips, joints, strict=True)]
        barred = [
            None if own or clip.clip != query.clip else _in_pace(*_asked(query, clip), pace)
            for clip, pace in zip(clips, paces, strict=True)
        ]
        places = nearest_places(moves, joints, barred, THREADS)
        found = []
        for clip, pace, none, place in zip(clips, paces, barred, places, strict=True):
            if place is None:
                continue
            start, stop = round(place.start * pace), round((place.stop - 1) * pace) + 1
            if none is not None and place.start < none[1]:
                stop = min(stop, _asked(query, clip)[0])
            found.append(range_hit(clip, start, stop, place.distance))
        return found

    def distances_about(self, moves: Float32Array, clip: str, middles: Int64Array) -> Float64Array:
        """[s] distances of `moves` from the nearest windows about some frames of a clip; infinite where it has none."""
        if clip not in self._tracks:
            return np.full(len(middles), np.inf)
        track, known = self._tracks[clip], self._clips[clip]
        pace = max(1, known.frames - 1) / (len(track.joints) - 1)
        return distances_about(moves, track, np.round(middles / pace).astype(np.int64))

    def moves(self, query: Query, *, mirrored: bool = False) -> Float32Array:
        """[m, 135] of a query. Raises `UserError` where it is too short or too long."""
        track = self._cut(query, mirrored=mirrored)
        if not LEAST <= len(track.joints) <= MOST:
            raise UserError(
                f"{query.name}: {len(track.joints) / FPS:.1f} s; ranges are found by their moves for pieces of "
                f"{LEAST / FPS:.1f} to {MOST / FPS:.0f} s; take other frames"
            )
        return track.moves()


def _asked(query: Query, clip: CorpusClip) -> tuple[int, int]:
    """The frames of its own clip that a query is."""
    return query.start or 0, clip.frames if query.stop is None else query.stop


def _in_pace(first: int, last: int, pace: float) -> tuple[int, int]:
    """The frames of a track, of which one is so many of the clip, that share any of frames [first, last)."""
    return int(np.floor(first / pace)), int(np.ceil(last / pace))
