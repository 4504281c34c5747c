"""The clustering adversarial autoencoder (PESTA, section 5.2; Makhzani et al. 2015, sections 5 and 6).

A posture x becomes a class y (m probabilities, one symbol each) and a style z (n numbers); its code is the head of
its class plus its style, and the decoder makes the posture again from the code. One critic pulls y toward one-hot
vectors of a uniform category, another pulls z toward a Gaussian.

The paper leaves open what a cluster head is. Two forms:

- "nearest" (default): the code is computed first, h(x); y is a softmax over squared distances from the heads, z what
  is left of the code beside them. A symbol is then the head nearest to the code, so that distances between heads mean
  what they mean between postures. h is a linear map plus a network that starts at zero. A head is the mean code of
  its class, every posture weighted by its probability of being in it.
- "linear": y and z are two linear layers on the encoder, the heads a learned matrix [m, n] (Makhzani, section 6).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import torch
from motionlake.deep_motifs.words.linear import LinearConfig
from motionlake.pesta.config import PosturesConfig
from torch import Tensor, nn


class PostureAutoencoder(nn.Module):
    """Encoder, decoder and two critics, each with two hidden layers; the encoder's second is Tanh, all else ReLU.

    Attributes:
        mean: [D] of the postures.
        scale: [] their root mean square deviation: one for all features, whose relative size is the metric's.
        start: [n, D] the linear map that "nearest" codes begin as.
        spread: [] root mean square distance of a code from its head, a dimension: the unit of z.
        temperature: [] of the softmax, in squared distances.
        heads: [m, n].
    """

    mean: Tensor
    scale: Tensor
    start: Tensor
    spread: Tensor
    temperature: Tensor

    def __init__(self, dimension: int, m: int, n: int, hidden: int, form: HeadForm) -> None:
        super().__init__()
        if form not in HEAD_FORMS:
            raise ValueError(f"heads of form {form!r}, not one of {', '.join(HEAD_FORMS)}")
        self.form = form
        self.register_buffer("mean", torch.zeros(dimension))
        self.register_buffer("scale", torch.ones(()))
        self.register_buffer("start", torch.zeros(n, dimension))
        self.register_buffer("spread", torch.ones(()))
        self.register_buffer("temperature", torch.ones(()))
        self.heads = nn.Parameter(torch.randn(m, n))
        self.encoder = nn.Sequential(nn.Linear(dimension, hidden), nn.ReLU(), nn.Linear(hidden, hidden), nn.Tanh())
        self.to_code = nn.Linear(hidden, n)
        self.to_class = nn.Linear(hidden, m) if form == "linear" else None
        if form == "nearest":
            nn.init.zeros_(self.to_code.weight)
            nn.init.zeros_(self.to_code.bias)
        self.decoder = _two_layers(n, hidden, dimension)
        self.class_critic = _two_layers(m, hidden, 1)
        self.style_critic = _two_layers(n, hidden, 1)

    def encode(self, postures: Tensor) -> tuple[Tensor, Tensor]:
        """Class probabilities y [B, m] and style z [B, n] of postures [B, D]."""
        x = (postures - self.mean) / self.scale
        hidden = self.encoder(x)
        if self.to_class is not None:
            return torch.softmax(self.to_class(hidden), dim=1), self.to_code(hidden)
        code = x @ self.start.T + self.spread * self.to_code(hidden)
        classes = torch.softmax(-self.apart(code) / (2 * self.temperature), dim=1)
        return classes, (code - classes @ self.heads) / self.spread

    def code(self, classes: Tensor, style: Tensor) -> Tensor:
        """[B, n] heads of the classes plus style."""
        return classes @ self.heads + self.spread * style

    def decode(self, code: Tensor) -> Tensor:
        """[B, D] postures of codes."""
        return self.decoder(code) * self.scale + self.mean  # type: ignore[no-any-return]

    def symbols(self, postures: Tensor) -> Tensor:
        """[B] the most probable class of postures [B, D]."""
        return self.encode(postures)[0].argmax(dim=1)

    def apart(self, code: Tensor) -> Tensor:
        """[B, m] squared distances of codes [B, n] from the heads."""
        squares = code.square().sum(dim=1, keepdim=True) + self.heads.square().sum(dim=1)
        return squares - 2 * code @ self.heads.T

    def critics(self) -> list[nn.Parameter]:
        """Parameters of the two critics."""
        return [*self.class_critic.parameters(), *self.style_critic.parameters()]

    def autoencoder(self) -> list[nn.Parameter]:
        """All other parameters."""
        return [p for name, p in self.named_parameters() if "critic" not in name]


def _two_layers(inputs: int, hidden: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(inputs, hidden), nn.ReLU(), nn.Linear(hidden, hidden), nn.ReLU(), nn.Linear(hidden, outputs)
    )


HeadForm = Literal["nearest", "linear"]
HEAD_FORMS: Final = ("nearest", "linear")


@dataclass(frozen=True)
class AutoencoderRecipe:
    """Settings of training; the defaults measured best (`docs/postures.md`).

    Attributes:
        style: n, the size of z.
        hidden: units of each of two layers of the encoder, the decoder and the critics.
        heads: the form of the cluster heads (`motionlake.pesta.posture_network`).
        steps: optimiser steps; 0 counts `epochs` in their place.
        epochs: times that every training posture is seen, where `steps` is 0.
        batch: postures of a step.
        learning_rate: of Adam.
        momentum: of Adam (its first beta).
        clip: the norm that gradients of the autoencoder and of the critics are each cut to.
        adversarial: weight of fooling the critics, beside 1 for making the posture again.
        from_head: weight of making the posture again from the head of its class alone.
        softness: temperature of the classes of "nearest" heads, in mean squared distances of codes from their heads.
        validation: share of the postures that is kept out of training, to measure on.
        whitening: of the linear map that "nearest" codes start as; see `LinearConfig`.
        neighbours: nearest postures of other clips by whose differences that map is whitened.
    """

    style: int = 24
    hidden: int = 1000
    heads: HeadForm = "nearest"
    steps: int = 150
    epochs: int = 0
    batch: int = 256
    learning_rate: float = 1e-4
    momentum: float = 0.1
    clip: float = 5.0
    adversarial: float = 0.1
    from_head: float = 1.0
    softness: float = 0.75
    validation: float = 0.25
    whitening: float = 0.0
    neighbours: int = 5

    def __post_init__(self) -> None:
        if self.heads not in HEAD_FORMS:
            raise ValueError(f"heads of form {self.heads!r}, not one of {', '.join(HEAD_FORMS)}")

    @classmethod
    def pesta(cls) -> AutoencoderRecipe:
        """The paper's (section 5.2): 5,000 epochs, batches of 64, learning rate 1e-4, nothing but its own losses."""
        return cls(
            heads="linear", steps=0, epochs=5000, batch=64, learning_rate=1e-4, adversarial=1.0, from_head=0.0
        )  # fmt: skip

    @property
    def linear(self) -> LinearConfig:
        """The map that "nearest" codes start as."""
        return LinearConfig(self.style, self.whitening, self.neighbours)

    def count(self, postures: int) -> int:
        """Steps in all, with so many training postures."""
        return self.steps or self.epochs * -(-postures // self.batch)


def recipe_of(config: PosturesConfig) -> AutoencoderRecipe:
    """The recipe that a configuration names."""
    return AutoencoderRecipe.pesta() if config.recipe == "pesta" else AutoencoderRecipe()
