"""The descriptor network that comes with the package; `docs/descriptors.md` says what it was trained on."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

from pipeline.descriptors.config import DescriptorsConfig

FILE = Path(__file__).parent / "weights" / "descriptors.safetensors"


@cache
def described(file: Path) -> dict[str, Any]:
    """What stands beside a file of weights; empty where one of the two is missing."""
    beside = file.with_suffix(".json")
    if not (file.is_file() and beside.is_file()):
        return {}
    content: dict[str, Any] = json.loads(beside.read_text(encoding="utf-8"))
    return content


def about() -> dict[str, Any]:
    """What stands beside the weights: configuration, sets and sha256 of the clips; empty where there are none."""
    return described(FILE)


def fits(config: DescriptorsConfig) -> bool:
    """Whether a lake of this configuration starts with the ready-made network."""
    return config.weights == "shipped" and config.supervision != "labels" and about().get("recipe") == config.recipe
