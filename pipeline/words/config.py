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
