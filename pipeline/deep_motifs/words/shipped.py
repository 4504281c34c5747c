"""The word network that comes with the package; `docs/words.md` says what it was trained on and how it does."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from motionlake.deep_motifs.words.config import NetworkConfig
from motionlake.motion.features import WordConfig
from motionlake.ready_made import described

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
