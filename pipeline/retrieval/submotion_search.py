"""Sub-motion search on a lake: the clips that hold a piece of motion, and where in them it lies.

The second network says in which clips (DeepHuMS, section 3.3.5). The thesis leaves open where in them; sub-sequence
dynamic time warping on the features of words says so.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from motionlake.arrays import Float32Array
from motionlake.deephums.config import SHORTEST
from motionlake.deephums.sequence import FPS, clip_sequence
from motionlake.deephums.submotions import frames_of
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.config import load_config
from motionlake.lake.frames import frame_range, read_clip
from motionlake.lake.layout import Lake
from motionlake.motion.dtw import Stretch, nearest_stretch
from motionlake.motion.features import WordConfig, word_features
from motionlake.retrieval.encode import features_of_clips, first_body
from motionlake.stages.submotions import served_network
from numpy.typing import NDArray

if TYPE_CHECKING:
    from motionlake.deephums.submotions import TrainedSubmotion


# Frames of words at the ends of a piece that smoothing and differences make unlike those of the uncut motion.
EDGE: Final = 2


@dataclass(frozen=True)
class FoundPiece:
    """One answer: a clip that holds the piece, and frames [start, stop) of it, at its own rate, that are most like it.

    Attributes:
        distance: of the piece from the nearest window of the clip, as the network sees them; answers go by it.
        cost: of aligning the piece with these frames, a matched pair of frames of words.
        start_seconds: when they start.
        seconds: how long they last.
    """

    rank: int
    clip: str
    start: int
    stop: int
    distance: float
    cost: float
    label: str | None
    dataset: str
    start_seconds: float
    seconds: float

    def as_row(self) -> dict[str, object]:
        return asdict(self)


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


class SubmotionFinder:
    """Queries to a lake by the second network; with `real`, synthetic clips are no answers.

    Raises:
        UserError: the lake has no windows to find pieces in yet.
    """

    def __init__(self, con: Connection, lake: Lake, *, real: bool = False) -> None:
        served = served_network(con)
        if served is None:
            raise UserError(f"{lake.root}: has no windows to find pieces in yet; make them with `motionlake run all`")
        self._con, self._lake, self._file = con, lake, served.file
        self._words = load_config(lake.config_file).words
        self._query = "recorded_clips_holding" if real else "clips_holding"

    def in_clip(
        self,
        clip: str,
        start: int | None,
        stop: int | None,
        k: int,
        *,
        dataset: str | None = None,
        own: bool = False,
    ) -> list[FoundPiece]:
        """The k clips nearest to frames [start, stop) of a clip of the lake, each with the frames most like these.

        Args:
            clip: its full name. It is an answer itself where windows of it do not overlap these frames.
            start, stop: at its own rate; None for its first and its last.
            k: how many at most.
            dataset: from its clips only.
            own: windows that overlap these frames count as well, and the frames themselves may be the answer.

        Raises:
            UserError: there are no such frames, they are too few, or a clip has no words yet.
        """
        row = fetch(self._con, "clip", {"clip": clip})[0]
        motion = read_clip(self._lake.path(self._lake.frames_part(row["dataset"], row["part"])), clip)
        first, last = frame_range(clip, start, stop, len(motion.positions))
        cut = slice(first, last)
        piece = piece_of(
            clip, motion.positions[cut].astype(float), motion.rotations[cut].astype(float), motion.fps, self._words,
            None if own else (clip, first, last),
        )  # fmt: skip
        return self._answers(piece, k, dataset)

    def in_file(
        self, path: Path, start: int | None, stop: int | None, k: int, *, dataset: str | None = None
    ) -> list[FoundPiece]:
        """The same for frames of a clip file (its first body), which need not be in the lake.

        Raises:
            UserError: as `in_clip`; the file cannot be read.
        """
        body, motion = first_body(self._lake, path)
        first, last = frame_range(str(path), start, stop, len(motion.positions))
        cut = slice(first, last)
        piece = piece_of(str(path), motion.positions[cut], motion.rotations[cut], body.fps, self._words)
        return self._answers(piece, k, dataset)

    @cached_property
    def _network(self) -> TrainedSubmotion:
        from motionlake.deephums.submotions import load_submotion

        return load_submotion(self._lake.path(self._file))

    def _answers(self, piece: Piece, k: int, dataset: str | None) -> list[FoundPiece]:
        clip, first, last = piece.own or (None, None, None)
        asked = {
            "descriptor": self._network.embed([piece.sequence])[0].tolist(), "k": k, "within": dataset, "clip": clip,
            "first": first, "last": last,
        }  # fmt: skip
        rows = fetch(self._con, self._query, asked)
        features = features_of_clips(self._con, self._lake, self._words, [row["clip"] for row in rows])
        return [_found(row, place(piece, row, held, self._words)) for row, held in zip(rows, features, strict=True)]


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
        UserError: it is shorter than `SHORTEST` frames at 30 a second.
    """
    count = frames_of(len(positions), fps)
    if count < SHORTEST:
        raise UserError(
            f"{name}: {len(positions)} frames of {fps:g} a second are {count} at {FPS:g}; a piece to find needs at "
            f"least {SHORTEST}; take a longer range"
        )
    try:
        return Piece(clip_sequence(positions, fps), word_features(positions, rotations, fps, config), own)
    except ValueError as error:
        raise UserError(f"{name}: {error}") from error


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


def _found(row: Mapping[str, Any], stretch: Stretch) -> FoundPiece:
    return FoundPiece(
        row["rank"], row["clip"], stretch.start, stretch.stop, row["distance"], stretch.cost, row["label"],
        row["dataset"], stretch.start / row["fps"], (stretch.stop - stretch.start) / row["fps"],
    )  # fmt: skip
