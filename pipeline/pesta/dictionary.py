"""Posture dictionaries: they code each frame as the symbol of the nearest posture (PESTA, section 5.2).

The clustering adversarial autoencoder (Makhzani et al. 2015, sections 5 and 6): a posture x becomes a class y (m
probabilities, one symbol each) and a style z (n numbers); its code is the head of its class plus its style, and the
decoder makes the posture again from the code. One critic pulls y toward one-hot vectors of a uniform category, another
pulls z toward a Gaussian.

The paper leaves open what a cluster head is. Two forms:

- "nearest" (default): the code is computed first, h(x); y is a softmax over squared distances from the heads, z the
  difference of the code from them. A symbol is then the head nearest to the code, so that distances between heads mean
  what they mean between postures. h is a linear map plus a network that starts at zero. A head is the mean code of
  its class, every posture weighted by its probability of being in it.
- "linear": y and z are two linear layers on the encoder, the heads a learned matrix [m, n] (Makhzani, section 6).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Literal, get_args

import numpy as np
import torch
from motionlake.arrays import Float32Array, Int32Array
from motionlake.deep_motifs.words.linear import LinearConfig
from motionlake.pesta.config import DICTIONARY_KEY, PosturesConfig
from motionlake.training import on_threads, read_network
from motionlake.weights import save_tensors
from torch import Tensor, nn

ROWS: Final = 4096  # postures that are compared with the codes at a time
# Batches of exactly this many, the last one padded, so that a symbol does not depend on the postures beside it.
BATCH: Final = 512
_LEFT_OUT: Final = ("decoder.", "class_critic.", "style_critic.")  # of the file: these are needed in training alone
HeadForm = Literal["nearest", "linear"]


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
class NearestCode:
    """The code nearest to the posture itself (L2), the first where two tie: k-means and self-organising maps.

    Attributes:
        codes: [m, D] in the space of the postures.
    """

    codes: Float32Array

    def symbols(self, features: Float32Array) -> Int32Array:
        codes = self.codes.astype(np.float64)
        half = np.einsum("md,md->m", codes, codes) / 2
        batches = [
            np.argmin(half - features[start : start + ROWS].astype(np.float64) @ codes.T, axis=1)
            for start in range(0, max(len(features), 1), ROWS)
        ]
        return np.concatenate(batches).astype(np.int32)

    def tensors(self) -> dict[str, Float32Array]:
        return {"codes": self.codes}


@dataclass(frozen=True)
class PostureDictionary:
    """A frozen dictionary of m symbols.

    Attributes:
        config: what it was trained for.
        encoder: from postures to symbols.
        codes: [m, d] cluster heads; Euclidean distances between them are the distances of symbols.
        postures: [m, D] a typical posture of each symbol, in features as `word_features` gives them.
        metrics: of its training.
    """

    config: PosturesConfig
    encoder: AutoencoderEncoder | NearestCode
    codes: Float32Array
    postures: Float32Array
    metrics: Mapping[str, Any]

    @property
    def m(self) -> int:
        return len(self.codes)

    @cached_property
    def distances(self) -> Float32Array:
        """[m, m] posture distance matrix D (section 5.2)."""
        from scipy.spatial.distance import cdist

        points = self.codes.astype(np.float64)
        return np.asarray(cdist(points, points), dtype=np.float32)

    def encode(self, features: Float32Array) -> Int32Array:
        """[T] symbols of postures [T, D], each independent of the others.

        Raises:
            ValueError: postures of another width than the dictionary was trained on.
        """
        if features.ndim != 2 or features.shape[1] != self.postures.shape[1]:
            raise ValueError(
                f"postures of shape {features.shape}, but the dictionary codes [T, {self.postures.shape[1]}]"
            )
        return self.encoder.symbols(features)

    def save(self, path: Path) -> None:
        """Write it as one safetensors file."""
        kept = {"config": asdict(self.config), "figures": dict(self.metrics)}
        tensors = {"codes": self.codes, "postures": self.postures}
        tensors |= {f"encoder.{name}": value for name, value in self.encoder.tensors().items()}
        save_tensors(path, tensors, DICTIONARY_KEY, kept)


def load_dictionary(path: Path) -> PostureDictionary:
    """Read what `PostureDictionary.save` wrote.

    Raises:
        ValueError: the file holds something else.
    """
    tensors, kept = read_network(path, DICTIONARY_KEY)
    config = PosturesConfig(**kept["config"])
    own = {name.removeprefix("encoder."): value for name, value in tensors.items() if name.startswith("encoder.")}
    encoder: AutoencoderEncoder | NearestCode
    if config.dictionary == "aae":
        n, dimension = own["start"].shape
        form: HeadForm = "linear" if "to_class.weight" in own else "nearest"
        network = PostureAutoencoder(dimension, len(own["heads"]), n, len(own["encoder.0.bias"]), form)
        network.load_state_dict(own, strict=False)  # its decoder and critics stay untrained
        encoder = AutoencoderEncoder(network.eval())
    else:
        encoder = NearestCode(own["codes"].numpy())
    return PostureDictionary(config, encoder, tensors["codes"].numpy(), tensors["postures"].numpy(), kept["figures"])


@dataclass(frozen=True)
class AutoencoderRecipe:
    """Settings of training; the defaults measured best (`docs/postures.md`).

    Attributes:
        style: n, the size of z.
        hidden: units of each of two layers of the encoder, the decoder and the critics.
        heads: the form of the cluster heads (see the module).
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
        if self.heads not in get_args(HeadForm):
            raise ValueError(f"heads of form {self.heads!r}, not one of {', '.join(get_args(HeadForm))}")

    @classmethod
    def pesta(cls) -> AutoencoderRecipe:
        """The paper's (section 5.2): 5,000 epochs, batches of 64, learning rate 1e-4, nothing but its own losses."""
        return cls(heads="linear", steps=0, epochs=5000, batch=64, adversarial=1.0, from_head=0.0)

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
