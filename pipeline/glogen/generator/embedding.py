"""What a generator makes of real motion before anything follows: its embedding subspace (section 4.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from motionlake.arrays import Float32Array
from motionlake.glogen.generator.generator import TrainedGenerator
from motionlake.glogen.generator.training import TrainingMotion
from motionlake.glogen.generator.wishes import SHORTEST
from motionlake.glogen.trajectories.motion import FPS, body_motion
from motionlake.glogen.trajectories.sparse import WIDTH, ranges, sparse_motion
from motionlake.threads import on_threads


@dataclass(frozen=True)
class EmbeddedMotions:
    """Motions as a generator reads them.

    Attributes:
        labels: [n] their classes.
        with_class: [n, E] embeddings of their sparse poses, five by five, with the class prior, as in figure 4.7.
        alone: [n, E] without it: what the poses themselves say.
    """

    labels: list[str]
    with_class: Float32Array
    alone: Float32Array


def embed_motions(generator: TrainedGenerator, motions: Sequence[TrainingMotion]) -> EmbeddedMotions:
    """Embed motions of classes that the generator knows; of long ones the first piece; short ones are left out."""
    chosen = [motion for motion in motions if len(motion.positions) / motion.fps * FPS >= SHORTEST]
    count = generator.glogen.recipe.sparse
    rows = np.zeros((len(chosen), count, WIDTH), dtype=np.float32)
    for i, motion in enumerate(chosen):
        body = body_motion(motion.positions, motion.fps)
        rows[i] = sparse_motion(body.cut(*ranges(len(body))[0]), count).rows
    targets = torch.tensor([generator.classes.index(motion.label) for motion in chosen], dtype=torch.int64)
    with on_threads(1), torch.inference_mode():
        found = [
            generator.glogen.embedding(torch.from_numpy(rows), targets, with_class=known).numpy()
            for known in (True, False)
        ]
    return EmbeddedMotions([motion.label for motion in chosen], *found)
