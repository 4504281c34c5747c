"""Configuration of motion descriptors and of the sub-motion encoder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from motionlake.weights import Pretrained

DIMENSION: Final = 512
_WEIGHTS: Final = Path(__file__).parent / "weights"
RECIPES: Final = ("default", "deephums")
SUPERVISIONS: Final = ("auto", "labels", "none")
SUBMOTION_KEY: Final = "submotion_network"  # of the metadata of its files


@dataclass(frozen=True)
class DescriptorsConfig:
    """Which network turns a clip into a descriptor.

    Attributes:
        recipe: "default", or "deephums", the thesis's (section 3.2).
        supervision: "none" (self-supervised: motion alone), "labels" (and the classes of labels.csv), "auto": by
            labels where two classes at least have two clips each.
        weights: what a lake without a trained network starts with: "pretrained" takes the pretrained one where it fits
            this configuration, "own" trains on the lake's clips.
        seed: of training.
        epochs: of training by gradients; 0 takes the recipe's. Without labels there are none.

    Raises:
        ValueError: an unknown name, or a value out of range.
    """

    recipe: str = "default"
    supervision: str = "auto"
    weights: str = "pretrained"
    seed: int = 0
    epochs: int = 0

    def __post_init__(self) -> None:
        if self.recipe not in RECIPES:
            raise ValueError(f"recipe is {self.recipe!r}, not one of {', '.join(RECIPES)}")
        if self.supervision not in SUPERVISIONS:
            raise ValueError(f"supervision is {self.supervision!r}, not one of {', '.join(SUPERVISIONS)}")
        if self.weights not in ("pretrained", "own"):
            raise ValueError(f"weights is {self.weights!r}, not pretrained or own")
        if self.epochs < 0:
            raise ValueError(f"epochs = {self.epochs}: cannot be negative")


def _same_descriptors(about: Mapping[str, Any], config: DescriptorsConfig) -> bool:
    return config.weights == "pretrained" and config.supervision != "labels" and about["recipe"] == config.recipe


PRETRAINED_DESCRIPTORS: Final = Pretrained(_WEIGHTS / "descriptors.safetensors", _same_descriptors)


# Pieces are compared with long and with short windows of a clip, of at most so many frames at 30 a second. The network
# learns with the long ones.
LONGEST: Final = 150
SHORT: Final = 24
SHORTEST: Final = 8


@dataclass(frozen=True)
class SubmotionConfig:
    """How the sub-motion encoder is trained.

    Attributes:
        recipe: "default" or "deephums".
        weights: what a lake without a trained network starts with: "pretrained" takes the pretrained one where it fits
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
    weights: str = "pretrained"
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
        if self.weights not in ("pretrained", "own"):
            raise ValueError(f"weights is {self.weights!r}, not pretrained or own")
        if not 0 < self.shortest <= self.longest <= 1:
            raise ValueError(f"pieces of {self.shortest} to {self.longest} of a clip: shares between 0 and 1, in order")
        counts = (self.steps, self.batch, self.variants, self.hidden)
        if min(counts) < 1 or min(self.temperature, self.learning_rate) <= 0:
            raise ValueError("steps, batch, variants, hidden, temperature and learning_rate must be positive")


def _same_submotion(about: Mapping[str, Any], config: SubmotionConfig) -> bool:
    """Whether it is the same network; the other settings say how it is trained."""
    same = (about["submotion"][name] == getattr(config, name) for name in ("recipe", "hidden", "shortest", "longest"))
    return config.weights == "pretrained" and all(same)


PRETRAINED_SUBMOTION: Final = Pretrained(_WEIGHTS / "submotion.safetensors", _same_submotion)
