"""Classes whose names say a side: their mirror images are of another class."""

from __future__ import annotations

import re
from typing import Final

_SIDE: Final = re.compile(r"(?<![a-z])(left|right|((counter|anti)-?)?clockwise)(?![a-z])", re.IGNORECASE)


def names_a_side(label: str) -> bool:
    """Whether a label says left, right, or which way round (turn_left, clockwise)."""
    return _SIDE.search(label) is not None
