"""The canonical frames of labelled clips, and their strings over a dictionary that need not be the lake's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int32Array
from motionlake.evaluation.clips import read_frames
from motionlake.lake.frames import Frames
from motionlake.lake.layout import Lake
from motionlake.motion.features import WordConfig, word_features
from motionlake.pesta.config import SymbolsConfig
from motionlake.pesta.dictionary import PostureDictionary
from motionlake.pesta.symbols import symbolise
from motionlake.retrieval.labelled_clips import FramedClip


@dataclass(frozen=True)
class Framed:
    """A clip's canonical frames: positions [F, 21, 3] in metres, rotations [F, 21, 4]."""

    positions: Float64Array
    rotations: Float64Array
    fps: float

    def postures(self, coding: WordConfig) -> Float32Array:
        """[T, D] the features of its postures."""
        return word_features(self.positions, self.rotations, self.fps, coding)


def read_framed(lake: Lake, clips: Sequence[FramedClip]) -> list[Framed]:
    """The frames of clips without calibration poses, in their order."""
    found = {
        clip.clip: Framed(clip.positions.astype(np.float64), clip.rotations.astype(np.float64), clip.fps)
        for clip in map(Frames.recorded, read_frames(lake, clips))
    }
    return [found[clip.clip] for clip in clips]


def coded(
    dictionary: PostureDictionary, clips: Sequence[Framed], postures: Sequence[Float32Array], reduced: SymbolsConfig
) -> list[Int32Array]:
    """The string [c] of each clip over a dictionary, from its `postures`."""
    fps = dictionary.config.fps
    return [
        symbolise(
            dictionary.encode(rows), codes_fps=fps, fps=clip.fps, n_frames=len(clip.positions), config=reduced
        ).symbols
        for rows, clip in zip(postures, clips, strict=True)
    ]  # fmt: skip
