"""Configuration of rig maps that are solved from joint trees: table [rigs] of config.toml."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

TABLE: Final = "rigs"


@dataclass(frozen=True)
class RigsConfig:
    """How sure a solved rig map must be.

    Attributes:
        least_confidence: of the hips and of every joint of the limbs but collar bones and toes; a clip with one that
            is less sure is rejected.
        sides_in_doubt: a clip whose left and right are less sure than this is noted.
    """

    least_confidence: float = 0.2
    sides_in_doubt: float = 0.8

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0 <= value <= 1:
                raise ValueError(f"{name} = {value}: must be 0 to 1")


CONFIG: Final = RigsConfig
