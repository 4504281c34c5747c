"""What several methods name as nearest to one query, before they are weighed against one another."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.retrieval.hits import Hit

Clip = TypeVar("Clip", str, int)  # the name of a clip, or its row in a table that is sorted by names


class Ranking(NamedTuple, Generic[Clip]):
    """The nearest clips by one method, nearest first, and their distances [m].

    Where some clips alone were compared, those farther than `reach` are unlikely to be as many nearest of all.
    """

    clips: Sequence[Clip]
    distances: Float64Array
    reach: float = np.inf


@dataclass(frozen=True)
class Asked(Generic[Clip]):
    """What was found for one query.

    Attributes:
        by: the nearest clips by each method that could compare it, itself among them.
        clip: which the query is, or is a part of; None for a file.
        hits: makes answers of some clips, given their distances: of the few that are shown.
        names: of some clips.
    """

    by: Mapping[str, Ranking[Clip]]
    clip: Clip | None
    hits: Callable[[Sequence[Clip], Sequence[float]], list[Hit]]
    names: Callable[[Sequence[Clip]], list[str]]

    @property
    def known(self) -> dict[Clip, None]:
        """All clips that any method names, in its order."""
        return dict.fromkeys(clip for ranking in self.by.values() for clip in ranking.clips)


def asked_of_hits(found: Mapping[str, Sequence[Hit]], clip: str | None) -> Asked[str]:
    """The same of answers that each method has given."""
    by = {name: Ranking([hit.clip for hit in hits], np.array([hit.distance for hit in hits]))
          for name, hits in found.items()}  # fmt: skip
    first = {hit.clip: hit for hits in found.values() for hit in hits}

    def made(clips: Sequence[str], distances: Sequence[float]) -> list[Hit]:
        return [first[clip].but(distance=distance) for clip, distance in zip(clips, distances, strict=True)]

    return Asked(by, clip, made, list)
