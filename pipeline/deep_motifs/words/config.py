"""Configuration of the word network and of the search for nearest words."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Literal

from motionlake.motion.features import WordConfig
from motionlake.ready_made import described

EXACT_WORDS: Final = 30_000


@dataclass(frozen=True)
class NetworkConfig:
    """Which word network embeds, and how it is trained (see `motionlake.deep_motifs.words.training`).

    Attributes:
        architecture: name of the network.
        weights: what a lake without a network starts with: "shipped" takes the ready-made weights where they fit
            the words and the architecture, "own" always trains on the lake's clips.
        seed: of its training.
        steps: optimiser steps; "linear" needs none.
        max_words: size of the sample of words it is trained on.
        reversible: words played backwards are trained to count as alike (section 6.1).

    Raises:
        ValueError: other weights, or a number below one.
    """

    architecture: str = "linear"
    weights: str = "shipped"
    seed: int = 0
    steps: int = 500
    max_words: int = 20_000
    reversible: bool = False

    def __post_init__(self) -> None:
        if self.weights not in ("shipped", "own"):
            raise ValueError(f"weights is {self.weights!r}, not shipped or own")
        if self.steps < 0 or self.max_words < 2:
            raise ValueError("a word network is trained on at least two words, for no negative number of steps")

    def seconds(self, words: int) -> float:
        """About how long training on so many words takes on one core."""
        used = min(words, self.max_words)
        return 5.0 + 3e-4 * used if self.architecture == "linear" else 0.03 * self.steps + 2e-3 * used


@dataclass(frozen=True)
class NeighboursConfig:
    """The nearest words of every word (see `motionlake.deep_motifs.words.neighbours`).

    Attributes:
        k: how many.
        method: "exact", "approximate", or "auto": exact among up to 30,000 words, approximate beyond.

    Raises:
        ValueError: k < 1, or another method.
    """

    k: int = 5
    method: str = "auto"

    def __post_init__(self) -> None:
        if self.k < 1:
            raise ValueError(f"k = {self.k}: a word has at least one nearest word")
        if self.method not in ("auto", "exact", "approximate"):
            raise ValueError(f"method is {self.method!r}, not auto, exact or approximate")

    def chosen(self, words: int) -> Literal["exact", "approximate"]:
        """The method to search so many words."""
        exact = self.method == "exact" or (self.method == "auto" and words <= EXACT_WORDS)
        return "exact" if exact else "approximate"


FILE = Path(__file__).parent / "weights" / "words-linear.safetensors"


def about() -> dict[str, Any]:
    """What stands beside the weights: words, architecture, sets and sha256 of the clips, recipe."""
    return described(FILE)


def fits(words: WordConfig, network: NetworkConfig) -> bool:
    """Whether a lake of this configuration is embedded with the ready-made weights."""
    return (
        network.weights == "shipped"
        and not network.reversible
        and (about()["words"], about()["architecture"])
        == (
            asdict(words),
            network.architecture,
        )
    )
