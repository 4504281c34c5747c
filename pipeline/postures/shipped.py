"""The posture dictionary that comes with the package; `docs/postures.md` says what it was trained on."""

from __future__ import annotations

import json
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

from pipeline.postures.config import PosturesConfig

FILE = Path(__file__).parent / "weights" / "postures-aae.safetensors"
# What shapes a training alone; frames are coded alike whatever these say.
_OF_TRAINING = ("seed", "weights", "max_postures")


@cache
def about() -> dict[str, Any]:
    """What stands beside the weights: configuration, sets and sha256 of the clips; empty where there are none."""
    described = FILE.with_suffix(".json")
    if not (FILE.is_file() and described.is_file()):
        return {}
    content: dict[str, Any] = json.loads(described.read_text(encoding="utf-8"))
    return content


def fits(config: PosturesConfig) -> bool:
    """Whether a lake of this configuration may be coded with the ready-made dictionary."""
    return config.weights != "own" and "postures" in about() and _coding(asdict(config)) == _coding(about()["postures"])


def _coding(config: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in config.items() if name not in _OF_TRAINING}
