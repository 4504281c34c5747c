"""What a trained network has follow given poses."""

from __future__ import annotations

from typing import Final

import numpy as np
import torch
from motionlake.arrays import BoolArray, Float64Array, FloatArray, Int64Array
from motionlake.glogen.glogen.network import Ahead, Blocks
from motionlake.glogen.trajectories.motion import JOINTS_GIVEN
from motionlake.glogen.trajectories.sparse import DURATION, JOINT_COLUMNS
from torch import Tensor

# Of the mean joint on the way from foreign poses to where a class begins, at most; body lengths a second.
SPEED: Final = 1.5


def follow(
    network: Ahead | Blocks,
    given: FloatArray,
    targets: Int64Array,
    latent: FloatArray,
    anew: BoolArray | None = None,
) -> Float64Array:
    """Sparse poses that follow, within what the network has seen while training.

    Args:
        network: in evaluation mode.
        given: [B, 5, 65] sparse poses; of any class.
        targets: [B] class wanted.
        latent: [B, L] what is left to chance; zeros for what is likeliest.
        anew: [B] whether the class begins with what follows, given the end of another, or its own; not if not given.

    Returns:
        [B, 15, 65].
    """
    wanted, chance = torch.from_numpy(targets), torch.from_numpy(np.asarray(latent, dtype=np.float32))
    begins = torch.zeros(len(given), dtype=torch.bool) if anew is None else torch.from_numpy(anew)
    with torch.inference_mode():
        rows = torch.from_numpy(np.asarray(given, dtype=np.float32))
        read = network.scale(rows)
        if isinstance(network, Ahead):
            read = network.beginnings(read, wanted, begins)
        made = network.scale.within(network.scale.back(network(read, wanted, chance)))
        return led_over(made, (rows - network.scale.back(read))[:, -1]).double().numpy()


def led_over(made: Tensor, apart: Tensor) -> Tensor:
    """Sparse poses [B, n, 65] to follow poses that are `apart` [B, 65] from those they were made after.

    The first of them takes as long as the way there needs.
    """
    led = made.clone()
    way = apart[:, JOINT_COLUMNS].reshape(-1, JOINTS_GIVEN, 3).norm(dim=2).mean(dim=1)
    led[:, 0, DURATION] = torch.maximum(led[:, 0, DURATION], (way / SPEED).clamp(min=1e-6).log())
    return led
