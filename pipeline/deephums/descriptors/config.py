"""Configuration of motion descriptors."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from motionlake.ready_made import described

DIMENSION: Final = 512
RECIPES: Final = ("default", "deephums")
SUPERVISIONS: Final = ("auto", "labels", "none")


@dataclass(frozen=True)
class DescriptorsConfig:
    """Which network turns a clip into a descriptor.

    Attributes:
        recipe: "default", or "deephums", the thesis's (section 3.2).
        supervision: "none" (self-supervised: motion alone), "labels" (and the classes of labels.csv), "auto": by
            labels where two classes at least have two clips each.
        weights: what a lake without a trained network starts with: "shipped" takes the ready-made one where it fits
            this configuration, "own" trains on the lake's clips.
        seed: of training.
        epochs: of training; 0 takes the recipe's.

    Raises:
        ValueError: an unknown name, or a value out of range.
    """

    recipe: str = "default"
    supervision: str = "auto"
    weights: str = "shipped"
    seed: int = 0
    epochs: int = 0

    def __post_init__(self) -> None:
        if self.recipe not in RECIPES:
            raise ValueError(f"recipe is {self.recipe!r}, not one of {', '.join(RECIPES)}")
        if self.supervision not in SUPERVISIONS:
            raise ValueError(f"supervision is {self.supervision!r}, not one of {', '.join(SUPERVISIONS)}")
        if self.weights not in ("shipped", "own"):
            raise ValueError(f"weights is {self.weights!r}, not shipped or own")
        if self.epochs < 0:
            raise ValueError(f"epochs = {self.epochs}: cannot be negative")


FILE = Path(__file__).parent / "weights" / "descriptors.safetensors"


def about() -> dict[str, Any]:
    """What stands beside the weights: configuration, sets and sha256 of the clips; empty where there are none."""
    return described(FILE)


def fits(config: DescriptorsConfig) -> bool:
    """Whether a lake of this configuration starts with the ready-made network."""
    return config.weights == "shipped" and config.supervision != "labels" and about().get("recipe") == config.recipe
