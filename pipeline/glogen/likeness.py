"""How much recorded clips begin like the motion of a class, as the networks of a generator learned it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import torch
from motionlake.glogen.generator import TrainedGenerator, start_state
from motionlake.glogen.network import ParallelDecoder
from motionlake.motion.generation import SeedClip


def start_distances(generator: TrainedGenerator, seeds: Sequence[SeedClip], label: str) -> list[float]:
    """How far the first poses of clips are from where training motions of a class began.

    Args:
        generator: knows the class.
        seeds: clips, or pieces of them.
        label: the class.

    Returns:
        Distance of each, 1: nine of ten training motions are nearer; infinite of one too short to start from. All 0 of
        networks that know no beginnings.
    """
    target = generator.classes.index(label)
    index, own = generator.glogen.place(target)
    network = generator.glogen.network(index)
    if not isinstance(network, ParallelDecoder):
        return [0.0] * len(seeds)
    found = []
    for seed in seeds:
        try:
            start = start_state(seed, 0, generator.glogen.recipe.sparse, generator.cyclic[target])
        except ValueError:
            found.append(math.inf)
            continue
        with torch.inference_mode():
            rows = network.scale(torch.from_numpy(start.rows[None].astype(np.float32)))
            found.append(float(network.beginnings.distances(rows)[0, own]))
    return found
