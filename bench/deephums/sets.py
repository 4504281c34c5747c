"""Labelled sets with their splits, as descriptor networks read them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array
from motionlake.deephums.sequence import clip_sequence
from numpy.typing import NDArray

from bench.canonical_sets import LabelledClip, load

SETS: Final = ("utd_mhad", "hdm05")


@dataclass(frozen=True)
class Split:
    """The clips of one split of a set."""

    clips: list[LabelledClip]
    sequences: list[Float32Array]

    @property
    def labels(self) -> list[str]:
        return [clip.label for clip in self.clips]

    @property
    def subjects(self) -> list[str]:
        return [clip.subject for clip in self.clips]

    def without(self, missing: NDArray[np.bool_]) -> list[Float32Array]:
        """Their sequences where joints `missing` [n, 21] are not seen."""
        return [clip_sequence(c.positions, c.fps, gone) for c, gone in zip(self.clips, missing, strict=True)]


@cache
def split_of(name: str, split: str) -> Split:
    """The clips of a set in one of its splits, in the order of its labels file."""
    clips = [clip for clip in load(name) if clip.split == split]
    return Split(clips, [clip_sequence(clip.positions, clip.fps) for clip in clips])
