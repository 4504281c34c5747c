"""What every experiment of PESTA is about: the strings of a lake's labelled clips, and what their frames show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from motionlake.arrays import StepProgress
from motionlake.errors import UserError
from motionlake.evaluation.clips import LabelledOptions
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.lake.settings import served_config
from motionlake.lake.strings import LakeStrings
from motionlake.pesta.config import AlignmentConfig, Method
from motionlake.pesta.symbols import SymbolString
from motionlake.retrieval.alignment import AlignmentRangeSearcher
from motionlake.retrieval.labelled_clips import CodedClips
from motionlake.retrieval.protocol import Query, about
from motionlake.retrieval.string_queries import OnePostureError, StringQuery

# The paper's strides: whole clips, parts of clips.
WHOLE_STRIDE: Final = 3
PART_STRIDE: Final = 2
EACH: Final = 10  # queries of each class, at most
SEED: Final = 0
Segments = Sequence[tuple[int, int, str]]


@dataclass(frozen=True)
class Measuring:
    """A lake, and which of its clips are measured.

    Attributes:
        con, lake: the lake.
        strings: of all its clips.
        chosen: those that are measured.
        options: how they were chosen.
        stride: w of "sta"; None: the paper's.
        gaps: of "sta"; None: as config.toml says.
        progress: hears what is done, and how much of it.
    """

    con: Connection
    lake: Lake
    strings: LakeStrings
    chosen: CodedClips
    options: LabelledOptions
    stride: int | None = None
    gaps: bool | None = None
    progress: StepProgress = lambda what, done, total: None

    def alignment(self, method: Method, stride: int) -> AlignmentConfig:
        """As the lake aligns, by a method and with this stride unless another was asked for.

        Raises:
            UserError: a stride that is out of range.
        """
        with about("--stride"):
            own = served_config(self.lake).alignment
            gaps = own.gaps if self.gaps is None else self.gaps
            return replace(own, method=method, stride=self.stride or stride, gaps=gaps and method == "sta")

    @cached_property
    def segments(self) -> Mapping[str, Segments]:
        """What the frames [start, stop) of each clip that has segments show."""
        found: dict[str, list[tuple[int, int, str]]] = {}
        measured = {clip.clip for clip in self.chosen.clips}
        for row in fetch(self.con, "segments_of", {"dataset": None}):
            if row["clip"] in measured:
                found.setdefault(row["clip"], []).append((row["start"], row["stop"], row["label"]))
        return found

    @cached_property
    def takes(self) -> Mapping[str, Take]:
        """The clips that have segments."""
        places = self.strings.positions
        return {clip: Take(self.strings.string_of(places[clip]), tuple(rows)) for clip, rows in self.segments.items()}

    @cached_property
    def asked(self) -> Asked:
        """Segments as queries, up to ten of each class that another clip shows, drawn by seed.

        Raises:
            UserError: no class is shown by two clips, or all segments are one symbol.
        """
        rows = [LabelledRange(clip, *segment) for clip, rows in self.segments.items() for segment in rows]
        clips_of: dict[str, set[str]] = {}
        for row in rows:
            clips_of.setdefault(row.label, set()).add(row.clip)
        drawn = [each for each in drawn_ranges(rows) if len(clips_of[each.label]) > 1]
        if not drawn:
            raise UserError(
                "no two clips have segments of one class: there is nothing to measure; docs/formats.md says how "
                "segments.csv teaches them"
            )
        searcher = AlignmentRangeSearcher(self.lake, strings=self.strings)
        queries, refused = [], 0
        for each in drawn:
            try:
                queries.append((each, searcher.symbols_of(Query(each.clip, each.start, each.stop))))
            except OnePostureError:
                refused += 1
        if not queries:
            raise UserError(f"each of {refused} segments is one posture, a symbol: there is nothing to align")
        return Asked(queries, refused)


@dataclass(frozen=True)
class Take:
    """A clip with its string, and what its frames [start, stop) show: (start, stop, label)."""

    string: SymbolString
    segments: tuple[tuple[int, int, str], ...]


@dataclass(frozen=True)
class LabelledRange:
    """Frames [start, stop) of a clip that show a class."""

    clip: str
    start: int
    stop: int
    label: str


@dataclass(frozen=True)
class Asked:
    """Ranges as queries, each with its string; and how many were refused, since they are one symbol."""

    queries: list[tuple[LabelledRange, StringQuery]]
    refused: int


def drawn_ranges(ranges: Sequence[LabelledRange], each: int = EACH, seed: int = SEED) -> list[LabelledRange]:
    """Up to `each` ranges of every class, drawn by the seed; by class, then in their order."""
    rng = np.random.default_rng(seed)
    found = []
    for label in sorted({one.label for one in ranges}):
        own = [one for one in ranges if one.label == label]
        found += [own[i] for i in np.sort(rng.permutation(len(own))[:each])]
    return found


def class_of(start: int, stop: int, segments: Segments) -> tuple[str, float]:
    """The class of most of the frames [start, stop), and its share of them; ("", 0) where none has one.

    A frame may be of several classes. Of classes with equally many frames the first by name.
    """
    found: dict[str, np.ndarray] = {}
    for begin, end, label in segments:
        mask = found.setdefault(label, np.zeros(max(0, stop - start), dtype=np.bool_))
        mask[max(begin - start, 0) : max(end - start, 0)] = True
    counts = {label: int(mask.sum()) for label, mask in sorted(found.items())}
    best = max(counts, key=lambda label: counts[label], default="")
    return (best, counts[best] / (stop - start)) if best and counts[best] else ("", 0.0)
