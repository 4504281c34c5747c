"""What is asked of a search, and what every way to search offers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal, Protocol, TypeAlias, TypeVar

import numpy as np
from motionlake.arrays import Float64Array, Int64Array
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, open_once, reading
from motionlake.lake.layout import Lake
from motionlake.lake.models import check_served
from motionlake.lake.resolve import clip_or_file, resolve_clip
from motionlake.lake.verdicts import check_least, good_clips
from motionlake.retrieval.hits import Hit, Match, nearer_of_both, ranked
from motionlake.threads import limited

if TYPE_CHECKING:
    from motionlake.deep_motifs.signatures import CorpusClip

Finds: TypeAlias = Literal["clip", "range"]


@dataclass(frozen=True)
class Query:
    """What is looked for: a clip of the lake, by its full name, or the first body of a clip file.

    Attributes:
        source: the name (`query_of` finds it), or the file, which need not be in the lake.
        start: first frame of the part to look for, at the clip's own rate; None: the clip's first.
        stop: frame after its last; None: after the clip's last.
    """

    source: str | Path
    start: int | None = None
    stop: int | None = None

    @property
    def name(self) -> str:
        return str(self.source)

    @property
    def clip(self) -> str | None:
        """The clip of the lake; None of a file."""
        return self.source if isinstance(self.source, str) else None

    @property
    def whole(self) -> bool:
        return self.start is None and self.stop is None


@dataclass(frozen=True)
class ClipFilter:
    """Which clips of a lake count.

    Attributes:
        dataset: of this dataset only.
        split: of this split only ("train", "test", ... of labels.csv).
        recorded_only: no synthetic clips.
        min_quality: the worst verdict of stage "quality" that a clip may have ("ok", "doubtful"); None: any, or none.
    """

    dataset: str | None = None
    split: str | None = None
    recorded_only: bool = False
    min_quality: str | None = field(default=None, kw_only=True)

    def admission(self, lake: Lake) -> Callable[[CorpusClip], bool]:
        """Which clips of a lake count, as a function.

        Raises:
            UserError: verdicts are asked for that are not known (`lake.verdicts`).
        """
        good: frozenset[str] | None = None
        if self.min_quality is not None:
            with reading(lake) as con:
                good = good_clips(con, self.min_quality)
        return lambda clip: (
            self.dataset in (None, clip.dataset)
            and self.split in (None, clip.split)
            and not (self.recorded_only and clip.synthetic)
            and (good is None or clip.clip in good)
        )

    def as_parameters(self, con: Connection) -> dict[str, object]:
        """For a statement in SQL that leaves clips out. Raises `UserError` as `admission`."""
        least = check_least(con, self.min_quality)
        return {
            "dataset": self.dataset, "split": self.split, "recorded_only": self.recorded_only, "min_quality": least,
        }  # fmt: skip

    @property
    def clips(self) -> ClipFilter:
        """What of it says which clips count, and nothing else."""
        return ClipFilter(self.dataset, self.split, self.recorded_only, min_quality=self.min_quality)


@dataclass(frozen=True)
class Scope(ClipFilter):
    """Which clips may be answers, and to what.

    Attributes:
        mirrored: look for the mirror image of the query as well (left for right); the nearer of both counts.
        own: the query's own clip, or its own frames where ranges are found, may be an answer.
        below: the distance that answers are nearer than (U_d; PESTA, section 3); None: any.
    """

    mirrored: bool = False
    own: bool = False
    below: float | None = field(default=None, kw_only=True)

    def near(self, hits: Sequence[Hit]) -> list[Hit]:
        """The answers that are near enough, ranked."""
        return ranked([hit for hit in hits if self.below is None or hit.distance < self.below])

    def chosen(self, lake: Lake, clips: Sequence[CorpusClip], without: str | None = None) -> Int64Array:
        """Indices of the clips that may be answers; `without`: the query's, unless it may be one."""
        admits = self.admission(lake)
        kept = [i for i, clip in enumerate(clips) if admits(clip) and (self.own or clip.clip != without)]
        return np.array(kept, dtype=np.int64)


