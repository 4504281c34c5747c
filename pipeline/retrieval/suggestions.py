"""Labels for clips that have none, from the clips most like them, each with a confidence."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any, Final, TypeAlias

from motionlake.errors import DamagedError, UserError
from motionlake.lake.catalog import Connection, fetch, reading
from motionlake.lake.layout import Lake
from motionlake.lake.verdicts import good_rows
from motionlake.names import kept
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.labelled_clips import check_column
from motionlake.retrieval.protocol import Query, Scope, Searcher

VOTES: Final = 3  # nearest labelled clips, the second of which counts a half, the third a third
REACH: Final = 200  # nearest clips among which labelled ones are looked for first
EVERY: Final = 10**9
TRIED: Final = 200  # labelled clips that are suggested labels for, to see how often these are right
OWN: Final = ("label", "subject", "split", "licence")  # columns of a labels.csv that every clip has
CONFIDENCE: Final = "confidence"
Done: TypeAlias = Callable[[int, int], None]  # told of (clips asked for, all)


@dataclass(frozen=True)
class Suggestion:
    """A label for a clip.

    Attributes:
        confidence: how often such labels are right, from 0 to 1.
        like: the labelled clip most like it, which has this label.
        distance: of that by the search.
    """

    clip: str
    label: str
    confidence: float
    like: str
    distance: float


@dataclass(frozen=True)
class Vote:
    """The nearest labelled clip, and how much of what the nearest three count is for its label."""

    label: str
    like: str
    distance: float
    agreed: float


def vote(hits: Sequence[Hit], labels: Mapping[str, str]) -> Vote | None:
    """What the nearest clips say; None where none of them has a label."""
    near = [hit for hit in hits if hit.clip in labels][:VOTES]
    if not near:
        return None
    label, counts = labels[near[0].clip], [1 / rank for rank in range(1, len(near) + 1)]
    agreed = sum(count for count, hit in zip(counts, near, strict=True) if labels[hit.clip] == label)
    return Vote(label, near[0].clip, near[0].distance, agreed / sum(counts))


class Confidence:
    """How often a vote is right, by how often others were in which the nearest agreed as much.

    Of n such votes r were right: it is (r + 2 a) / (n + 2), a how much the nearest agreed (what it would be without any
    vote whose truth is known, for which two votes stand), and at most (n + 1) / (n + 2), what n that were all right
    prove by the rule of succession.

    Args:
        agreed: [v] of votes, from 0 to 1.
        right: [v] whether they were.
    """

    def __init__(self, agreed: Sequence[float], right: Sequence[bool]) -> None:
        self._votes = Counter(round(each, 6) for each in agreed)
        self._right = Counter(round(each, 6) for each, was in zip(agreed, right, strict=True) if was)

    def of(self, agreed: float) -> float:
        votes, right = self._votes[round(agreed, 6)], self._right[round(agreed, 6)]
        return min((right + 2 * agreed) / (votes + 2), (votes + 1) / (votes + 2))


@dataclass(frozen=True)
class LabelSuggester:
    """Suggests labels for recorded clips by the labelled recorded clips that a search finds nearest.

    Attributes:
        lake: what is searched.
        searcher: of whole clips.
        column: of labels.csv that holds the labels.
        done: hears how far it is.
        min_quality: the worst verdict of stage "quality" that a clip may have whose label is suggested; None: any.
    """

    lake: Lake
    searcher: Searcher
    column: str = "label"
    done: Done = field(default=lambda done, all_: None)
    min_quality: str | None = None

    def suggest(self, dataset: str | None = None) -> list[Suggestion]:
        """A label for every clip that has none, the surest first, then by name; clips that cannot be compared get none.

        Labelled clips are asked for first, each without its own label: how often that finds it is the confidence.

        Args:
            dataset: only for clips of this dataset; the labelled clips are those of all.

        Raises:
            UserError: no such column, fewer than two labelled clips, or as `good_rows`.
        """
        rows, teach = self._rows()
        labels = {row["clip"]: str(row["label"]) for row in teach}
        if len(labels) < 2:
            raise UserError(
                f"{len(labels)} clips have a {self.column} to learn from, and it takes 2; labels.csv beside the clips "
                "gives them"
            )
        missing = [row["clip"] for row in rows if row["label"] is None and dataset in (None, row["dataset"])]
        tried = sorted(labels, key=_drawn)[:TRIED] if missing else []
        votes: dict[str, Vote] = {}
        for count, clip in enumerate([*tried, *missing], start=1):
            found = self._vote(clip, labels)
            if found is not None:
                votes[clip] = found
            self.done(count, len(tried) + len(missing))
        known = [clip for clip in tried if clip in votes]
        confidence = Confidence([votes[c].agreed for c in known], [votes[c].label == labels[c] for c in known])
        suggested = [
            Suggestion(clip, of.label, confidence.of(of.agreed), of.like, of.distance)
            for clip, of in ((clip, votes[clip]) for clip in missing if clip in votes)
        ]
        return sorted(suggested, key=lambda each: (-each.confidence, each.clip))

    def _rows(self) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
        """Of the recorded clips, and of those whose labels may be suggested."""
        with reading(self.lake) as con:
            check_column(con, self.column)
            rows = fetch(con, "labels_of_recorded", {"column": self.column})
            known = [row for row in rows if row["label"] is not None]
            return rows, good_rows(con, known, self.min_quality, "labelled clips")

    def _vote(self, clip: str, labels: Mapping[str, str]) -> Vote | None:
        """By the nearest clips; by all where none of these has a label."""
        for k in (REACH, EVERY):
            try:
                (hits,) = self.searcher.search([Query(clip)], k, Scope(recorded_only=True))
            except DamagedError:
                raise
            except UserError:  # a clip that cannot be compared
                return None
            found = vote(hits, labels)
            if found is not None or len(hits) < k:
                return found
        return None


@dataclass(frozen=True)
class LabelFile:
    """A labels.csv: its columns, its rows, and the folder of clips that it is for."""

    columns: list[str]
    rows: list[list[str]]
    folder: str


def label_file(con: Connection, suggestions: Sequence[Suggestion], column: str, beside: Path) -> LabelFile:
    """A labels.csv with suggestions, and with all that is known of the other clips of their source folder.

    `ingest --labels` takes a labels.csv for the whole truth about a folder. A suggested label has its confidence beside
    it; of several bodies in one file the surest counts. Files are named as seen from the folder of the labels.csv where
    they lie below it, else in full.

    Args:
        con: to the lake.
        suggestions: one at least.
        column: that they are for.
        beside: the folder that the labels.csv will lie in.

    Raises:
        UserError: the clips come from several source folders.
    """
    by_clip = {each.clip: each for each in suggestions}
    files = fetch(con, "labels_of_files")
    folders = sorted({row["root"] for row in files if row["clip"] in by_clip})
    if len(folders) != 1:
        raise UserError(
            f"the clips come from {len(folders)} folders, and a labels.csv is for one; choose a dataset "
            "(--dataset NAME)"
        )
    said: dict[str, dict[str, str]] = {}
    for row in (row for row in files if row["root"] == folders[0]):
        own = {name: row[name] for name in OWN} | row["attributes"]
        cells = said.setdefault(row["path"], {name: value for name, value in own.items() if value is not None})
        found = by_clip.get(row["clip"])
        if found is not None and (column not in cells or found.confidence > float(cells[CONFIDENCE])):
            cells |= {column: found.label, CONFIDENCE: f"{found.confidence:.3f}"}
    rest = sorted({name for cells in said.values() for name in cells} - {*OWN, CONFIDENCE})
    columns = [*OWN, *rest, CONFIDENCE]
    here, base = PurePosixPath(kept(beside.absolute())), PurePosixPath(folders[0])
    rows = []
    for path, cells in said.items():
        named = base / path
        shown = named.relative_to(here) if named.is_relative_to(here) else named
        rows.append([str(shown), *(cells.get(name, "") for name in columns)])
    return LabelFile(["file", *columns], rows, folders[0])


def _drawn(clip: str) -> bytes:
    """The same clips every time, from all over the lake."""
    return hashlib.sha256(clip.encode()).digest()
