"""How strings are aligned."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, get_args

Method = Literal["sta", "dtw", "sw"]

METHODS: Final[tuple[Method, ...]] = get_args(Method)


@dataclass(frozen=True)
class AlignmentConfig:
    """Which alignment, and its constants.

    Attributes:
        method: "sta", strided temporal alignment (section 6); "dtw", sub-sequence dynamic time warping, which is the
            same recurrence with its three direct neighbours, stride 1; "sw", Smith-Waterman local alignment as Wu et
            al. apply it to strings of postures.
        stride: w of section 6, at least 1; "dtw" and "sw" do not look at it. The paper takes 3 for whole sequences
            and for sub-sequences by whole queries, 2 for sub-queries.
        threshold: "sw" alone: two symbols are alike by (threshold - distance), in units of the mean distance of two
            different symbols of the dictionary.
        gap: "sw" alone: what a symbol that is left out of either string costs, in the same unit.

    Raises:
        ValueError: a method that does not exist, a stride below 1, a threshold or gap that is not above zero.
    """

    method: Method = "sta"
    stride: int = 2
    threshold: float = 0.7
    gap: float = 0.1

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise ValueError(f"method is {self.method!r}, not one of {', '.join(METHODS)}")
        if isinstance(self.stride, bool) or not isinstance(self.stride, int) or self.stride < 1:
            raise ValueError(f"stride is {self.stride}: it is a whole number of at least 1")
        for name, value in (("threshold", self.threshold), ("gap", self.gap)):
            if not 0 < value < float("inf"):
                raise ValueError(f"{name} is {value}: it must be above zero")

    @property
    def reach(self) -> int:
        """How many columns back a cell looks: the stride, or 1."""
        return self.stride if self.method == "sta" else 1

    @property
    def local(self) -> bool:
        """Whether a match may cover a part of the query only."""
        return self.method == "sw"