EVERYTHING = Scope()


class Searcher(Protocol):
    """A way to search a lake. It reads what it needs of the lake once.

    Attributes:
        name: of the method.
        finds: whole clips, or ranges of frames inside them.
    """

    name: str
    finds: Finds

    def search(self, queries: Sequence[Query], k: int, scope: Scope = EVERYTHING) -> list[list[Hit]]:
        """The k answers nearest to each query, nearest first, ties by name.

        Args:
            queries: clips of the lake, and clip files.
            k: how many answers at most.
            scope: which clips may be answers.

        Raises:
            UserError: a clip, a file or a range that this method cannot compare.
        """
        ...

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        """[q, g] distance of each query from each of some clips, files or ranges.

        Where ranges are found, that of the nearest place in each.

        Raises:
            UserError: as `search`.
        """
        ...


class LakeSearcher(ABC):
    """A `Searcher` that compares the query and its mirror image one after the other.

    Raises:
        UserError: there is a newer model than the one that has made what is compared.
    """

    name: str
    finds: Finds
    compares: ClassVar[tuple[str, ...]] = ()  # what models have made: see `check_served`
    several = False  # answers inside one clip

    def __init__(self, lake: Lake) -> None:
        self.lake = lake
        if self.compares:
            check_served(lake, *self.compares)

    def search(self, queries: Sequence[Query], k: int, scope: Scope = EVERYTHING) -> list[list[Hit]]:
        """As `Searcher.search`."""
        check_k(k)
        if not k:
            return [[] for _ in queries]
        # Sums of several threads round otherwise: a query has the same answers alone and among others.
        with open_once(self.lake), limited(1):
            plain = self.nearest(queries, k, scope, mirrored=False)
            if not scope.mirrored:
                return [scope.near(hits) for hits in plain]
            mirrored = self.nearest(queries, k, scope, mirrored=True)
        pairs = zip(plain, mirrored, strict=True)
        return [scope.near(nearer_of_both(hits, others, k, apart=self.several)) for hits, others in pairs]

    @abstractmethod
    def nearest(self, queries: Sequence[Query], k: int, scope: Scope, *, mirrored: bool) -> list[list[Hit]]:
        """The k answers nearest to each query, or to its mirror image, in order and not ranked yet."""

    @abstractmethod
    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        """As `Searcher.distances`."""

    def matches(self, query: Query, hits: Sequence[Hit], *, mirrored: bool) -> dict[str, Match]:
        """What is alike of a query, or of its mirror image, and of answers, by clip; of none where it cannot tell."""
        return {}


def check_k(k: int) -> None:
    """Raises `UserError` where fewer than no answers are wanted."""
    if k < 0:
        raise UserError(f"k is {k}: it is at least 0")


Choice = TypeVar("Choice", bound=str)


def one_of(name: str, value: str, choices: tuple[Choice, ...]) -> Choice:
    """A value that is one of a few. Raises `UserError` where it is not."""
    for choice in choices:
        if value == choice:
            return choice
    raise UserError(f"{name} is {value!r}, not one of {', '.join(choices)}")


@contextmanager
def about(name: str) -> Iterator[None]:
    """A `ValueError` about a query as the `UserError` that names it."""
    try:
        yield
    except ValueError as error:
        raise UserError(f"{name}: {error}") from error


def query_of(con: Connection, name: str, start: int | None = None, stop: int | None = None) -> Query:
    """What a person means: a clip of the lake by its full name or an unambiguous end of it, or a clip file.

    Raises:
        UserError: as `clip_or_file`.
    """
    return Query(clip_or_file(con, name), start, stop)


def not_ready(lake: Lake, clip: str, what: str) -> UserError:
    """The error for a clip that a method knows nothing of.

    Raises:
        UserError: the lake has no such clip.
    """
    with reading(lake) as con:
        resolve_clip(con, clip)
    return UserError(f"{clip}: has no {what} yet; make it with `motionlake run all`")
