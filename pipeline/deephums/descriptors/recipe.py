"""How descriptor networks are trained, by name."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final, Literal

from motionlake.deephums.descriptors.batches import Augmentation
from motionlake.deephums.descriptors.config import DescriptorsConfig

EncoderKind = Literal["conv_gru", "lstm"]
Objective = Literal["contrast", "pairs"]


@dataclass(frozen=True)
class DescriptorRecipe:
    """Sizes, training and objective of a descriptor network.

    Attributes:
        encoder: "conv_gru", or "lstm" (the thesis's).
        frames: every clip is brought to so many; 0 leaves clips as they are, at 30 frames a second.
        hidden: width of the encoder.
        objective: "contrast": near clips (by class, else by alignment) should be the nearest of a batch; "pairs":
            equation 3.1 over pairs that are similar by motion field and motion distance.
        contrast: weight of "contrast" beside cross entropy.
        temperature: of the softmax over cosines ("contrast").
        neighbours, sharpness: which clips are near without labels (`similarity.neighbourhoods`).
        margin, similar: m of equation 3.1, and the share of pairs that either test passes (`similar_by_motion`).
        smoothing: of the labels in cross entropy.
        speeds: adds a copy of every clip at twice the speed and one at half of it (section 3.3.2).
        augmentation: variants of clips made anew in each epoch.
    """

    encoder: EncoderKind = "conv_gru"
    frames: int = 48
    hidden: int = 192
    dropout: float = 0.3
    epochs: int = 120
    batch: int = 64
    learning_rate: float = 2e-3
    weight_decay: float = 0.01
    warm_up: bool = True
    objective: Objective = "contrast"
    contrast: float = 1.0
    temperature: float = 0.1
    neighbours: int = 8
    sharpness: float = 2.0
    margin: float = 1.0
    similar: float = 0.2
    smoothing: float = 0.1
    speeds: bool = False
    augmentation: Augmentation = field(default_factory=Augmentation)


NO_AUGMENTATION: Final = Augmentation(0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
_RECIPES: Final = {
    "default": DescriptorRecipe(),
    # Section 3.3.2: Adam at 1e-3, batches of 128 (NTU) or 8 (HDM05), faster and slower copies. Widths, epochs, margin
    # and thresholds are not given there.
    "deephums": DescriptorRecipe(
        encoder="lstm", frames=0, hidden=256, dropout=0.0, epochs=40, batch=32, learning_rate=1e-3, weight_decay=0.0,
        warm_up=False, objective="pairs", smoothing=0.0, speeds=True, augmentation=NO_AUGMENTATION,
    ),
}  # fmt: skip


def recipe_of(config: DescriptorsConfig) -> DescriptorRecipe:
    """The recipe that a configuration names."""
    recipe = _RECIPES[config.recipe]
    return replace(recipe, epochs=config.epochs) if config.epochs else recipe
