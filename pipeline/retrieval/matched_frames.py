"""Matches of strings as answers in frames: every cycle of a repeat that was folded is an answer of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from motionlake.lake.strings import LakeStrings
from motionlake.pesta.cycles import Occurrence, occurrences, whole
from motionlake.retrieval.hits import Hit, PathStep, range_hit
from motionlake.retrieval.string_queries import StringQuery
from motionlake.retrieval.symbol_strings import ClipStrings

if TYPE_CHECKING:
    from motionlake.pesta.matches import Match

    Best = Callable[[int], list[Match]]  # so many matches, cheapest first

Taken = dict[int, list[tuple[int, int]]]  # frames of answers by the index of their clip


@dataclass(frozen=True)
class MatchedFrames:
    """What of the clips of a lake a query was matched with.

    Attributes:
        strings: those that were searched.
        clips: the same before repeats are folded.
        query: what was looked for.
        own: the query's own frames may be answers.
        crossing: a match may end in a later clip than it begins in.
    """

    strings: LakeStrings
    clips: ClipStrings
    query: StringQuery
    own: bool = False
    crossing: bool = False

    def hits(self, best: Best, k: int) -> list[Hit]:
        """The k best answers, in order and not ranked yet; they do not overlap.

        All occurrences of a match cost the same. As some or all of them may be the query's own frames, more matches are
        looked for while they have fewer than k.
        """
        count = k
        while True:
            found = best(count)
            hits = self._placed(found, k)
            if len(hits) >= k or len(found) < count:
                return hits[:k]
            count *= 2

    def _placed(self, matches: Sequence[Match], k: int) -> list[Hit]:
        taken: Taken = {}
        if self.query.clip in self.strings.positions and not self.own:
            taken[self.strings.positions[self.query.clip]] = [(self.query.start, self.query.stop)]
        ends = [self._end(match) for match in matches]
        inside = {match.clip for match, end in zip(matches, ends, strict=True) if end == match.clip}
        self.clips.read([self.strings.clips[clip].clip for clip in sorted(inside)])
        found: list[tuple[float, int, int, Hit]] = []
        for match, end in zip(matches, ends, strict=True):
            if len(found) >= k and match.cost > found[-1][0]:
                break
            hits = self._occurring(match, taken) if end == match.clip else [self._crossing(match, end)]
            found += [(match.cost, match.clip, hit.start or 0, hit) for hit in hits]
        return [hit for *_, hit in sorted(found, key=lambda each: each[:3])]

    def _occurring(self, match: Match, taken: Taken) -> list[Hit]:
        """The occurrences of a match that share no frames with earlier answers."""
        string, others = self.clips.of(self.strings.clips[match.clip].clip), taken.setdefault(match.clip, [])
        own = self._asked
        hits = []
        for found in occurrences(string, match.start, match.stop, own.cycles - 1 if own else 0):
            start, stop = found.frames(string)
            if any(start < other[1] and other[0] < stop for other in others):
                continue
            others.append((start, stop))
            hit = self._hit(match, start, stop)
            path = self._path(match, found.steps(string))
            hits.append(replace(hit, cycles=found.cycles, speed=self._speed(match.clip, found), path=path))
        return hits

    @cached_property
    def _asked(self) -> Occurrence | None:
        """Where the query stands in its own frames; None of symbols without any."""
        string = self.clips.of_query(self.query)
        return None if string is None else whole(string)

    def _speed(self, clip: int, found: Occurrence) -> float | None:
        """How much faster than the query, a cycle as a cycle."""
        own, asked = self._asked, self.clips.of_query(self.query)
        if own is None or asked is None:
            return None
        seconds = found.once(self.clips.of(self.strings.clips[clip].clip)) / self.strings.clips[clip].fps
        return own.once(asked) / self.query.fps / seconds if seconds else None

    def _crossing(self, match: Match, end: int) -> Hit:
        """A match that ends in a later clip than it begins in, as its symbols stand, repeats folded."""
        strings, own = self.strings, self.strings.symbols_of(match.clip).start
        first, last = own + match.start, own + match.stop - 1
        start, stop = int(strings.starts[first]), int(strings.stops[last])
        known, later = strings.clips[match.clip], strings.clips[end]
        before = sum(clip.frames / clip.fps for clip in strings.clips[match.clip : end])
        seconds = before - start / known.fps + stop / later.fps
        columns = range(first, last + 1)
        path = self._path(match, [(int(strings.starts[y]), int(strings.stops[y])) for y in columns])
        hit = self._hit(match, start, stop)
        return replace(hit, stop_clip=later.clip, seconds=seconds, path=path)

    def _hit(self, match: Match, start: int, stop: int) -> Hit:
        known = self.strings.clips[match.clip]
        hit = range_hit(known, start, stop, match.cost / len(self.query.symbols), cost=match.cost)
        return replace(hit, stop_clip=known.clip) if self.crossing else hit

    def _path(self, match: Match, steps: Sequence[tuple[int, int]]) -> tuple[PathStep, ...] | None:
        """The path in frames, given those of the symbols that were matched."""
        if match.path is None:
            return None
        return tuple(PathStep(self.query.frames_of(x), steps[y - match.start]) for x, y in match.path.tolist())

    def _end(self, match: Match) -> int:
        """The index of the clip that a match ends in."""
        offsets = self.strings.repository.offsets
        last = self.strings.symbols_of(match.clip).start + match.stop - 1
        return int(np.searchsorted(offsets, last, side="right")) - 1
