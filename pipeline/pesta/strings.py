"""Strings of symbols: one query, a repository of many, and the distances between symbols, each checked once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal

import numpy as np
from motionlake.arrays import Float32Array, Int32Array, Int64Array
from motionlake.pesta.config import AlignmentConfig
from numpy.typing import ArrayLike

MAX_SYMBOLS: Final = 2**31 - 1
Boundaries = Literal["kept", "crossed", "dropped"]


@dataclass(frozen=True)
class Repository:
    """Strings of n clips one after another.

    Attributes:
        symbols: [Y] int32.
        offsets: [n + 1] int64; clip i is symbols[offsets[i] : offsets[i + 1]]. Clips may be empty.

    Raises:
        ValueError: offsets that do not rise from 0 to Y, a negative symbol.
    """

    symbols: Int32Array
    offsets: Int64Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "symbols", np.ascontiguousarray(self.symbols, dtype=np.int32))
        object.__setattr__(self, "offsets", np.ascontiguousarray(self.offsets, dtype=np.int64))
        offsets = self.offsets
        if self.symbols.ndim != 1 or offsets.ndim != 1 or not len(offsets):
            raise ValueError(f"symbols {self.symbols.shape} and offsets {offsets.shape} are no repository")
        if offsets[0] != 0 or offsets[-1] != len(self.symbols) or np.any(np.diff(offsets) < 0):
            raise ValueError(f"offsets must rise from 0 to the number of symbols, {len(self.symbols)}")
        if len(self.symbols) > MAX_SYMBOLS:
            raise ValueError(f"a repository holds at most {MAX_SYMBOLS} symbols, not {len(self.symbols)}")
        if len(self.symbols) and self.symbols.min() < 0:
            raise ValueError(f"symbol {self.symbols.min()} is not in any dictionary")

    @classmethod
    def of(cls, strings: Sequence[ArrayLike]) -> Repository:
        """The repository of some strings, in their order."""
        arrays = [np.asarray(string, dtype=np.int32).ravel() for string in strings]
        symbols = np.concatenate([np.zeros(0, dtype=np.int32), *arrays])
        return cls(symbols, np.cumsum([0, *map(len, arrays)], dtype=np.int64))

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def string(self, clip: int) -> Int32Array:
        """[c] the string of one clip."""
        return self.symbols[self.offsets[clip] : self.offsets[clip + 1]]

    def among(self, clips: Int64Array) -> Repository:
        """The repository of some clips, in their order."""
        lengths = self.lengths[clips]
        offsets = np.concatenate([[0], np.cumsum(lengths)])
        places = np.repeat(self.offsets[clips] - offsets[:-1], lengths) + np.arange(offsets[-1])
        return Repository(self.symbols[places], offsets)

    @cached_property
    def lengths(self) -> Int64Array:
        """[n] symbols of each clip."""
        return np.diff(self.offsets)

    @cached_property
    def joined(self) -> Repository:
        """The same symbols as one clip: what an alignment that crosses boundaries sees."""
        return Repository(self.symbols, np.array([0, len(self.symbols)], dtype=np.int64))

    def aligned(self, boundaries: Boundaries) -> Repository:
        """The clips, each aligned by itself ("kept"), or all as one string.

        Raises:
            ValueError: other boundaries than "kept", "crossed" and "dropped".
        """
        if boundaries not in ("kept", "crossed", "dropped"):
            raise ValueError(f"boundaries is {boundaries!r}, not kept, crossed or dropped")
        return self if boundaries == "kept" else self.joined

    @cached_property
    def by_length(self) -> Int64Array:
        """The clips that hold symbols, longest first, by index where lengths are equal."""
        order = np.argsort(-self.lengths, kind="stable")
        return order[: np.count_nonzero(self.lengths)]

    @cached_property
    def largest(self) -> int:
        """The largest symbol, -1 where there is none."""
        return int(self.symbols.max(initial=-1))


@dataclass(frozen=True)
class SymbolDistances:
    """The distances between the symbols of a dictionary, checked once for many alignments.

    Attributes:
        matrix: [m, m] float32.

    Raises:
        ValueError: distances that are not square, below zero or not finite.
    """

    matrix: Float32Array

    def __post_init__(self) -> None:
        matrix = np.ascontiguousarray(self.matrix, dtype=np.float32)
        object.__setattr__(self, "matrix", matrix)
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not len(matrix):
            raise ValueError(f"distances of symbols are [m, m], not {matrix.shape}")
        if not (matrix.min() >= 0 and matrix.max() < np.inf):
            raise ValueError("distances of symbols are finite and not below zero")

    @classmethod
    def of(cls, distances: Distances) -> SymbolDistances:
        """As they are, if they have been checked before."""
        return distances if isinstance(distances, SymbolDistances) else cls(np.asarray(distances))

    @cached_property
    def mean(self) -> float:
        """The mean distance of two different symbols; 1 where there is one symbol alone."""
        n = len(self.matrix)
        return float((self.matrix.sum(dtype=np.float64) - np.trace(self.matrix)) / (n * (n - 1))) if n > 1 else 1.0

    def scores(self, config: AlignmentConfig) -> tuple[np.float32, np.float32]:
        """In the unit of the distances: threshold and gap of "sw"; of "sta" with gaps, what a symbol costs that is left
        out of the query and of the clip."""
        if config.gaps:
            return np.float32(config.query_gap * self.mean), np.float32(config.clip_gap * self.mean)
        unit = self.mean if config.local else 1.0
        return np.float32(config.threshold * unit), np.float32(config.gap * unit)


Distances = ArrayLike | SymbolDistances


def checked(query: ArrayLike, repository: Repository, distances: Distances) -> tuple[Int32Array, SymbolDistances]:
    """The query as [X] int32, and the distances, after comparing all symbols with the dictionary.

    Raises:
        ValueError: a query that is not one row of symbols, or empty; a symbol that the dictionary does not have.
    """
    ground, symbols = SymbolDistances.of(distances), query_string(query)
    m = len(ground.matrix)
    for what, lowest, largest in (
        ("query", int(symbols.min()), int(symbols.max())),
        ("repository", 0, repository.largest),
    ):
        if lowest < 0 or largest >= m:
            wrong = lowest if lowest < 0 else largest
            raise ValueError(f"the {what} holds symbol {wrong}, but the dictionary has 0 to {m - 1}")
    return symbols, ground


def query_string(query: ArrayLike) -> Int32Array:
    """[X] int32, C-contiguous.

    Raises:
        ValueError: not one row of symbols, or none.
    """
    symbols = np.ascontiguousarray(query, dtype=np.int32)
    if symbols.ndim != 1:
        raise ValueError(f"a query is one row of symbols, not an array of shape {symbols.shape}")
    if not len(symbols):
        raise ValueError("the query is empty: it must hold at least one symbol")
    return symbols
