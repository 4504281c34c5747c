"""Configuration of synthesis."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from motionlake.ready_made import described

RECIPES: Final = ("default", "glogen")
WEIGHTS: Final = ("auto", "shipped", "own")


@dataclass(frozen=True)
class SynthesisConfig:
    """Which generator makes new motion.

    Attributes:
        recipe: "default", or "glogen", the thesis's (sections 4.2 and 4.3).
        seed: of training.
        epochs: of training; 0 takes the recipe's.
        weights: what a lake without a generator starts with: "own" trains one on clips of known class, "shipped" takes
            the ready-made one where it fits this configuration, "auto" does so where no clip's class is known.

    Raises:
        ValueError: an unknown name, or a value out of range.
    """

    recipe: str = "default"
    seed: int = 0
    epochs: int = 0
    weights: str = "auto"

    def __post_init__(self) -> None:
        if self.recipe not in RECIPES:
            raise ValueError(f"recipe is {self.recipe!r}, not one of {', '.join(RECIPES)}")
        if self.weights not in WEIGHTS:
            raise ValueError(f"weights is {self.weights!r}, not one of {', '.join(WEIGHTS)}")
        if self.epochs < 0:
            raise ValueError(f"epochs = {self.epochs}: cannot be negative")


FILE = Path(__file__).parent / "weights" / "generator.safetensors"


def about() -> dict[str, Any]:
    """What stands beside the weights: classes, recipe, sets and sha256 of the clips; empty where there are none."""
    return described(FILE)


def fits(config: SynthesisConfig) -> bool:
    """Whether a lake of this configuration may make motion with the ready-made generator."""
    return config.weights != "own" and not config.epochs and about().get("recipe") == config.recipe
