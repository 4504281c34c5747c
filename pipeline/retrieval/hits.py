"""Answers of a search: clips or ranges of them, how far they are, and what of them is like the query."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from motionlake.deep_motifs.signatures import CorpusClip

OPTIONAL: Final = ("start", "stop", "cost", "start_seconds", "stop_clip", "cycles", "speed", "path", "shares", "text")


@dataclass(frozen=True)
class PathStep:
    """Frames of the query, and those of the clip that they are aligned to; half-open, each at its own rate."""

    query: tuple[int, int]
    clip: tuple[int, int]


@dataclass(frozen=True)
class Match:
    """What of a query and of an answer is alike by one method.

    Attributes:
        joints: how far each of the fifteen joints is apart, in the mean along the path, the nearest first.
        path: the frames of the query, in their order, and those of the answer that they are aligned to.
    """

    joints: Mapping[str, float]
    path: tuple[PathStep, ...]


TOGETHER: Final = "together"


@dataclass(frozen=True)
class Share:
    """What one of several methods makes of an answer.

    Attributes:
        method: its name, or `TOGETHER`: the way along the graph of what all methods find near.
        weight: how much it counts, of 1.
        distance: of the answer by it; None where it is not among the nearest.
        near: how near that is, from 0 to 1.
        along: how near the answer is along the neighbour graph, from 0 to 1; None without one.
        match: what of both is alike, by methods that can tell.
    """

    method: str
    weight: float
    distance: float | None
    near: float
    along: float | None
    match: Match | None = None


@dataclass(frozen=True, kw_only=True)
class Hit:
    """One answer: a clip, or frames [start, stop) of one at its own rate.

    Attributes:
        rank: from 1, the nearest.
        clip: its full name.
        distance: from the query; answers are ranked by it.
        cost: of aligning the query with these frames, where it was aligned; of Smith-Waterman, minus the score.
        mirrored: the mirrored query is nearer than the query itself.
        start_seconds: when the frames start.
        seconds: how long the clip, or the frames, last.
        stop_clip: where an answer may cross from clip to clip: the clip that `stop` is a frame of.
        cycles: how often what repeats stands in these frames, where they were aligned; 1 where nothing repeats.
        speed: how much faster they are than the query, where they were aligned: its time over theirs, a cycle as a
            cycle.
        path: what is aligned to what, where it was asked for; symbols that are strided over are left out.
        shares: what each of several methods made of it, where it was asked for.
        text: what it says of what was asked for, where that was asked for in words.
    """

    rank: int
    clip: str
    start: int | None = None
    stop: int | None = None
    distance: float
    cost: float | None = None
    mirrored: bool = False
    label: str | None
    dataset: str
    start_seconds: float | None = None
    seconds: float
    stop_clip: str | None = None
    cycles: int | None = None
    speed: float | None = None
    path: tuple[PathStep, ...] | None = None
    shares: tuple[Share, ...] | None = None
    text: str | None = None

    def but(self, **changed: Any) -> Hit:
        """The same but for some attributes, in a tenth of the time of `replace`: evaluations rank all clips often."""
        return Hit(**{**vars(self), **changed})

    def as_row(self) -> dict[str, object]:
        """For JSON: what an answer of this kind does not have is left out."""
        return {name: value for name, value in asdict(self).items() if value is not None or name not in OPTIONAL}


def clip_hit(clip: CorpusClip, distance: float, *, mirrored: bool = False) -> Hit:
    """A whole clip as an answer, not ranked yet."""
    return Hit(
        rank=0, clip=clip.clip, distance=distance, mirrored=mirrored, label=clip.label, dataset=clip.dataset,
        seconds=clip.frames / clip.fps,
    )  # fmt: skip


def range_hit(clip: CorpusClip, start: int, stop: int, distance: float, *, cost: float | None = None) -> Hit:
    """Frames [start, stop) of a clip as an answer, not ranked yet."""
    return replace(
        clip_hit(clip, distance), start=start, stop=stop, cost=cost, start_seconds=start / clip.fps,
        seconds=(stop - start) / clip.fps,
    )  # fmt: skip


def ranked(hits: Sequence[Hit]) -> list[Hit]:
    return [hit if hit.rank == rank else hit.but(rank=rank) for rank, hit in enumerate(hits, start=1)]


def nearer_of_both(plain: Sequence[Hit], mirrored: Sequence[Hit], k: int, *, apart: bool = False) -> list[Hit]:
    """Answers to a query and to its mirror image as one ranking.

    Args:
        plain: the k nearest to the query, nearest first.
        mirrored: the k nearest to its mirror image.
        k: how many at most.
        apart: a clip may be an answer more than once, by frames that do not overlap.
    """
    both = [*plain, *(replace(hit, mirrored=True) for hit in mirrored)]
    taken: list[Hit] = []
    for hit in sorted(both, key=lambda h: (h.distance, h.clip, h.start or 0, h.mirrored)):
        if len(taken) < k and not any(other.clip == hit.clip and not (apart and _apart(other, hit)) for other in taken):
            taken.append(hit)
    return ranked(taken)


def _apart(one: Hit, other: Hit) -> bool:
    """Whether the frames of two hits in one clip do not overlap; those that cross into the next clip count as if."""
    if any(hit.stop_clip not in (None, hit.clip) for hit in (one, other)):
        return False
    (_, stop), (start, _) = sorted((hit.start or 0, hit.stop or 0) for hit in (one, other))
    return stop <= start
