"""Whole clips by several methods at once, along the neighbour graph of the lake: the search that commands take."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Final, cast

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import DamagedError, UserError
from motionlake.kernels import expect_many
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.layout import Lake
from motionlake.motion.diffusion import NOWHERE, diffused, scale
from motionlake.retrieval.asked import Asked, Clip, Ranking, asked_of_hits
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.protocol import Finds, LakeSearcher, Query, Scope
from motionlake.retrieval.registry import ready, searcher
from motionlake.retrieval.views import View, near_again
from motionlake.retrieval.weighing import WEIGHTS, Found, Weighed, as_near, fused_distances, same_clips, weights_of
from motionlake.stages.shortlist_files import MOST, WIDTHS, needed_by
from motionlake.threads import limited

if TYPE_CHECKING:
    from motionlake.retrieval.lake_neighbours import LakeNeighbours
    from motionlake.retrieval.shortlist import Cascade

LARGE: Final = ("signature",)
REACH: Final = 300  # nearest clips by each method, which are ranked by all
REACH_OF_CHOSEN: Final = 200  # the same of a large lake, where few answers lie beyond
EVERY: Final = 10**9  # answers


class FusedSearcher(LakeSearcher):
    """One ranking by several methods; a `Searcher`.

    Every method names its 300 nearest clips, and all of them are ranked by all methods. By a method with distance d,
    and u to the tenth nearest clip, a clip is as near as 1 / (1 + d / u); n is the mean of that, by the weights of
    methods. Where the lake has a neighbour graph, a clip is near that is near to what is near (`diffused`); a is the
    mean of that by the methods, and b how near it is along the graph of a (`near_again`). The distance of a clip is one
    less n, or less (a + b + .3 n) / 2.3. A clip that a method does not name is to it as far as the last that it does; a
    method that cannot compare the query is left out. In a lake with a shortlist methods compare some clips (`Cascade`).

    Attributes:
        left_out: by the name of a query of the last search, why methods could not compare it.

    Args:
        lake: which holds the graph.
        searchers: by name; by default those of `WEIGHTS` that the lake is ready for, or else any that it is ready for.
        graph: go along the neighbour graph.
        explain: give every answer its `shares`.
        matched: and in these what of both is alike, which takes as long as the search.
        exact: compare every clip, where a shortlist would choose some.

    Raises:
        UserError: the lake is not ready for any method, or too large to compare every clip.
    """

    name = "fused"
    finds: Finds = "clip"

    def __init__(
        self,
        lake: Lake,
        *,
        searchers: Mapping[str, LakeSearcher] | None = None,
        graph: bool = True,
        explain: bool = False,
        matched: bool = True,
        exact: bool = False,
    ) -> None:
        super().__init__(lake)
        self._cascade = _cascade(lake, exact=exact) if searchers is None else None
        if searchers is not None:
            order = [*WEIGHTS, *searchers]  # of summation: the same answers whichever way they are given
            self._searchers = {name: searchers[name] for name in dict.fromkeys(order) if name in searchers}
        if self._cascade is None and not self._searchers:
            raise UserError(f"{lake.root}: is not ready for search; make it so with `motionlake run all`")
        self._along = graph and (self._cascade is None or not self._cascade.large)  # a large lake has none
        self._explain, self._match = explain, explain and matched
        self.left_out: dict[str, list[str]] = {}

    def warm_up(self) -> None:
        """Read and check all that searches by a shortlist may need: for a process that answers many.

        Raises:
            DamagedError: a file of the shortlist is not as it was written.
        """
        expect_many()
        if self._cascade is not None:
            self._cascade.files.moves.check_all()

    def beside_others(self, query: Query, scope: Scope) -> bool:
        """Whether this search may run in several threads at once: it computes nothing that others would wait for."""
        by_row = query.clip is not None and query.whole and not scope.mirrored
        return self._cascade is not None and self._cascade.large and by_row

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        """As `Searcher.distances`, without the graph; u is the distance of the tenth nearest of the gallery."""
        of_each = {name: each.distances(queries, gallery) for name, each in self._searchers.items()}
        return fused_distances(of_each)

    def nearest(self, queries: Sequence[Query], k: int, scope: Scope, *, mirrored: bool) -> list[list[Hit]]:
        self.left_out = {}
        with limited(1):  # threads of linear algebra would wait for one another: the products are small
            return [self._answers(query, k, scope, mirrored=mirrored) for query in queries]

    def _answers(self, query: Query, k: int, scope: Scope, *, mirrored: bool) -> list[Hit]:
        if self._cascade is None:
            hits = self._best(partial(self._asked, query, scope, mirrored), query, k, EVERY, scope, mirrored)
        else:
            chosen = partial(self._chosen, self._cascade, query, scope, mirrored)
            hits = self._best(chosen, query, k, k + 1, scope, mirrored)
        return self._matched(query, hits, mirrored=mirrored) if self._match else hits

    def _best(
        self, ask: Callable[[int], Asked[Clip]], query: Query, k: int, every: int, scope: Scope, mirrored: bool
    ) -> list[Hit]:
        """The k nearest; `ask` names so many by each method, and `every` of them are all there are."""
        reach = REACH if self._cascade is None or not self._cascade.large else REACH_OF_CHOSEN
        asked = ask(reach + 1)
        own = asked.clip if query.whole and not mirrored else None
        refused = None if scope.own else asked.clip
        same = same_clips(asked.by)
        views = {name: self._view(name, found, own, same, asked.names) for name, found in asked.by.items()}
        weights = weights_of(views, self._graph.mutual if self._along else {})
        again = near_again(views, weights, len(self._graph.nodes)) if self._along else {}
        weighed = Weighed({name: Found.of(view) for name, view in views.items()}, again, own, weights)
        distances = weighed.nearest(clip for clip in asked.known if clip != refused)[:k]
        best: list[Hit] = self._hits(asked, weighed, distances)
        if len(best) == k or max(len(found.clips) for found in asked.by.values()) <= reach:
            return best
        # Who asks for more than the nearest gets the others after them, by distance alone.
        rest, known = ask(every), asked.known.keys() | {refused}
        plain = {name: Found.of(self._view(name, found, own, same)) for name, found in rest.by.items()}
        farthest: float = max((hit.distance for hit in best), default=0.0)
        weighed = Weighed(plain, {}, own, weights)
        distances = weighed.nearest(clip for clip in rest.known if clip not in known)[: k - len(best)]
        behind: list[Hit] = self._hits(rest, weighed, distances)
        return [*best, *(replace(hit, distance=max(farthest, hit.distance)) for hit in behind)]

    def _hits(self, asked: Asked[Clip], weighed: Weighed[Clip], nearest: Sequence[tuple[float, Clip]]) -> list[Hit]:
        hits = asked.hits([clip for _, clip in nearest], [distance for distance, _ in nearest])
        if not self._explain:
            return [hit if hit.shares is None else replace(hit, shares=None) for hit in hits]
        return [replace(hit, shares=weighed.shares(clip)) for hit, (_, clip) in zip(hits, nearest, strict=True)]

    def _matched(self, query: Query, hits: Sequence[Hit], *, mirrored: bool) -> list[Hit]:
        """The same answers; each method that compared the query and can tell says what of both is alike."""
        asked = {share.method for hit in hits for share in hit.shares or ()}
        by = {"moves": self._cascade} if self._cascade is not None else self._searchers
        found = {name: each.matches(query, hits, mirrored=mirrored) for name, each in by.items() if name in asked}
        return [
            replace(hit, shares=tuple(
                replace(share, match=found.get(share.method, {}).get(hit.clip)) for share in hit.shares or ()
            ))
            for hit in hits
        ]  # fmt: skip

    def _chosen(self, cascade: Cascade, query: Query, scope: Scope, mirrored: bool, k: int) -> Asked[int]:
        failed: list[UserError] = []
        asked = cascade.nearest(query, k, scope, mirrored=mirrored, failed=failed)
        beside = self._named(self._beside, query, scope, mirrored, k, failed)
        self.left_out[query.name] = [str(error) for error in failed]
        return replace(asked, by={**asked.by, **{name: cascade.ranking(hits) for name, hits in beside.items()}})

    def _asked(self, query: Query, scope: Scope, mirrored: bool, k: int) -> Asked[str]:
        """The k nearest by each method that can compare the query.

        Raises:
            UserError: none can.
        """
        failed: list[UserError] = []
        found = self._named(self._searchers, query, scope, mirrored, k, failed)
        if failed and not found:
            raise failed[0]
        self.left_out[query.name] = [str(error) for error in failed]
        return asked_of_hits(found, query.clip)

    @staticmethod
    def _named(
        searchers: Mapping[str, LakeSearcher], query: Query, scope: Scope, mirrored: bool, k: int,
        failed: list[UserError],
    ) -> dict[str, list[Hit]]:  # fmt: skip
        """The k nearest by each of some methods that can compare the query; `failed` gets why others cannot."""
        found: dict[str, list[Hit]] = {}
        for name, each in searchers.items():
            try:
                (found[name],) = each.nearest([query], k, replace(scope, own=True), mirrored=mirrored)
            except DamagedError:
                raise
            except UserError as error:
                failed.append(error)
        return found

    def _view(
        self, name: str, found: Ranking[Clip], own: Clip | None, same: Container[Clip],
        names: Callable[[Sequence[Clip]], list[str]] | None = None,
    ) -> View[Clip]:  # fmt: skip
        """What a method makes of the query; along its graph, given the names of clips."""
        others = [at for at, clip in enumerate(found.clips) if clip != own]
        clips, distances = [found.clips[at] for at in others], found.distances[others]
        unit = scale(distances)
        equal = np.array([clip in same for clip in clips], dtype=np.bool_)
        near = np.where(equal, 1.0, as_near(np.minimum(distances, found.reach), np.float64(unit)))
        ways = None
        if names is not None and self._along and name in self._graph.methods:
            nodes = self._graph.of(names(clips))
            start = NOWHERE if own is None else int(self._graph.of(names([own]))[0])
            ways = diffused(self._graph.methods[name], nodes, distances, start)
            ways[-1, :-1][equal] = ways[:-1, -1][equal] = 1.0
        return View(clips, distances, near, ways)

    @cached_property
    def _searchers(self) -> dict[str, LakeSearcher]:
        return _ready(self.lake, compared_by(self.lake))

    @cached_property
    def _beside(self) -> dict[str, LakeSearcher]:
        """The methods that compare all clips beside those of the shortlist; none in a large lake."""
        if self._cascade is None or self._cascade.large:
            return {}
        return _ready(self.lake, [name for name in compared_by(self.lake) if name not in self._cascade.methods])

    @cached_property
    def _graph(self) -> LakeNeighbours:
        from motionlake.retrieval.lake_neighbours import read_neighbours

        return read_neighbours(self.lake)


def _cascade(lake: Lake, *, exact: bool) -> Cascade | None:
    from motionlake.retrieval.lake_shortlist import LakeShortlist, shortlist_of

    if exact and _clips(lake) > MOST:
        raise UserError(f"{lake.root}: is too large for --exact by all methods together; give one with --method")
    files = [] if exact else shortlist_of(lake)
    if not files:
        return None

    with ThreadPoolExecutor(1) as pool:
        clips = pool.submit(LakeShortlist, lake, files, needed_by(WIDTHS))
        from motionlake.retrieval.shortlist import Cascade  # while files are compared with what was written

        return Cascade(clips.result())


def compared_by(lake: Lake) -> list[str]:
    """The methods by which the default search compares all clips of a lake without a shortlist.

    Those of `WEIGHTS`, or else any; in a lake of more than `MOST` clips those that need not hold all in memory.
    """
    names = [name for name in ready(lake, "clip") if name != FusedSearcher.name]
    wanted = WEIGHTS if _clips(lake) <= MOST else LARGE
    return [name for name in wanted if name in names] or names


def _clips(lake: Lake) -> int:
    with reading(lake) as con:
        (count,) = fetch(con, "count_clips")
    return int(count["clips"])


def _ready(lake: Lake, names: Sequence[str]) -> dict[str, LakeSearcher]:
    return {name: cast(LakeSearcher, searcher("clip", name, lake, exact=True)) for name in names}
