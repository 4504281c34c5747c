"""The clustering adversarial autoencoder (PESTA, section 5.2; Makhzani et al. 2015, sections 5 and 6).

A posture x becomes a class y (m probabilities, one symbol each) and a style z (n numbers), two linear layers on one
encoder. Its code is the head of its class plus its style, heads a learned matrix [m, n], and the decoder makes the
posture again from the code. A critic pulls z toward a Gaussian. What pulls y toward one class a posture and all classes
into use is one of two terms, see `AutoencoderRecipe.classes`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, get_args

import numpy as np
import torch
from motionlake.arrays import Float32Array, Int32Array
from motionlake.training import on_threads
from torch import Tensor, nn

# Batches of exactly this many, the last one padded, so that a symbol does not depend on the postures beside it.
BATCH: Final = 512
_LEFT_OUT: Final = ("decoder.", "class_critic.", "style_critic.")  # of the file: these are needed in training alone
ClassTerm = Literal["information", "critic"]


class PostureAutoencoder(nn.Module):
    """Encoder, decoder and two critics, each with two hidden layers; the encoder's second is Tanh, all else ReLU.

    Attributes:
        mean: [D] of the postures.
        scale: [] their root mean square deviation: one for all features, whose relative size is the metric's.
        heads: [m, n].
    """

    mean: Tensor
    scale: Tensor

    def __init__(self, dimension: int, m: int, n: int, hidden: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(dimension))
        self.register_buffer("scale", torch.ones(()))
        self.heads = nn.Parameter(torch.randn(m, n))
        self.encoder = nn.Sequential(nn.Linear(dimension, hidden), nn.ReLU(), nn.Linear(hidden, hidden), nn.Tanh())
        self.to_style = nn.Linear(hidden, n)
        self.to_class = nn.Linear(hidden, m)
        self.decoder = _two_layers(n, hidden, dimension)
        self.class_critic = _two_layers(m, hidden, 1)
        self.style_critic = _two_layers(n, hidden, 1)

    def encode(self, postures: Tensor) -> tuple[Tensor, Tensor]:
        """Class probabilities y [B, m] and style z [B, n] of postures [B, D]."""
        hidden = self.encoder((postures - self.mean) / self.scale)
        return torch.softmax(self.to_class(hidden), dim=1), self.to_style(hidden)

    def code(self, classes: Tensor, style: Tensor) -> Tensor:
        """[B, n] heads of the classes plus style."""
        return classes @ self.heads + style

    def decode(self, code: Tensor) -> Tensor:
        """[B, D] postures of codes."""
        return self.decoder(code) * self.scale + self.mean  # type: ignore[no-any-return]

    def symbols(self, postures: Tensor) -> Tensor:
        """[B] the most probable class of postures [B, D]."""
        return self.encode(postures)[0].argmax(dim=1)

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


def read_autoencoder(tensors: dict[str, Tensor]) -> PostureAutoencoder:
    """The network of what `AutoencoderEncoder.tensors` gave; its decoder and critics stay untrained."""
    m, n = tensors["heads"].shape
    network = PostureAutoencoder(len(tensors["mean"]), m, n, len(tensors["encoder.0.bias"]))
    network.load_state_dict(tensors, strict=False)
    return network.eval()


@dataclass(frozen=True)
class AutoencoderEncoder:
    """Codes postures with a `PostureAutoencoder` in evaluation mode."""

    network: PostureAutoencoder

    def symbols(self, features: Float32Array) -> Int32Array:
        """[T] symbols of postures [T, D], on one thread."""
        coded = np.empty(len(features), dtype=np.int32)
        batch = np.zeros((BATCH, features.shape[1]), dtype=np.float32)
        with on_threads(1), torch.inference_mode():
            for start in range(0, len(features), BATCH):
                rows = features[start : start + BATCH]
                batch[: len(rows)] = rows
                coded[start : start + len(rows)] = self.network.symbols(torch.from_numpy(batch))[: len(rows)].numpy()
        return coded

    def tensors(self) -> dict[str, Float32Array]:
        state = self.network.state_dict()
        return {name: value.numpy() for name, value in state.items() if not name.startswith(_LEFT_OUT)}


@dataclass(frozen=True)
class AutoencoderRecipe:
    """Settings of training.

    Attributes:
        classes: what shapes the classes. "information": the mutual information of posture and class is made great, that
            is the entropy of the batch's mean class (all symbols in use), less `sharpness` times the mean entropy of a
            class (one symbol a posture). "critic", the paper's: a critic that tells classes from one-hot vectors of a
            uniform category is fooled.
        style: n, the size of z.
        hidden: units of each of two layers of the encoder, the decoder and the critics.
        steps: optimiser steps at most; 0 counts `epochs` in their place.
        epochs: times that every training posture is seen, where `steps` is 0.
        batch: postures of a step.
        learning_rate: of Adam.
        momentum: of Adam (its first beta).
        clip: the norm that gradients of the autoencoder and of the critics are each cut to.
        class_weight: of the term of the classes, beside 1 for making the posture again.
        sharpness: see `classes`.
        style_weight: of fooling the critic of z.
        from_head: weight of making the posture again from the head of its class alone.
        validation: share of the clips that is kept out of training, to validate on.
        by_posture: postures are kept out in their place, as the paper does; neighbours in time are then trained on.
        every: steps from one validation to the next.
        patience: training ends after so many validations without a lower loss, with what had the lowest; 0: never.
    """

    classes: ClassTerm = "information"
    style: int = 24
    hidden: int = 256
    steps: int = 20_000
    epochs: int = 0
    batch: int = 256
    learning_rate: float = 1e-3
    momentum: float = 0.9
    clip: float = 5.0
    class_weight: float = 0.3
    sharpness: float = 0.3
    style_weight: float = 0.1
    from_head: float = 1.0
    validation: float = 0.25
    by_posture: bool = False
    every: int = 250
    patience: int = 5

    def __post_init__(self) -> None:
        if self.classes not in get_args(ClassTerm):
            raise ValueError(f"classes by {self.classes!r}, not one of {', '.join(get_args(ClassTerm))}")

    @classmethod
    def pesta(cls) -> AutoencoderRecipe:
        """The paper's (section 5.2): 5,000 epochs, batches of 64, learning rate 1e-4, nothing but its own losses."""
        return cls(
            classes="critic", hidden=1000, steps=0, epochs=5000, batch=64, learning_rate=1e-4, momentum=0.1,
            class_weight=1.0, style_weight=1.0, from_head=0.0, by_posture=True, patience=0,
        )  # fmt: skip

    def count(self, postures: int) -> int:
        """Steps at most, with so many training postures."""
        return self.steps or self.epochs * -(-postures // self.batch)


def recipe_of(dictionary: str) -> AutoencoderRecipe:
    """The recipe of a kind of dictionary: "information" or "adversarial"."""
    return AutoencoderRecipe.pesta() if dictionary == "adversarial" else AutoencoderRecipe()
