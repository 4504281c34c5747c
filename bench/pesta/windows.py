"""Sub-queries of Table 4 that are the same frames for every dictionary: windows of `SECONDS`, `APART` apart.

Of a window's frames at least 60 % are of one class. It is asked for by its own symbols, reduced for themselves, in the
other takes; where these are one symbol it has no answer (`unanswered`), and counts as wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.evaluation.pesta.measuring import Segments, class_of
from motionlake.evaluation.pesta.sub_queries import HITS, SHARE
from motionlake.pesta.config import AlignmentConfig, SymbolsConfig
from motionlake.pesta.dictionary import PostureDictionary
from motionlake.pesta.matches import best_matches
from motionlake.pesta.strings import Repository
from motionlake.pesta.symbols import SymbolString, UnfoldedString, unfolded
from motionlake.retrieval.string_queries import SHORTEST
from numpy.typing import NDArray

from bench.pesta.sets import clips_of, segments_of
from bench.units import Found

SECONDS: Final = 1.5
APART: Final = 0.5
SAME: Final = "same windows"
RANKS: Final = (2, 5, 10)


@dataclass(frozen=True)
class Window:
    """Frames [start, stop) of a take, most of which are of one class."""

    take: int
    start: int
    stop: int
    label: str


def windows(takes: Sequence[Segments], frames: Sequence[int], rates: Sequence[float]) -> list[Window]:
    """Every window of takes with such segments, frames and rates, whose class another take shows."""
    found = []
    for take, (segments, count, fps) in enumerate(zip(takes, frames, rates, strict=True)):
        length, step = round(SECONDS * fps), round(APART * fps)
        elsewhere = {label for other, rows in enumerate(takes) if other != take for _, _, label in rows}
        for start in range(0, count - length + 1, step):
            label, share = class_of(start, start + length, segments)
            if share >= SHARE and label in elsewhere:
                found.append(Window(take, start, start + length, label))
    return found


def score_windows(
    set_name: str, dictionary: PostureDictionary, codes: Sequence[NDArray[np.int32]], config: AlignmentConfig
) -> Found:
    """P@2, P@5 and P@10 of the windows of the first takes of a set, as many as have codes [T].

    Returns:
        p_at_...: of all n windows; answered_p_at_...: of those that have more than one symbol; unanswered; symbols.
    """
    clips, segments, distances = (
        clips_of(set_name)[: len(codes)],
        segments_of(set_name)[: len(codes)],
        dictionary.distances,
    )
    rate = dictionary.config.fps
    whole = [
        unfolded(own, codes_fps=rate, fps=clip.fps, n_frames=len(clip.positions), config=SymbolsConfig())
        for own, clip in zip(codes, clips, strict=True)
    ]
    strings = [string.folded for string in whole]
    asked = windows(segments, [len(clip.positions) for clip in clips], [clip.fps for clip in clips])
    right = np.array([_right(window, whole[window.take], strings, segments, distances, config) for window in asked])
    answered = ~np.isnan(right[:, 0])
    found: Found = {f"p_at_{n}": float(np.nan_to_num(right)[:, i].mean()) for i, n in enumerate(RANKS)}
    found |= {f"answered_p_at_{n}": float(right[answered, i].mean()) for i, n in enumerate(RANKS)}
    return found | {
        "n": len(asked),
        "unanswered": int((~answered).sum()),
        "symbols": sum(map(len, strings)),
    }


def _right(
    window: Window,
    own: UnfoldedString,
    strings: list[SymbolString],
    segments: Sequence[Segments],
    distances: np.ndarray,
    config: AlignmentConfig,
) -> list[float]:
    """The share of right answers among the first 2, 5 and 10; not a number where there is no answer."""
    query = own.part(window.start, window.stop, SymbolsConfig()).folded.symbols
    if len(query) < SHORTEST:
        return [float("nan")] * len(RANKS)
    others = [take for take in range(len(strings)) if take != window.take]
    repository = Repository.of([strings[take].symbols for take in others])
    hits = []
    for match in best_matches(query, repository, distances, HITS, config):
        take = others[match.clip]
        start, stop = int(strings[take].starts[match.start]), int(strings[take].stops[match.stop - 1])
        hits.append(class_of(start, stop, segments[take])[0] == window.label)
    return [sum(hits[:n]) / n for n in RANKS]
