"""Sub-motion search on a lake: the clips that hold a piece of motion, and where in them it lies.

The sub-motion encoder says in which clips (DeepHuMS, section 3.3.5). The thesis leaves open where in them; sub-sequence
dynamic time warping on the features of words says so.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.deep_motifs.signatures import CorpusClip
from motionlake.deephums.config import SHORTEST
from motionlake.deephums.sequence import FPS, clip_sequence, frames_of, in_sequence, piece_windows
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch, reading
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.lake.settings import served_config
from motionlake.motion.dtw import Stretch, nearest_stretch
from motionlake.motion.features import WordConfig, word_features
from motionlake.retrieval.encode import features_of_clips, query_motion
from motionlake.retrieval.hits import Hit, range_hit
from motionlake.retrieval.protocol import Finds, LakeSearcher, Query, Scope, about
from motionlake.stages.submotions import KEPT, SUBMOTIONS
from motionlake.stages.windows import WINDOWS
from numpy.typing import NDArray

if TYPE_CHECKING:
    from motionlake.deephums.submotion_encoder import SubmotionEncoder
    from motionlake.retrieval.lake_shortlist import LakeShortlist
    from motionlake.retrieval.window_scan import WindowScan
    from motionlake.retrieval.window_shortlist import WindowShortlist


# Frames of words at the ends of a piece that smoothing and differences make unlike those of the uncut motion.
EDGE: Final = 2


@dataclass(frozen=True)
class Piece:
    """Frames of a motion, cut out before anything is computed from them.

    Attributes:
        sequence: [T, 15, 3] as the network reads it.
        features: [m, D] of words.
        own: the clip of the lake that it is from and its frames [first, last) there, where these are no answer.
    """

    sequence: Float32Array
    features: Float32Array
    own: tuple[str, int, int] | None = None


class SubmotionSearcher(LakeSearcher):
    """Ranges by the sub-motion encoder; a `Searcher`. Each clip is an answer once, by its nearest place.

    Args:
        lake: the lake.
        shortlist: the files of its shortlist, by whose windows clips are chosen; none: all windows are compared.
        clips: of these files, where they have been read already.

    Attributes:
        shortlist: the windows of these files, where there are any of the encoder that the lake serves.

    The distance is that of the query from the nearest window of the clip, as the encoder sees them; `cost` is that of
    aligning the query with the frames found, a matched pair of frames of words.

    Raises:
        UserError: the lake has no windows to find queries in yet.
    """

    name = "submotion"
    compares = ("submotion",)
    finds: Finds = "range"

    def __init__(self, lake: Lake, shortlist: Sequence[str] = (), clips: LakeShortlist | None = None) -> None:
        super().__init__(lake)
        with reading(lake) as con:
            served = SUBMOTIONS.served(con)
        if served is None:
            raise UserError(f"{lake.root}: has no windows to find pieces in yet; make them with `motionlake run all`")
        self._file, self._words = served.file, served_config(lake).words
        self.shortlist = _of_shortlist(lake, shortlist, clips) if shortlist else None
        self._codes = None if self.shortlist else _codes_of(lake)
        self._scan = self.shortlist or self._codes

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        known = [self._windows(query) for query in gallery]
        found = [
            [np.linalg.norm(windows - query, axis=1).min() for windows in known]
            for query in self._network.embed([self._sequence(query) for query in queries])
        ]
        return np.array(found, dtype=np.float64).reshape(len(queries), len(gallery))

    def nearest(self, queries: Sequence[Query], k: int, scope: Scope, *, mirrored: bool) -> list[list[Hit]]:
        return [self._answers(query, k, scope, mirrored) for query in queries]

    def _answers(self, query: Query, k: int, scope: Scope, mirrored: bool) -> list[Hit]:
        piece = self._piece(query, own=scope.own, mirrored=mirrored)
        descriptor = self._network.embed([piece.sequence])[0]
        without = dict(zip(("clip", "first", "last"), piece.own or (None, 0, 0), strict=True))
        with reading(self.lake) as con:
            rows = self.holding(con, descriptor, k, scope, without)
            clips = [row["clip"] for row in rows]
            known = None if self._scan is None else self._scan.known
            parts = None if known is None else known.parts_of(known.entries(clips))
            features = features_of_clips(con, self.lake, self._words, clips, parts)
        hits = []
        for row, held in zip(rows, features, strict=True):
            distance, clip = row.pop("distance"), CorpusClip(**row)
            start, stop, cost = place(piece, row, held, self._words)
            hits.append(range_hit(clip, start, stop, distance, cost=cost))
        return hits

    def holding(
        self, con: Connection, descriptor: Float32Array, k: int, scope: Scope, without: Mapping[str, Any]
    ) -> list[dict[str, Any]]:
        """The k clips that hold the windows nearest to a descriptor [512], with their distances.

        `without`: as `WindowScan.holding`.
        """
        if self._scan is not None:
            return self._scan.holding(con, descriptor, k, scope, without)
        asked = {**scope.as_parameters(con), **without, "descriptor": descriptor.tolist(), "k": k}
        return fetch(con, "clips_holding", asked)

    def rows_near(self, query: Query, count: int, scope: Scope, *, mirrored: bool) -> Int64Array:
        """The rows in the shortlist of so many clips that hold the windows nearest to a query, as its numbers tell.

        Raises:
            UserError: as `search`.
        """
        assert self.shortlist is not None
        (descriptor,) = self._network.embed([self._sequence(query, mirrored=mirrored)])
        return self.shortlist.rows_near(descriptor, count, scope)

    def clips_near(self, query: Query, count: int, scope: Scope, *, mirrored: bool) -> Collection[str] | None:
        """So many clips that hold the windows nearest to a query, as their codes tell; None where there are no codes.

        Raises:
            UserError: as `search`.
        """
        if self._codes is None:
            return None
        (descriptor,) = self._network.embed([self._sequence(query, mirrored=mirrored)])
        with reading(self.lake) as con:
            return self._codes.near(con, descriptor, count, scope, {"clip": None})

    def _sequence(self, query: Query, *, mirrored: bool = False) -> Float32Array:
        """[T, 15, 3] of a query, as the network reads it."""
        motion = query_motion(self.lake, query, mirrored=mirrored, rotations=False)
        return sequence_of(query.name, motion.cut()[0], motion.fps)

    def _piece(self, query: Query, *, own: bool = True, mirrored: bool = False) -> Piece:
        motion = query_motion(self.lake, query, mirrored=mirrored, rotations=self._words.reads_rotations)
        barred = None if own or query.clip is None else (query.clip, *motion.asked)
        return piece_of(query.name, *motion.cut(), motion.fps, self._words, barred)

    def _windows(self, query: Query) -> Float32Array:
        """[w, 512] of the windows of a clip, file or range, as the stage makes those of the lake's clips."""
        motion = query_motion(self.lake, query, rotations=False)
        positions, _ = motion.cut()
        windows = in_sequence(piece_windows(len(positions), motion.fps), len(positions), motion.fps)
        vectors = self._network.embed_windows(clip_sequence(positions, motion.fps), windows)
        return vectors.astype(KEPT).astype(np.float32)

    @cached_property
    def _network(self) -> SubmotionEncoder:
        from motionlake.deephums.submotion_encoder import load_encoder

        return load_encoder(sound(self.lake, self._file))


