"""Words of clips, mirrored clips and clip files under the network and motifs that a lake serves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.deep_motifs.motifs import Motifs, assign
from motionlake.deep_motifs.query_by_example import words_within
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch, reading
from motionlake.lake.frames import Frames, frame_range, from_table, stored_clip, to_table
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.lake.resolve import resolve_clip
from motionlake.lake.settings import served_config
from motionlake.motion.calibration import held, recorded_range
from motionlake.motion.features import (
    WordConfig,
    mirrored_features,
    native_ranges,
    windows,
    word_features,
    word_windows,
)
from motionlake.motion.skeleton import mirrored_positions, mirrored_rotations
from motionlake.retrieval.protocol import Query
from motionlake.stages.frames import first_body
from motionlake.stages.motif_model import MOTIF_MODEL, read_motifs
from motionlake.stages.reader import LakeReader
from motionlake.stages.word_network import WORD_NETWORK
from motionlake.stages.words import WORDS, features_of
from numpy.typing import NDArray

if TYPE_CHECKING:
    from motionlake.deep_motifs.words.network import TrainedNetwork


@dataclass(frozen=True)
class Models:
    """The network and the motifs that a lake serves, read when first used."""

    lake: Lake
    config: WordConfig
    network_file: str
    motifs_file: str

    def motifs_of(self, features: Float32Array, *, mirrored: bool = False) -> NDArray[np.int32]:
        """[n] motif of each word of a clip, or of the mirrored clip, with features [T, D]."""
        return assign(self.vectors_of(features, mirrored=mirrored), self._vocabulary)

    def vectors_of(self, features: Float32Array, *, mirrored: bool = False) -> Float32Array:
        """[n, d] vector of each word of a clip, or of the mirrored clip, with features [T, D]."""
        if mirrored:
            features = mirrored_features(features, self.config)
        return self._network.embed(word_windows(features, self.config))

    @cached_property
    def _network(self) -> TrainedNetwork:
        from motionlake.deep_motifs.words.network import load_network

        return load_network(sound(self.lake, self.network_file))

    @cached_property
    def _vocabulary(self) -> Motifs:
        return read_motifs(sound(self.lake, self.motifs_file))


@dataclass(frozen=True)
class FileWords:
    """Features [T, D] of a clip file, the half-open frames [n, 2] of its words at its own rate, and its canonical
    joints [F, 21, 3]."""

    features: Float32Array
    ranges: NDArray[np.int64]
    positions: Float64Array
    fps: float

    @property
    def frames(self) -> int:
        """F, at its own rate."""
        return len(self.positions)

    @property
    def centres(self) -> Float64Array:
        """[n] frame at the centre of each word."""
        return np.asarray((self.ranges[:, 0] + self.ranges[:, 1] - 1) / 2, dtype=np.float64)


def serving_models(con: Connection, lake: Lake) -> Models:
    """The models of a lake.

    Raises:
        UserError: the lake has no motifs yet.
    """
    config = served_config(lake)
    at = LakeReader(con, lake, config)
    network, model = WORD_NETWORK.fitting(at), MOTIF_MODEL.fitting(at)
    if network is None or model is None:
        raise UserError(f"{lake.root}: has no motifs yet; make them with `motionlake run all`")
    return Models(lake, config.words, network.file, model.file)


def features_of_clips(
    con: Connection, lake: Lake, config: WordConfig, clips: Sequence[str], parts: Mapping[str, str] | None = None
) -> list[Float32Array]:
    """[T, D] features of each of some clips of the lake, each part read once; `parts`: of each clip, where known.

    Raises:
        UserError: the lake has no words of one of them yet.
    """
    if parts is None:
        parts = {row["clip"]: row["part"] for row in fetch(con, "parts_of", {"clips": list(clips)})}
    files = WORDS.files_of(lake, parts.values(), (config,))
    found = features_of(lake, files, parts)
    for clip in clips:
        if clip not in found:
            raise UserError(f"{clip}: has no words yet; make them with `motionlake run all`")
    return [found[clip] for clip in clips]


def words_of_file(lake: Lake, config: WordConfig, path: Path) -> FileWords:
    """The words of a clip file's first body.

    Raises:
        UserError: the file cannot be read.
    """
    clip, motion = first_body(lake, path)
    kept = recorded_range(motion.positions, clip.fps)
    positions = held(motion.positions, kept)
    features = word_features(positions, held(motion.rotations, kept), clip.fps, config)
    frames = len(positions)
    ranges = native_ranges(windows(len(features), config), clip.fps, frames, config)
    return FileWords(features, ranges, positions, clip.fps)


@dataclass(frozen=True)
class QueryMotion:
    """A clip that was asked for, whole: positions [F, 21, 3], rotations [F, 21, 4] or none ([F, 0, 4]); the query is
    its frames `asked`."""

    positions: Float64Array
    rotations: Float64Array
    fps: float
    asked: tuple[int, int]

    def cut(self) -> tuple[Float64Array, Float64Array]:
        """Positions and rotations of the query alone."""
        frames = slice(*self.asked)
        return self.positions[frames], self.rotations[frames]


def query_motion(lake: Lake, query: Query, *, mirrored: bool = False, rotations: bool = True) -> QueryMotion:
    """The motion of a query, or its mirror image; a clip of the lake without rotations where none are used.

    Raises:
        UserError: no such clip or file, or it has no such frames.
    """
    if query.clip is None:
        body, motion = first_body(lake, Path(query.source))
        frames, steps = Frames(query.name, body.fps, motion.rotations, motion.positions), served_config(lake).frames
        # As the lake would keep it: a file is answered like the clip that it becomes.
        stored = from_table(query.name, to_table(frames, "", steps.position_step, steps.rotation_step))
    else:
        with reading(lake) as con:
            row = _row_of(con, query.clip)
        stored = stored_clip(lake, row, rotations=rotations)
    stored = stored.recorded()
    positions, turned, fps = stored.positions.astype(np.float64), stored.rotations.astype(np.float64), stored.fps
    if mirrored:
        positions = np.asarray(mirrored_positions(positions), dtype=np.float64)
        turned = np.asarray(mirrored_rotations(turned), dtype=np.float64) if turned.shape[1] else turned
    return QueryMotion(positions, turned, fps, frame_range(query.name, query.start, query.stop, len(positions)))


def _row_of(con: Connection, clip: str) -> dict[str, Any]:
    """What the catalog says of a clip, which is mostly named in full. Raises `UserError` as `resolve_clip`."""
    rows = fetch(con, "clip", {"clip": clip}) or fetch(con, "clip", {"clip": resolve_clip(con, clip)})
    return rows[0]


@dataclass(frozen=True)
class AskedWords:
    """The words that lie wholly within a query.

    Attributes:
        chosen: which words of its clip or file they are.
        motifs: [w] of all words of the clip; None of a file.
        features: [T, D] of the file; None of a clip of the lake.
    """

    chosen: slice
    motifs: NDArray[np.int32] | None
    features: Float32Array | None


def asked_words(con: Connection, lake: Lake, query: Query, *, least: int = 1) -> AskedWords:
    """The words of a query.

    Raises:
        UserError: no such clip or file, it has no such frames, no words yet, or fewer than `least` in these frames.
    """
    config = served_config(lake).words
    motifs = features = None
    if query.clip is None:
        file = words_of_file(lake, config, Path(query.source))
        starts, stops, frames, fps = file.ranges[:, 0], file.ranges[:, 1], file.frames, file.fps
        features = file.features
    else:
        row = _row_of(con, query.clip)
        frames, fps = row["frames"], row["fps"]
        known = fetch(con, "clip_motifs", {"clip": query.clip})
        if not known:
            raise UserError(f"{query.clip}: has no signature yet; make it with `motionlake run all`")
        starts, stops = (np.array([word[end] for word in known], dtype=np.int64) for end in ("start", "stop"))
        motifs = np.array([word["motif"] for word in known], dtype=np.int32)
    first, last = frame_range(query.name, query.start, query.stop, frames)
    chosen = words_within(starts, stops, first, last)
    if chosen.stop - chosen.start < least:
        needed = (config.length + (least - 1) * config.stride) / config.fps
        raise UserError(
            f"{query.name}: frames {first} to {last} last {(last - first) / fps:.2f} s, too short to compare; take a "
            f"range of at least {needed + 0.05:.1f} s"
        )
    return AskedWords(chosen, motifs, features)


def query_motifs(
    con: Connection, lake: Lake, query: Query, *, least: int = 1, mirrored: bool = False
) -> NDArray[np.int32]:
    """[n] motifs of the words that lie wholly within a query, or of the same words mirrored.

    Raises:
        UserError: as `asked_words`.
    """
    asked = asked_words(con, lake, query, least=least)
    if asked.motifs is not None and not mirrored:
        return asked.motifs[asked.chosen]
    features = _features_asked(con, lake, query, asked)
    return serving_models(con, lake).motifs_of(features, mirrored=mirrored)[asked.chosen]


def query_vectors(con: Connection, lake: Lake, query: Query, *, least: int = 1, mirrored: bool = False) -> Float32Array:
    """[n, d] the same words, embedded by the network that the lake serves.

    Raises:
        UserError: as `asked_words`.
    """
    asked = asked_words(con, lake, query, least=least)
    features = _features_asked(con, lake, query, asked)
    return serving_models(con, lake).vectors_of(features, mirrored=mirrored)[asked.chosen]


def _features_asked(con: Connection, lake: Lake, query: Query, asked: AskedWords) -> Float32Array:
    if asked.features is not None:
        return asked.features
    (features,) = features_of_clips(con, lake, served_config(lake).words, [query.name])
    return features
