"""Recipes of descriptor networks: sizes, training and objective."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final, Literal

from motionlake.deephums.batches import NO_AUGMENTATION, Augmentation
from motionlake.deephums.config import DescriptorsConfig

Objective = Literal["contrast", "pairs"]


CONVOLUTIONS: Final = ((5, 1), (5, 2), (3, 2))


@dataclass(frozen=True)
class DescriptorRecipe:
    """Sizes, training and objective of a descriptor network.

    Attributes:
        encoders: each makes an equal part of the descriptor: "sketch", "neighbourhood" (both learn without gradients),
            "lstm" (the thesis's), or of `READINGS` what a network of convolutions and a GRU reads.
        convolutions: width and stride of each.
        frames: every clip is brought to so many; 0 leaves clips as they are, at 30 frames a second.
        paced: how much these keep pace with what moves, not with time (`batches.resampled`).
        hidden: width of the encoder.
        objective: "contrast": clips of a class should be the nearest of a batch; "pairs": equation 3.1 over pairs that
            are similar by motion field and motion distance.
        contrast: its weight beside cross entropy.
        temperature: of the softmax over cosines ("contrast").
        neighbours: to how many clips each is joined in the graph of a neighbourhood.
        margin, similar: m of equation 3.1, and the share of pairs that either test passes (`similar_by_motion`).
        smoothing: of the labels in cross entropy.
        speeds: adds a copy of every clip at twice the speed and one at half of it (section 3.3.2).
        augmentation: variants of clips made anew in each epoch.
    """

    encoders: tuple[str, ...] = ("moves", "joints")
    convolutions: tuple[tuple[int, int], ...] = CONVOLUTIONS
    frames: int = 48
    paced: float = 0.0
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
    neighbours: int = 6
    margin: float = 1.0
    similar: float = 0.2
    smoothing: float = 0.1
    speeds: bool = False
    augmentation: Augmentation = field(default_factory=Augmentation)


WITH_LABELS: Final = DescriptorRecipe()
WITHOUT: Final = DescriptorRecipe(encoders=("sketch", "neighbourhood"), paced=0.5, epochs=0)
# Section 3.3.2: Adam at 1e-3, batches of 128 (NTU) or 8 (HDM05), faster and slower copies. Widths, epochs, margin and
# thresholds are not given there.
THESIS: Final = DescriptorRecipe(
    encoders=("lstm",), frames=0, hidden=256, dropout=0.0, epochs=40, batch=32, learning_rate=1e-3, weight_decay=0.0,
    warm_up=False, objective="pairs", smoothing=0.0, speeds=True, augmentation=NO_AUGMENTATION,
)  # fmt: skip
# Of what is trained on other recordings than those that are searched, the sketch alone: what a network learned there
# did not carry over.
PRETRAINED: Final = DescriptorRecipe(encoders=("sketch",), paced=0.5, epochs=0)


def recipe_of(config: DescriptorsConfig, *, labels: bool = True) -> DescriptorRecipe:
    """The recipe that a configuration names, for training with labels or without."""
    recipe = THESIS if config.recipe == "deephums" else WITH_LABELS if labels else WITHOUT
    return replace(recipe, epochs=config.epochs) if config.epochs and recipe.epochs else recipe


_FORMERLY: Final = {"conv_gru": ("moves", "joints"), "lstm": ("lstm",)}


def read_recipe(kept: Mapping[str, Any]) -> DescriptorRecipe:
    """Of a file, as `asdict` made it; of an earlier one too, which named one encoder."""
    known = {field.name for field in fields(DescriptorRecipe)}
    values = {name: value for name, value in kept.items() if name in known}
    values["encoders"] = tuple(kept["encoders"]) if "encoders" in kept else _FORMERLY[kept["encoder"]]
    values["convolutions"] = tuple((width, stride) for width, stride in kept.get("convolutions", CONVOLUTIONS))
    return DescriptorRecipe(**{**values, "augmentation": Augmentation(**kept["augmentation"])})
