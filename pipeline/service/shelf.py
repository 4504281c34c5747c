"""All clips of a lake as columns in memory: what a grid shows, filters, sorts and counts, a millisecond a question."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final, TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from motionlake.arrays import BoolArray, Int64Array
from motionlake.columns import numbers
from motionlake.service.errors import ServiceError

FACETS: Final = {
    "dataset": "Dataset", "label": "Label", "subject": "Subject", "rig": "Rig", "licence": "Licence",
    "quality": "Quality", "synthetic": "Synthetic", "tags": "Tags",
}  # fmt: skip
SHOWN: Final = (
    "clip", "dataset", "label", "subject", "rig", "frames", "fps", "seconds", "quality", "licence", "synthetic",
)  # fmt: skip
BINS: Final = 20  # of a histogram
TAGS: Final = "tags"
NOTHING: Final = ""  # how an address says that a column is empty
Tags: TypeAlias = Mapping[str, Collection[str]]  # by clip


@dataclass(frozen=True)
class Filter:
    """Which clips are shown.

    Attributes:
        chosen: the values that a column may have, by facet.
        text: words that all stand in a clip's name, labels or licence.
        shortest, longest: seconds.
        among: clips that a condition in SQL is true of; None: any.
    """

    chosen: Mapping[str, Sequence[str]] = field(default_factory=dict)
    text: str = ""
    shortest: float | None = None
    longest: float | None = None
    among: frozenset[str] | None = None


@dataclass(frozen=True)
class _Coded:
    """A column as whole numbers: `codes` [n], indices of `values`."""

    codes: Int64Array
    values: list[str]


class Shelf:
    """The clips of one catalog, in the order of their names."""

    def __init__(self, rows: pa.Table, verdicts: Mapping[str, str]) -> None:
        """`rows`: of the query "shelf"; `verdicts`: by clip, of those that stage "quality" has seen."""
        names = rows.column("clip").to_pylist()
        self.rows = rows.append_column("quality", pa.array([verdicts.get(name) for name in names], pa.string()))
        self.names: list[str] = names
        self.places: dict[str, int] = {name: place for place, name in enumerate(names)}
        self._seconds = np.asarray(numbers(rows.column("seconds")), np.float64)
        self._words = rows.column("words").combine_chunks()
        self.seconds = round(float(self._seconds.sum()), 3)
        self.datasets: list[str] = sorted(set(rows.column("dataset").to_pylist()))
        self._coded = {name: self._encode(name) for name in FACETS if name != TAGS}

    def _encode(self, name: str) -> _Coded:
        column = self.rows.column(name)
        text = pc.if_else(column, "true", "false") if pa.types.is_boolean(column.type) else column
        coded = pc.fill_null(text, NOTHING).combine_chunks().dictionary_encode()
        return _Coded(np.asarray(numbers(coded.indices), np.int64), coded.dictionary.to_pylist())

    def place(self, clip: str) -> int:
        """Where a clip stands. Raises `ServiceError` where there is none of that name."""
        if clip not in self.places:
            raise ServiceError(404, f"{clip[:200]}: no such clip in the lake")
        return self.places[clip]

    def of(self, clips: Sequence[str]) -> list[dict[str, Any]]:
        """dataset, part and the like of some clips. Raises `ServiceError` as `place`."""
        return self._taken(np.array([self.place(clip) for clip in clips], np.int64), ("part", *SHOWN))

    def mask(self, given: Filter, tags: Tags, without: str | None = None) -> BoolArray:
        """[n] which clips a filter lets through; `without`: but for this facet's part of it."""
        found = np.ones(len(self.names), bool)
        for name, values in given.chosen.items():
            if values and name != without:
                found &= self._tagged(values, tags) if name == TAGS else self._having(self._coded[name], values)
        for word in given.text.lower().split():
            found &= np.asarray(pc.match_substring(self._words, word).to_numpy(zero_copy_only=False), bool)
        if given.shortest is not None and without != "length":
            found &= self._seconds >= given.shortest
        if given.longest is not None and without != "length":
            found &= self._seconds < given.longest
        if given.among is not None:
            found &= self._at(given.among)
        return found

    def _having(self, coded: _Coded, values: Sequence[str]) -> BoolArray:
        wanted = [i for i, value in enumerate(coded.values) if value in values]
        return np.asarray(np.isin(coded.codes, wanted))

    def _tagged(self, values: Sequence[str], tags: Tags) -> BoolArray:
        wanted = set(values)
        found = self._at([clip for clip, has in tags.items() if wanted & set(has)])
        return found | ~self._at(tags) if NOTHING in wanted else found

    def _at(self, clips: Collection[str]) -> BoolArray:
        found = np.zeros(len(self.names), bool)
        found[[self.places[clip] for clip in clips if clip in self.places]] = True
        return found

    def page(
        self, mask: BoolArray, tags: Tags, offset: int, limit: int, sort: str = "clip", *, descending: bool = False
    ) -> list[dict[str, Any]]:
        """Some of the clips of a mask, in the order of a column and of their names."""
        if sort not in SHOWN:
            raise ServiceError(400, f"sort: clips are sorted by {', '.join(SHOWN)}, not by {sort[:80]}")
        order = self._orders(sort, descending)
        rows = self._taken(order[mask[order]][offset : offset + limit], SHOWN)
        return [{**row, "tags": sorted(tags.get(row["clip"], ()))} for row in rows]

    def _taken(self, places: Int64Array, columns: Sequence[str]) -> list[dict[str, Any]]:
        rows: list[dict[str, Any]] = self.rows.select(list(columns)).take(pa.array(places)).to_pylist()
        return rows

    @cached_property
    def _known_orders(self) -> dict[tuple[str, bool], Int64Array]:
        return {}

    def _orders(self, column: str, descending: bool) -> Int64Array:
        key = column, descending
        if key not in self._known_orders:
            way = "descending" if descending else "ascending"
            ways = [(column, way), *([] if column == "clip" else [("clip", "ascending")])]
            found = pc.sort_indices(self.rows.select([*{column, "clip"}]), sort_keys=ways)
            self._known_orders[key] = np.asarray(numbers(found), np.int64)
        return self._known_orders[key]

    def facets(self, given: Filter, tags: Tags) -> dict[str, list[dict[str, Any]]]:
        """How many clips have each value of each column, were the filter of that column not there; most first."""
        whole = self.mask(given, tags)
        chosen = {name for name, values in given.chosen.items() if values}
        found: dict[str, list[dict[str, Any]]] = {}
        for name in FACETS:
            mask = self.mask(given, tags, name) if name in chosen else whole
            if name == TAGS:
                found[name] = self._count_tags(mask, tags)
                continue
            coded = self._coded[name]
            counts = np.bincount(coded.codes[mask], minlength=len(coded.values))
            rows = [
                {"value": coded.values[i] or None, "clips": int(counts[i])} for i in np.argsort(-counts, kind="stable")
            ]
            found[name] = [row for row in rows if row["clips"]]
        timed = given.shortest is not None or given.longest is not None
        found["length"] = self._lengths(self.mask(given, tags, "length") if timed else whole)
        return found

    def _count_tags(self, mask: BoolArray, tags: Tags) -> list[dict[str, Any]]:
        counts: dict[str, int] = {}
        for clip, has in tags.items():
            if clip in self.places and mask[self.places[clip]]:
                for tag in has:
                    counts[tag] = counts.get(tag, 0) + 1
        return [{"value": tag, "clips": counts[tag]} for tag in sorted(counts, key=lambda tag: (-counts[tag], tag))]

    def _lengths(self, mask: BoolArray) -> list[dict[str, Any]]:
        seconds = self._seconds[mask]
        if not len(seconds):
            return []
        low, high = float(seconds.min()), float(seconds.max())
        if high - low < 1e-6:
            return [{"from": low, "to": high + 1e-3, "clips": len(seconds)}]
        # Lengths of clips reach from a second to an hour: bins of a logarithm.
        edges = np.geomspace(max(low, 1e-3), high * (1 + 1e-9), BINS + 1)
        counts = np.histogram(np.maximum(seconds, edges[0]), edges)[0]
        return [
            {"from": round(float(edges[i]), 3), "to": round(float(edges[i + 1]), 3), "clips": int(counts[i])}
            for i in range(BINS)
        ]
