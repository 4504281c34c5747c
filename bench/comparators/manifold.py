"""The motion manifold of Holden, Saito, Komura and Joyce (2015): hidden units of a convolutional autoencoder.

Windows of 2.7 s (the paper's 160 frames of 60 a second are 64 of ours) go through three layers of convolution over
time, tanh and max pooling, and back; a tenth of what goes in is set to zero, and the network learns to give it back.
The paper compares motions by the distance along the manifold of what the layers make of them; here, as it too does
where that is short, by L2 between hidden units. It compares windows: two clips are as far apart as a window of one is
from the nearest of the other, on average, both ways. Trained on the clips that are measured, without labels, and
smaller than the paper's (64, 128, 256 units, all of CMU) for two cores; a new window begins every 16 frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np
import torch
from motionlake.arrays import Float32Array, Float64Array
from torch import Tensor, nn

from bench.comparators.seen import WORDS, Seen

LENGTH: Final = 64  # frames of a window; a shorter clip stays as it ends
STRIDE: Final = 16
UNITS: Final = (32, 64, 128)
WIDTH: Final = 9
LOST: Final = 0.1  # share of what goes in
STEPS: Final = 400
BATCH: Final = 32
RATE: Final = 1e-3


class Autoencoder(nn.Module):
    """Windows [n, D, LENGTH] to hidden units [n, 128, LENGTH / 8], and back."""

    def __init__(self, dimension: int) -> None:
        super().__init__()
        sizes = (dimension, *UNITS)
        down: list[nn.Module] = []
        up: list[nn.Module] = []
        for a, b in pairwise(sizes):
            down += [nn.Conv1d(a, b, WIDTH, padding="same"), nn.Tanh(), nn.MaxPool1d(2)]
            last = [nn.Tanh()] if a != dimension else []
            up = [nn.Upsample(scale_factor=2), nn.Conv1d(b, a, WIDTH, padding="same"), *last, *up]
        self.encode, self.decode = nn.Sequential(*down), nn.Sequential(*up)

    def forward(self, windows: Tensor) -> Tensor:
        hidden: Tensor = self.decode(self.encode(windows))
        return hidden


def windows(rows: Float32Array) -> Float32Array:
    """[n, D, LENGTH] windows of a clip [T, D]; the last one ends with it."""
    missing = LENGTH - len(rows)
    if missing > 0:
        rows = np.pad(rows, ((0, missing), (0, 0)), mode="edge")
    last = len(rows) - LENGTH
    starts = np.unique([*range(0, last + 1, STRIDE), last])
    return np.stack([rows[start : start + LENGTH].T for start in starts])


def scaled(clips: Sequence[Seen]) -> list[Float32Array]:
    """[T, 46] where the joints are and how the hips move, of mean 0 and deviation 1 over all frames."""
    rows = [np.hstack([clip.features[:, : WORDS.posture], clip.features[:, -4:]]) for clip in clips]
    every = np.concatenate(rows)
    mean, deviation = every.mean(axis=0), np.maximum(every.std(axis=0), 1e-4)
    return [((each - mean) / deviation).astype(np.float32) for each in rows]


def trained(parts: Sequence[Float32Array], seed: int) -> tuple[Autoencoder, float]:
    """An autoencoder of windows [n, D, LENGTH], and its mean loss over the last tenth of its steps."""
    torch.manual_seed(seed)
    every = torch.from_numpy(np.concatenate(parts))
    network = Autoencoder(every.shape[1])
    optimiser = torch.optim.Adam(network.parameters(), lr=RATE)
    losses = []
    for _ in range(STEPS):
        batch = every[torch.randint(len(every), (BATCH,))]
        loss = nn.functional.mse_loss(network(nn.functional.dropout(batch, LOST)), batch)
        optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        losses.append(float(loss.detach()))
    return network, float(np.mean(losses[-max(1, STEPS // 10) :]))


def distances(clips: Sequence[Seen], seed: int) -> tuple[Float64Array, float]:
    """[n, n] between clips, and the loss of the network."""
    torch.set_num_threads(1)
    parts = [windows(rows) for rows in scaled(clips)]
    network, loss = trained(parts, seed)
    with torch.no_grad():
        hidden = [network.encode(torch.from_numpy(part)).flatten(1) for part in parts]
        stacked = torch.cat(hidden)
        edges = np.concatenate([[0], np.cumsum([len(part) for part in hidden])])[:-1]
        found = np.empty((len(clips), len(clips)))
        for i, own in enumerate(hidden):
            nearest = np.minimum.reduceat(torch.cdist(own, stacked).numpy().astype(np.float64), edges, axis=1)
            found[i] = nearest.mean(axis=0)
    return (found + found.T) / 2, loss
