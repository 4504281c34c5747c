"""The generator of motion that comes with the package; `docs/synthesis.md` says what it was trained on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from motionlake.glogen.generator.config import SynthesisConfig
from motionlake.ready_made import described

FILE = Path(__file__).parent / "weights" / "generator.safetensors"


def about() -> dict[str, Any]:
    """What stands beside the weights: classes, recipe, sets and sha256 of the clips; empty where there are none."""
    return described(FILE)


def fits(config: SynthesisConfig) -> bool:
    """Whether a lake of this configuration may make motion with the ready-made generator."""
    return config.weights != "own" and not config.epochs and about().get("recipe") == config.recipe
