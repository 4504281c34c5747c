"""How the clustering adversarial autoencoder is trained."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from motionlake.deep_motifs.words.linear import LinearConfig
from motionlake.pesta.postures.config import PosturesConfig

HeadForm = Literal["nearest", "linear"]
HEAD_FORMS: Final = ("nearest", "linear")


@dataclass(frozen=True)
class AutoencoderRecipe:
    """Settings of training; the defaults measured best (`docs/postures.md`).

    Attributes:
        style: n, the size of z.
        hidden: units of each of two layers of the encoder, the decoder and the critics.
        heads: the form of the cluster heads (`motionlake.pesta.postures.network`).
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


def training_seconds(config: PosturesConfig, postures: float) -> float:
    """About how long training a dictionary on so many postures takes on one core."""
    used = int(min(postures, config.max_postures))
    clusters = 2.0 + 3e-4 * used
    if config.dictionary != "aae":
        return clusters
    recipe = recipe_of(config)
    return clusters + 8e-4 * recipe.batch * recipe.count(max(used, 1))
