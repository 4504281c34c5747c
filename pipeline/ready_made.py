"""What comes with the package beside its code: files of weights, each with a JSON file that says what it is."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any


@cache
def described(weights: Path) -> dict[str, Any]:
    """What stands beside a file of weights; empty where one of the two is missing."""
    beside = weights.with_suffix(".json")
    if not (weights.is_file() and beside.is_file()):
        return {}
    content: dict[str, Any] = json.loads(beside.read_text(encoding="utf-8"))
    return content
