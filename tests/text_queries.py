"""Queries in words over the recordings, what they should find, and how much of it a ranking finds."""

from __future__ import annotations

import csv
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.retrieval.text_index import TextIndex
from motionlake.retrieval.text_words import words

DATA = Path(__file__).parent / "data"
SETS = ("bandai1", "cmu_86", "cmu_bvh", "cmu_dance", "cmu_exercises", "hdm05", "utd_mhad")
Ranking = Callable[[str], Float64Array]  # a query to [n] scores, more is better, 0 no answer


@dataclass(frozen=True)
class SaidClip:
    """A clip by its name, and what labels.csv and segments.csv say of it."""

    name: str
    columns: Mapping[str, str]
    segments: tuple[str, ...]

    @property
    def text(self) -> tuple[str, ...]:
        """As `LakeText` has it (a test compares them)."""
        said = [value for name, value in self.columns.items() if name not in ("file", "split", "dataset")]
        named = re.sub(r"\.[A-Za-z0-9]+$", "", self.name).split("/")
        return tuple(re.sub(r"\d+", " ", part) for part in [*said, *sorted(set(self.segments)), *named])


def read_clips(recordings: Path, sets: Sequence[str] = SETS) -> list[SaidClip]:
    """The labelled clips of the recordings, by name."""
    found = []
    for name in sets:
        rows = {row["file"]: row for row in _rows(recordings / name / "labels.csv")}
        segments = _rows(recordings / name / "segments.csv")
        for file in sorted(rows.keys() | {row["file"] for row in segments}):
            says = {k: v for k, v in rows.get(file, {}).items() if v} | {"dataset": name, "file": Path(file).stem}
            found.append(
                SaidClip(f"{name}/{file}", says, tuple(row["label"] for row in segments if row["file"] == file))
            )
    return found


def _rows(file: Path) -> list[dict[str, str]]:
    if not file.exists():
        return []
    with file.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def read_queries(name: str) -> list[dict[str, Any]]:
    """The queries of a file of `tests/data`: `text` and `expected`."""
    found: list[dict[str, Any]] = tomllib.loads((DATA / name).read_text(encoding="utf-8"))["query"]
    return found


def expected(query: Mapping[str, Any], clips: Sequence[SaidClip]) -> list[bool]:
    """[n] whether each clip should be found."""
    return [any(all(_matches(clip, *each) for each in rule.items()) for rule in query["expected"]) for clip in clips]


def _matches(clip: SaidClip, column: str, pattern: str) -> bool:
    said = clip.segments if column == "segment" else (clip.columns.get(column, ""),)
    return any(re.fullmatch(pattern, each, re.IGNORECASE) for each in said)


def recall(scores: Float64Array, wanted: Sequence[bool], k: int = 10) -> float:
    """How many of the first k answers are wanted, of k or of all that are, if these are fewer; ties in their order."""
    order = [place for place in np.argsort(-scores, kind="stable")[:k] if scores[place] > 0]
    return float(sum(wanted[place] for place in order) / min(k, sum(wanted)))


def ours(clips: Sequence[SaidClip]) -> Ranking:
    """The index of a lake: texts that are the same come once."""
    texts = [clip.text for clip in clips]
    places = {text: place for place, text in enumerate(dict.fromkeys(texts))}
    index = TextIndex(list(places))
    return lambda query: index.scores(index.asked(query))[[places[text] for text in texts]]


def substrings(clips: Sequence[SaidClip]) -> Ranking:
    """How many of the words of a query stand somewhere in what a clip says, as they are."""
    said = [_whole(clip).casefold() for clip in clips]
    return lambda query: np.array([float(sum(word in text for word in words(query))) for text in said])


def plain_bm25(clips: Sequence[SaidClip]) -> Ranking:
    """The same library over the words of a clip as they are."""
    import bm25s

    corpus = [words(_whole(clip)) for clip in clips]
    index = bm25s.BM25()
    index.index(corpus, show_progress=False)

    def scores(query: str) -> Float64Array:
        known = [word for word in words(query) if word in index.vocab_dict]
        return np.asarray(index.get_scores(known)) if known else np.zeros(len(clips))

    return scores


def _whole(clip: SaidClip) -> str:
    return "\n".join(clip.text)
