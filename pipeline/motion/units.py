"""Length units of motion files, and which of them a body tells by its height."""

from __future__ import annotations

import math
from typing import Final

# Metres a unit, by the name that people give it.
UNITS: Final = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
_SPELLED: Final = {
    "metre": "m", "meter": "m", "decimetre": "dm", "decimeter": "dm", "centimetre": "cm", "centimeter": "cm",
    "millimetre": "mm", "millimeter": "mm", "inch": "in", "inche": "in", "foot": "ft", "feet": "ft",
}  # fmt: skip
CMU: Final = 0.0254 / 0.45  # of CMU's files and many made of them: inches / 0.45
# From the ankles to the head joint, metres.
MIN_HEIGHT: Final = 0.4
MAX_HEIGHT: Final = 3.0
PERSON: Final = 1.35  # of a grown person
# From a child of two years to the tallest: by a unit that a file's joint names alone suggest, a body is so tall.
_CHILD: Final = 0.65
_GIANT: Final = 2.2


def named_unit(word: str) -> float | None:
    """Metres a unit that a file calls `mm`, `Millimeters` or the like; None where it is no unit of `UNITS`."""
    name = word.strip().casefold()
    return UNITS.get(name, UNITS.get(_SPELLED.get(name.removesuffix("s"), "")))


def unit_of_height(units: float) -> float | None:
    """Metres a unit of a file in which a body is so many units tall from the ankles to the head: of `UNITS` and CMU's
    the one by which it is nearest to a grown person's height, as a ratio. None where it is no body's height by any."""
    fitting = [unit for unit in (*UNITS.values(), CMU) if is_height(units * unit)]
    return min(fitting, key=lambda unit: abs(math.log(units * unit / PERSON)), default=None)


def is_persons_height(metres: float) -> bool:
    """Whether a person, grown or not, may be as tall."""
    return _CHILD <= metres <= _GIANT


def is_height(metres: float) -> bool:
    """Whether a body, grown or not, may be as tall."""
    return MIN_HEIGHT <= metres <= MAX_HEIGHT
