"""Encoder-decoder after Martinez et al., On Human Motion Prediction Using Recurrent Neural Networks (CVPR 2017).

Taken over: the last state of the encoder is all that the decoder knows of the past; the decoder's first input is the
last pose given; it is trained on its own outputs and predicts steps (residual connection). Different here: LSTM for
GRU, encoder and decoder have weights of their own, poses are joints, the class prior stands beside every pose, MSE.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from bench.glogen.baseline import Network, Shape, with_prior
from bench.glogen.decoder import Decoder


class Seq2Seq(Network):
    """Encoder LSTM, last state to the decoder."""

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        self.encoder = nn.LSTM(shape.entered, shape.settings.hidden, batch_first=True)
        self.decoder = Decoder(shape)

    def loss(self, past: Tensor, future: Tensor, prior: Tensor, done: float) -> Tensor:
        return nn.functional.mse_loss(self.extend(past, prior, None), future)

    def extend(self, past: Tensor, prior: Tensor, chance: torch.Generator | None) -> Tensor:
        _, (hidden, cell) = self.encoder(with_prior(past[:, :-1], prior))
        found: Tensor = self.decoder(past[:, -1], prior, (hidden[0], cell[0]))
        return found
