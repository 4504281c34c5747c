"""Words of clips, mirrored clips and clip files under the network and motifs that a lake serves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.deep_motifs.motifs import Motifs, assign
from motionlake.deep_motifs.query_by_example import words_within
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch, reading
from motionlake.lake.config import LakeConfig, load_config
from motionlake.lake.frames import frame_range, read_clip
from motionlake.lake.layout import Lake
from motionlake.lake.resolve import resolve_clip
from motionlake.motion.features import WordConfig, mirrored_features, native_range, windows, word_features, word_windows
from motionlake.motion.skeleton import mirrored_positions, mirrored_rotations
from motionlake.retrieval.protocol import Query
from motionlake.stages.frames import first_body
from motionlake.stages.motif_model import MOTIF_MODEL, read_motifs
from motionlake.stages.reader import LakeReader
from motionlake.stages.sources import IngestOptions
from motionlake.stages.word_network import WORD_NETWORK
from motionlake.stages.words import features_files, read_features
from numpy.typing import NDArray


@dataclass(frozen=True)
class Models:
    """The network and the motifs that a lake serves, read when first used."""

    lake: Lake
    config: LakeConfig
    network_file: str
    motifs_file: str

    @cached_property
    def vocabulary(self) -> Motifs:
        return read_motifs(self.lake.path(self.motifs_file))

    def motifs_of(self, features: Float32Array) -> NDArray[np.int32]:
        """[n] motif of each word of a clip's features [T, D]."""
        from motionlake.deep_motifs.words.network import load_network

        network = load_network(self.lake.path(self.network_file))
        return assign(network.embed(word_windows(features, self.config.words)), self.vocabulary)

    def mirrored_motifs_of(self, features: Float32Array) -> NDArray[np.int32]:
        """[n] motif of each word of the mirrored clip."""
        return self.motifs_of(mirrored_features(features, self.config.words))


@dataclass(frozen=True)
class FileWords:
    """Features [T, D] of a clip file, and the half-open frames [n, 2] of its words at its own rate."""

    features: Float32Array
    ranges: NDArray[np.int64]
    frames: int
    fps: float


def serving_models(con: Connection, lake: Lake) -> Models:
    """The models of a lake.

    Raises:
        UserError: the lake has no motifs yet.
    """
    config = load_config(lake.config_file)
    at = LakeReader(con, lake, config)
    network, model = WORD_NETWORK.fitting(at), MOTIF_MODEL.fitting(at)
    if network is None or model is None:
        raise UserError(f"{lake.root}: has no motifs yet; make them with `motionlake run all`")
    return Models(lake, config, network.file, model.file)


def features_of_clip(con: Connection, lake: Lake, config: WordConfig, clip: str) -> Float32Array:
    """[T, D] features of a clip of the lake.

    Raises:
        UserError: the lake has no words of it yet.
    """
    return features_of_clips(con, lake, config, [clip])[0]


def features_of_clips(con: Connection, lake: Lake, config: WordConfig, clips: Sequence[str]) -> list[Float32Array]:
    """[T, D] features of each of some clips of the lake, each part read once.

    Raises:
        UserError: the lake has no words of one of them yet.
    """
    parts = {clip: fetch(con, "clip", {"clip": clip})[0]["part"] for clip in clips}
    files = features_files(con, config)
    found: dict[str, Float32Array] = {}
    for part in sorted(set(parts.values())):
        file = lake.path(files[part])
        if file.exists():
            found |= {clip: features for clip, features in read_features(file) if clip in parts}
    for clip in clips:
        if clip not in found:
            raise UserError(f"{clip}: has no words yet; make them with `motionlake run all`")
    return [found[clip] for clip in clips]


def words_of_file(lake: Lake, config: WordConfig, path: Path, options: IngestOptions | None = None) -> FileWords:
    """The words of a clip file's first body.

    Raises:
        UserError: the file cannot be read.
    """
    clip, motion = first_body(lake, path, options)
    features = word_features(motion.positions, motion.rotations, clip.fps, config)
    frames = len(motion.positions)
    ranges = [native_range(int(s), clip.fps, frames, config) for s in windows(len(features), config)]
    return FileWords(features, np.array(ranges, dtype=np.int64), frames, clip.fps)


@dataclass(frozen=True)
class QueryMotion:
    """A clip that was asked for, whole: positions [F, 21, 3], rotations [F, 21, 4]; the query is frames `asked`."""

    positions: Float64Array
    rotations: Float64Array
    fps: float
    asked: tuple[int, int]

    def cut(self) -> tuple[Float64Array, Float64Array]:
        """Positions and rotations of the query alone."""
        frames = slice(*self.asked)
        return self.positions[frames], self.rotations[frames]


def query_motion(lake: Lake, query: Query, *, mirrored: bool = False) -> QueryMotion:
    """The motion of a query, or its mirror image.

    Raises:
        UserError: no such clip or file, or it has no such frames.
    """
    if isinstance(query.source, Path):
        body, motion = first_body(lake, query.source)
        fps = body.fps
        positions, rotations = motion.positions, motion.rotations
    else:
        with reading(lake) as con:
            row = fetch(con, "clip", {"clip": resolve_clip(con, query.source)})[0]
        stored = read_clip(lake.path(lake.frames_part(row["dataset"], row["part"])), row["clip"])
        positions, rotations, fps = stored.positions.astype(np.float64), stored.rotations.astype(np.float64), stored.fps
    if mirrored:
        positions = np.asarray(mirrored_positions(positions), dtype=np.float64)
        rotations = np.asarray(mirrored_rotations(rotations), dtype=np.float64)
    return QueryMotion(positions, rotations, fps, frame_range(query.name, query.start, query.stop, len(positions)))


def query_motifs(
    con: Connection, lake: Lake, query: Query, *, least: int = 1, mirrored: bool = False
) -> NDArray[np.int32]:
    """[n] motifs of the words that lie wholly within a query, or of the same words mirrored.

    Raises:
        UserError: no such clip or file, it has no such frames, no words yet, or fewer than `least` in these frames.
    """
    config = load_config(lake.config_file).words
    if isinstance(query.source, Path):
        file = words_of_file(lake, config, query.source)
        starts, stops, frames, fps = file.ranges[:, 0], file.ranges[:, 1], file.frames, file.fps
    else:
        row = fetch(con, "clip", {"clip": resolve_clip(con, query.source)})[0]
        frames, fps = row["frames"], row["fps"]
        known = fetch(con, "clip_motifs", {"clip": query.source})
        if not known:
            raise UserError(f"{query.source}: has no signature yet; make it with `motionlake run all`")
        starts, stops = (np.array([word[end] for word in known], dtype=np.int64) for end in ("start", "stop"))
    first, last = frame_range(query.name, query.start, query.stop, frames)
    chosen = words_within(starts, stops, first, last)
    if chosen.stop - chosen.start < least:
        needed = (config.length + (least - 1) * config.stride) / config.fps
        raise UserError(
            f"{query.name}: frames {first} to {last} last {(last - first) / fps:.2f} s, too short to compare; take a "
            f"range of at least {needed + 0.05:.1f} s"
        )
    if isinstance(query.source, Path):
        models = serving_models(con, lake)
        features = file.features
    elif mirrored:
        models, features = serving_models(con, lake), features_of_clip(con, lake, config, query.source)
    else:
        return np.array([word["motif"] for word in known], dtype=np.int32)[chosen]
    return (models.mirrored_motifs_of if mirrored else models.motifs_of)(features)[chosen]
