"""The second network that comes with the package; `docs/descriptors.md` says what it was trained on."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from motionlake.deephums.submotions.config import SubmotionConfig
from motionlake.ready_made import described

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
