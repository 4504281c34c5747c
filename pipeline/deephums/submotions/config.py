"""Configuration of the second network, which maps pieces of motion to the clips they are part of."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from motionlake.ready_made import described

RECIPES: Final = ("default", "deephums")
# Pieces are compared with long and with short windows of a clip, of at most so many frames at 30 a second. The network
# learns with the long ones.
LONGEST: Final = 150
SHORT: Final = 24
SHORTEST: Final = 8


@dataclass(frozen=True)
class SubmotionConfig:
    """How the second network is trained.

    Attributes:
        recipe: "default" or "deephums".
        weights: what a lake without a trained network starts with: "shipped" takes the ready-made one where it fits
            this configuration, "own" trains on the lake's clips.
        seed: of training.
        steps: batches.
        batch: clips of a batch.
        variants: of each clip of a batch, by other bodies ("default").
        hidden: width of the network.
        shortest, longest: a piece is between these shares of its clip.
        temperature: of the softmax over cosines ("default").

    Raises:
        ValueError: an unknown name, or a value out of range.
    """

    recipe: str = "default"
    weights: str = "shipped"
    seed: int = 0
    steps: int = 600
    batch: int = 48
    variants: int = 2
    hidden: int = 192
    shortest: float = 0.25
    longest: float = 0.6
    temperature: float = 0.05
    learning_rate: float = 2e-3

    def __post_init__(self) -> None:
        if self.recipe not in RECIPES:
            raise ValueError(f"recipe is {self.recipe!r}, not one of {', '.join(RECIPES)}")
        if self.weights not in ("shipped", "own"):
            raise ValueError(f"weights is {self.weights!r}, not shipped or own")
        if not 0 < self.shortest <= self.longest <= 1:
            raise ValueError(f"pieces of {self.shortest} to {self.longest} of a clip: shares between 0 and 1, in order")
        if (
            min(self.steps, self.batch, self.variants, self.hidden) < 1
            or min(self.temperature, self.learning_rate) <= 0
        ):
            raise ValueError("steps, batch, variants, hidden, temperature and learning_rate must be positive")


FILE = Path(__file__).parent / "weights" / "submotion.safetensors"
# What says which network it is; the rest says how it is trained.
_OF_NETWORK: Final = ("recipe", "hidden", "shortest", "longest")


def about() -> dict[str, Any]:
    """What stands beside the weights: configuration, sets and sha256 of the clips; empty where there are none."""
    return described(FILE)


def fits(config: SubmotionConfig) -> bool:
    """Whether a lake of this configuration starts with the ready-made network."""
    made = about().get("submotion", {})
    return config.weights == "shipped" and all(made.get(name) == getattr(config, name) for name in _OF_NETWORK)
