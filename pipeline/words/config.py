"""Configuration of the word network and of the search for nearest words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

EXACT_WORDS: Final = 30_000


@dataclass(frozen=True)
class NetworkConfig:
    """Which word network embeds, and how it is trained (see `pipeline.words.training`).

    Attributes:
        architecture: name of the network.
        seed: of its training.
        steps: optimiser steps.
        max_words: size of the sample of words it is trained on.
    """

    architecture: str = "conv"
    seed: int = 0
    steps: int = 500
    max_words: int = 20_000

    def seconds(self, words: int) -> float:
        """About how long training on so many words takes on one core, from timings of the default network."""
        return 0.03 * self.steps + 2e-3 * min(words, self.max_words)


@dataclass(frozen=True)
class NeighboursConfig:
    """The nearest words of every word (see `pipeline.words.neighbours`).

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
