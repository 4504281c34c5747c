"""Words of clips, mirrored clips and clip files under the network and motifs that a lake serves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from motionlake.arrays import Float32Array
from motionlake.deep_motifs.motifs import Motifs, assign
from motionlake.deep_motifs.words.windows import native_range, windows, word_windows
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.config import LakeConfig, load_config
from motionlake.lake.layout import Lake
from motionlake.motion.features import WordConfig, word_features
from motionlake.motion.mirror import mirrored_features
from motionlake.stages.clip_files import first_body as first_body
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


def signature_of_motifs(con: Connection, found: NDArray[np.int32]) -> NDArray[np.float32]:
    """[K] signature of words by their motifs, weighed as those of the lake are."""
    rows = fetch(con, "weigh_motifs", {"motifs": found.tolist()})
    return np.array(rows[0]["signature"], dtype=np.float32)
