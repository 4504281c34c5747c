"""Configuration of the word network."""

from __future__ import annotations

from dataclasses import dataclass


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
