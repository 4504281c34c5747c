"""Descriptors where joints are missing, motion is faster or slower, and clips are short or long (section 3.3.5)."""

from __future__ import annotations

from dataclasses import asdict
from typing import Final

import numpy as np
import torch
from motionlake.arrays import Float32Array
from motionlake.deephums.batches import resampled
from motionlake.deephums.network import TrainedDescriptor
from motionlake.evaluation.ranking import Questions, score_split
from motionlake.motion.skeleton import COMMON, INDEX
from numpy.typing import NDArray

from bench.deephums.sets import Split
from bench.units import Found

MISSING: Final = 0.2
SPEEDS: Final = (0.5, 0.75, 1.5, 2.0)
FRAMES: Final = (15, 30, 60, 120, 300, 600)


def robustness(model: TrainedDescriptor, asked: Split, known: Split, seed: int) -> dict[str, Found]:
    """{row: scores} of one model.

    Joints: 3 of 15 drawn for each clip, of queries and repository alike, are missing in all frames. Speeds and
    lengths: of queries alone, whose frames are resampled in time as a faster, a slower or another camera would.
    """
    questions = Questions.of(asked.labels, known.labels)
    rng = np.random.default_rng(seed)

    def scored(queries: list[Float32Array], repository: Float32Array) -> Found:
        apart = torch.cdist(torch.from_numpy(model.embed(queries)), torch.from_numpy(repository)).numpy()
        return asdict(score_split(apart, questions))

    whole = model.embed(known.sequences)
    gaps = [missing_joints(len(split.clips), rng) for split in (asked, known)]
    rows = {"20 % of joints missing": scored(asked.without(gaps[0]), model.embed(known.without(gaps[1])))}
    for speed in SPEEDS:
        queries = [resampled(clip, max(2, round(len(clip) / speed))) for clip in asked.sequences]
        rows[f"{speed} times the speed"] = scored(queries, whole)
    for frames in FRAMES:
        rows[f"{frames} frames"] = scored([resampled(clip, frames) for clip in asked.sequences], whole)
    return rows


def missing_joints(clips: int, rng: np.random.Generator) -> NDArray[np.bool_]:
    """[clips, 21] canonical joints that are missing: a fifth of the fifteen that descriptors read."""
    gone = np.zeros((clips, len(INDEX)), dtype=bool)
    for row in gone:
        row[[INDEX[COMMON[i]] for i in rng.permutation(len(COMMON))[: round(MISSING * len(COMMON))]]] = True
    return gone
