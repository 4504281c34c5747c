"""Configuration of the word network, of the search for nearest words, and of motion graphs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Literal

from motionlake.motion.features import WordConfig
from motionlake.weights import Pretrained

EXACT_WORDS: Final = 30_000
CLOSED: Final = ("moves", "linear")  # architectures that are learned in closed form, without steps
PAPER: Final = "inception736"  # the architecture of Deep Motifs
RECIPES: Final = ("metric", "deep_motifs")
NEGATIVES: Final = ("random", "semi-hard")
ENOUGH: Final = 5_000  # words of a lake that trains its own network; the smallest lake measured held 5,644


@dataclass(frozen=True)
class NetworkConfig:
    """Which word network embeds, and how it is trained (see `motionlake.deep_motifs.words.training`).

    Attributes:
        architecture: name of the network.
        weights: what a lake without a network starts with: "pretrained" takes the pretrained weights where they fit
            the words and the architecture, "own" always trains on the lake's clips, "auto" (default) does so where the
            lake holds `ENOUGH` words: own words retrieve no worse on any set measured (`docs/words.md`).
        seed: of its training.
        steps: optimiser steps; "moves" and "linear" need none. By recipe "deep_motifs" at most so many.
        max_words: size of the sample of words it is trained on.
        reversible: words played backwards are trained to count as alike (section 6.1).
        recipe: how a network is trained that needs steps: "metric" (`words.training`), or "deep_motifs", that of the
            paper (`words.deep_motifs`), which trains "inception736" where `architecture` needs no steps.
        negatives: of recipe "deep_motifs": "random" (the paper's) or "semi-hard".

    Raises:
        ValueError: other weights, another recipe or other negatives, or a number below one.
    """

    architecture: str = "moves"
    weights: str = "auto"
    seed: int = 0
    steps: int = 500
    max_words: int = 20_000
    reversible: bool = False
    recipe: str = "metric"
    negatives: str = "random"

    def __post_init__(self) -> None:
        if self.recipe not in RECIPES:
            raise ValueError(f"recipe is {self.recipe!r}, not {' or '.join(RECIPES)}")
        if self.negatives not in NEGATIVES:
            raise ValueError(f"negatives is {self.negatives!r}, not {' or '.join(NEGATIVES)}")
        if self.weights not in ("auto", "pretrained", "own"):
            raise ValueError(f"weights is {self.weights!r}, not auto, pretrained or own")
        if self.steps < 0 or self.max_words < 2:
            raise ValueError("a word network is trained on at least two words, for no negative number of steps")

    @property
    def built(self) -> str:
        """The architecture that is trained."""
        return PAPER if self.recipe == "deep_motifs" and self.architecture in CLOSED else self.architecture


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


def _same_words(about: Mapping[str, Any], words: WordConfig, network: NetworkConfig) -> bool:
    if network.weights == "own" or network.reversible:
        return False
    return (about["words"], about["architecture"]) == (asdict(words), network.built)


PRETRAINED_WORDS: Final = Pretrained(Path(__file__).parent / "weights" / "words-moves.safetensors", _same_words)


@dataclass(frozen=True)
class TransitionsConfig:
    """Frames are those of the words (24 a second by default).

    Attributes:
        window: frames that are compared and later blended, a third of a second.
        radius: a transition has the least distance within so many frames of either clip.
        min_gap: frames between the two ends of a transition within one clip.
        per_word: transitions kept for each motion word, to different clips, the nearest ones.
        context: words of the windows whose signatures are compared: 2.5 seconds, the 12 words of section 6.4.
        proportions: clips are joined when no bone's rest offset differs by more than this share of leg plus torso.

    Raises:
        ValueError: a value out of range.
    """

    window: int = 8
    radius: int = 4
    min_gap: int = 24
    per_word: int = 2
    context: int = 25
    proportions: float = 0.02

    def __post_init__(self) -> None:
        if self.window < 2 or self.radius < 1 or self.per_word < 1 or self.context < 1:
            raise ValueError("window must be at least 2; radius, per_word and context at least 1")
        if self.min_gap < self.window or not self.proportions >= 0:
            raise ValueError("min_gap must be at least window, and proportions not negative")
