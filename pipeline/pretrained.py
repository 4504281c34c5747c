"""Pretrained weights that are installed with the code."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any


@dataclass
class Pretrained:
    """One file of weights, and the JSON file of the same name that describes their training.

    Attributes:
        file: the safetensors file.
        matches: whether weights of this description are what the given configurations ask for.
    """

    file: Path
    matches: Callable[..., bool]

    def about(self) -> dict[str, Any]:
        """The description: configuration, data sets, sha256 of the clips; empty where a file is missing."""
        return _description(self.file)

    def fits(self, *configs: Any) -> bool:
        """Whether a lake of this configuration starts with these weights instead of training its own."""
        about: Mapping[str, Any] = self.about()
        return bool(about) and self.matches(about, *configs)


@cache
def _description(weights: Path) -> dict[str, Any]:
    beside = weights.with_suffix(".json")
    if not (weights.is_file() and beside.is_file()):
        return {}
    content: dict[str, Any] = json.loads(beside.read_text(encoding="utf-8"))
    return content
