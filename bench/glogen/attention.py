"""Encoder-decoder with additive attention: Bahdanau et al., Neural Machine Translation by Jointly Learning to Align
and Translate (ICLR 2015).

Taken over: a decoder step looks at all encoder states, weighted by v tanh(W s + U h) of the decoder's last state s and
each encoder state h; the weighted mean enters beside the last output. Different here: LSTMs, the encoder reads
forward only (the thesis's point is that its own reads both ways), and the decoder is the one of `Seq2Seq`.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from bench.glogen.baseline import Network, Shape, with_prior
from bench.glogen.decoder import Decoder


class AttentionSeq2Seq(Network):
    """Encoder LSTM, all states to the decoder by attention."""

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        hidden = shape.settings.hidden
        self.encoder = nn.LSTM(shape.entered, hidden, batch_first=True)
        self.of_state, self.of_past = nn.Linear(hidden, hidden), nn.Linear(hidden, hidden, bias=False)
        self.score = nn.Linear(hidden, 1, bias=False)
        self.decoder = Decoder(shape, context=hidden)

    def loss(self, past: Tensor, future: Tensor, prior: Tensor, done: float) -> Tensor:
        return nn.functional.mse_loss(self.extend(past, prior, None), future)

    def extend(self, past: Tensor, prior: Tensor, chance: torch.Generator | None) -> Tensor:
        states, (hidden, cell) = self.encoder(with_prior(past, prior))
        keys = self.of_past(states)

        def attended(state: Tensor) -> Tensor:
            weights: Tensor = self.score(torch.tanh(self.of_state(state)[:, None] + keys)).softmax(dim=1)
            found: Tensor = (weights * states).sum(dim=1)
            return found

        found: Tensor = self.decoder(past[:, -1], prior, (hidden[0], cell[0]), attended)
        return found
