"""Variational encoder-decoder as the thesis describes it (section 4.3.4, "VAE Seq2seq").

The encoder's last state gives mean and variance of a latent z; what enters the decoder is the pose and z together.
Kingma and Welling's bound (Auto-Encoding Variational Bayes, ICLR 2014): squared error, and divergence from N(0, 1) in
the proportion of a decoder of fixed variance. The best guess takes the mean of z.
"""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor, nn

from bench.glogen.baseline import Network, Shape, with_prior
from bench.glogen.decoder import Decoder

LATENT: Final = 32
FIRST_SPREAD: Final = -4.0  # log variance that z begins with, so that the decoder sees the encoder through the noise
VARIANCE: Final = 0.05  # of the decoder, in normalised poses: twice this times the divergence is added to the error
WARM: Final = 0.5  # share of the budget over which the divergence comes in


class VaeSeq2Seq(Network):
    """Encoder LSTM, a latent drawn from its last state to every step of the decoder."""

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        hidden = shape.settings.hidden
        self._size = shape.horizon * shape.width
        self.encoder = nn.LSTM(shape.entered, hidden, batch_first=True)
        self.moments = nn.Linear(hidden, 2 * LATENT)
        nn.init.constant_(self.moments.bias[LATENT:], FIRST_SPREAD)
        self.decoder = Decoder(shape, context=LATENT)

    def loss(self, past: Tensor, future: Tensor, prior: Tensor, done: float) -> Tensor:
        mean, spread = self._moments(past, prior)
        found = self._decode(past, prior, mean + spread.mul(0.5).exp() * torch.randn_like(mean))
        weight = 2 * VARIANCE * min(1.0, done / WARM) / self._size
        return nn.functional.mse_loss(found, future) + weight * divergence(mean, spread).mean()

    def extend(self, past: Tensor, prior: Tensor, chance: torch.Generator | None) -> Tensor:
        mean, spread = self._moments(past, prior)
        if chance is not None:
            mean = mean + spread.mul(0.5).exp() * torch.randn(mean.shape, generator=chance)
        return self._decode(past, prior, mean)

    def _moments(self, past: Tensor, prior: Tensor) -> tuple[Tensor, Tensor]:
        mean, spread = self.moments(self.encoder(with_prior(past, prior))[1][0][0]).chunk(2, dim=1)
        return mean, spread

    def _decode(self, past: Tensor, prior: Tensor, latent: Tensor) -> Tensor:
        zeros = latent.new_zeros(len(past), self.decoder.cell.hidden_size)
        found: Tensor = self.decoder(past[:, -1], prior, (zeros, zeros), lambda state: latent)
        return found


def divergence(mean: Tensor, spread: Tensor) -> Tensor:
    """[B] Kullback-Leibler divergence of normal distributions from N(0, 1); means and log variances [B, Z]."""
    return 0.5 * (mean.square() + spread.exp() - 1 - spread).sum(dim=1)
