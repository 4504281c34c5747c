"""The posture dictionary that comes with the package; `docs/postures.md` says what it was trained on."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from motionlake.pesta.postures.config import PosturesConfig
from motionlake.ready_made import described

FILE = Path(__file__).parent / "weights" / "postures-aae.safetensors"
# What shapes a training alone; frames are coded alike whatever these say.
_OF_TRAINING = ("seed", "weights", "max_postures")


def about() -> dict[str, Any]:
    """What stands beside the weights: configuration, sets and sha256 of the clips; empty where there are none."""
    return described(FILE)


def fits(config: PosturesConfig) -> bool:
    """Whether a lake of this configuration may be coded with the ready-made dictionary."""
    return config.weights != "own" and "postures" in about() and _coding(asdict(config)) == _coding(about()["postures"])


def _coding(config: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in config.items() if name not in _OF_TRAINING}