def _of_shortlist(lake: Lake, files: Sequence[str], clips: LakeShortlist | None) -> WindowShortlist | None:
    from motionlake.retrieval.window_shortlist import WindowShortlist  # kernels take a moment to import

    return WindowShortlist.open(lake, files, clips)


def _codes_of(lake: Lake) -> WindowScan | None:
    """The codes of all windows, which lakes of some size have."""
    with reading(lake) as con:
        if not fetch(con, "stage_has_made", {"stage": WINDOWS.name})[0]["made"]:
            return None
        from motionlake.retrieval.window_scan import WindowScan

        return WindowScan.open(lake, con)


def piece_of(
    name: str,
    positions: NDArray[np.float64],
    rotations: NDArray[np.float64],
    fps: float,
    config: WordConfig,
    own: tuple[str, int, int] | None = None,
) -> Piece:
    """A piece from its own frames alone: positions [F, 21, 3] and rotations [F, 21, 4] at a rate.

    Raises:
        UserError: as `sequence_of`.
    """
    sequence = sequence_of(name, positions, fps)
    with about(name):
        return Piece(sequence, word_features(positions, rotations, fps, config), own)


def sequence_of(name: str, positions: NDArray[np.float64], fps: float) -> Float32Array:
    """[T, 15, 3] of a piece with joints [F, 21, 3] at a rate, as the network reads it.

    Raises:
        UserError: it is shorter than `SHORTEST` frames at 30 a second.
    """
    count = frames_of(len(positions), fps)
    if count < SHORTEST:
        raise UserError(
            f"{name}: {len(positions)} frames of {fps:g} a second are {count} at {FPS:g}; a piece to find needs at "
            f"least {SHORTEST} ({SHORTEST / FPS:.1f} s); take a longer range"
        )
    with about(name):
        return clip_sequence(positions, fps)


def place(piece: Piece, row: Mapping[str, Any], features: Float32Array, config: WordConfig) -> Stretch:
    """The frames of a clip, at its own rate, that a piece aligns with at the least cost.

    Args:
        piece: its own frames are left out where it says so.
        row: of the clip: `clip`, `fps`, `frames`.
        features: [T, D] of the clip's words.
        config: of words.
    """
    ratio, count = row["fps"] / config.fps, row["frames"]
    bounds = [(0, count)]
    if piece.own and piece.own[0] == row["clip"]:
        bounds = [(0, piece.own[1]), (piece.own[2], count)]
    found = []
    for start, stop in bounds:
        first, last = (min(len(features), int(np.ceil(frame / ratio))) for frame in (start, stop))
        if first < last:
            near = nearest_stretch(piece.features, features[first:last], EDGE)
            begin = min(round((near.start + first) * ratio), stop - 1)
            end = min(round((near.stop + first) * ratio), stop)
            found.append(Stretch(max(start, begin), max(begin + 1, end), near.cost))
    return min(found, key=lambda stretch: (stretch.cost, stretch.start))
