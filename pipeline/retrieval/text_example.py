"""Search for clips that are like an example and answer a text."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from motionlake.retrieval.hits import Hit, Share
from motionlake.retrieval.protocol import EVERYTHING, Query, Scope, Searcher, check_k
from motionlake.retrieval.text import Answers, LakeText

REACH: Final = 200  # nearest clips to the example, and those that answer the text best, which are ranked by both


class ExampleAndText:
    """One ranking by an example and by a text, which count the same.

    The 200 nearest clips to the example, and the 200 that answer the text best, are ranked by the mean of how near they
    are to each, from 1 (the nearest) to 0 (the last of the 200, and all after it). A distance is one less that.

    Args:
        searcher: how clips are compared with the example.
        clips: what they say.
        text: what they are asked.
        explain: give every answer its `shares`.
    """

    def __init__(self, searcher: Searcher, clips: LakeText, text: str, *, explain: bool = False) -> None:
        self._searcher, self._clips, self._text, self._explain = searcher, clips, text, explain

    def search(self, queries: Sequence[Query], k: int, scope: Scope = EVERYTHING) -> list[list[Hit]]:
        """As `Searcher.search`; also raises `UserError` as `LakeText.search`."""
        check_k(k)
        answers = self._clips.answers(self._text, scope)
        found = self._searcher.search(queries, max(k, REACH), replace(scope, below=None))
        return [self._both(query, hits, answers, k, scope) for query, hits in zip(queries, found, strict=True)]

    def _both(self, query: Query, alike: Sequence[Hit], answers: Answers, k: int, scope: Scope) -> list[Hit]:
        said = {hit.clip: hit for hit in self._clips.hits(answers, answers.best(max(k, REACH)))}
        if not scope.own:
            said.pop(query.clip or "", None)
        near = _rescaled(alike)
        both = []
        for hit in (said | {hit.clip: hit for hit in alike}).values():
            tells = float(answers.near[self._clips.places[hit.clip]]) if hit.clip in self._clips.places else 0.0
            distance = 1 - (near.get(hit.clip, 0.0) + tells) / 2
            text = said[hit.clip].text if hit.clip in said else None
            both.append(replace(hit, distance=distance, text=text, shares=self._shares(hit, tells)))
        return scope.near(sorted(both, key=lambda hit: (hit.distance, hit.clip))[:k])

    def _shares(self, hit: Hit, tells: float) -> tuple[Share, ...] | None:
        if not self._explain:
            return None
        alike = tuple(replace(share, weight=share.weight / 2) for share in hit.shares or ())
        return (*alike, Share("text", 0.5, 1 - tells, tells, None))


def _rescaled(hits: Sequence[Hit]) -> dict[str, float]:
    """How near answers are, from 1 (the first) to 0 (the last); 1 where all are as near."""
    distances = [hit.distance for hit in hits]
    first, last = min(distances, default=0.0), max(distances, default=0.0)
    return {hit.clip: (last - hit.distance) / (last - first) if last > first else 1.0 for hit in hits}
