"""The descriptor network that comes with the package; `docs/descriptors.md` says what it was trained on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from motionlake.deephums.descriptors.config import DescriptorsConfig
from motionlake.ready_made import described

FILE = Path(__file__).parent / "weights" / "descriptors.safetensors"


def about() -> dict[str, Any]:
    """What stands beside the weights: configuration, sets and sha256 of the clips; empty where there are none."""
    return described(FILE)


def fits(config: DescriptorsConfig) -> bool:
    """Whether a lake of this configuration starts with the ready-made network."""
    return config.weights == "shipped" and config.supervision != "labels" and about().get("recipe") == config.recipe
