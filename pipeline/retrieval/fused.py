"""Whole clips by several methods at once, along the neighbour graph of the lake: the search that commands take."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Final, cast

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import DamagedError, UserError
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.layout import Lake
from motionlake.motion.diffusion import NOWHERE, diffused, scale
from motionlake.retrieval.hits import TOGETHER, Hit, Share
from motionlake.retrieval.protocol import Finds, LakeSearcher, Query, Scope
from motionlake.retrieval.registry import ready, searcher
from motionlake.retrieval.views import View, near_again
from motionlake.stages.shortlist_files import MOST

if TYPE_CHECKING:
    from motionlake.retrieval.lake_neighbours import LakeNeighbours
    from motionlake.retrieval.shortlist import Cascade

# How much each counts: looked at on all sets (docs/search.md says what choices with one set left out make of it).
WEIGHTS: Final = {"signature": 2.0, "alignment": 1.0, "moves": 4.0, "descriptor": 1.5}
LARGE: Final = ("signature",)
REACH: Final = 300  # nearest clips by each method, which are ranked by all
DIRECT: Final = 0.3  # what the distance itself counts beside a way along the graph
_SAME: Final = 5e-3  # of moves, whose root mean square is one, as far as rounding takes a clip from itself
EVERY: Final = 10**9  # answers


@dataclass(frozen=True)
class _Found:
    """What one method makes of one query, by clip.

    Attributes:
        distances: of clips.
        near: by these alone, from 0 to 1.
        along: by the way along the graph; empty without one.
        far: `near` of the farthest: of the other clips no more is known.
    """

    distances: Mapping[str, float]
    near: Mapping[str, float]
    along: Mapping[str, float]
    far: float

    @classmethod
    def of(cls, view: View[str]) -> _Found:
        def by_clip(values: Float64Array) -> dict[str, float]:
            return dict(zip(view.clips, values.tolist(), strict=True))

        along = {} if view.ways is None else by_clip(view.ways[-1, :-1])
        far = float(view.near[-1]) if len(view.near) else 0.0
        return cls(by_clip(view.distances), by_clip(view.near), along, far)

    def score(self, clip: str) -> float:
        near = self.near.get(clip, self.far)
        return (self.along.get(clip, 0.0) + DIRECT * near) / (1 + DIRECT) if self.along else near


class FusedSearcher(LakeSearcher):
    """One ranking by several methods; a `Searcher`.

    Every method names its 300 nearest clips, and all of them are ranked by all methods. By a method with distance d,
    and u to the tenth nearest clip, a clip is as near as 1 / (1 + d / u); n is the mean of that, by the weights of
    methods. Where the lake has a neighbour graph, a clip is near that is near to what is near (`diffused`); a is the
    mean of that by the methods, and b how near it is along the graph of a (`near_again`). The distance of a clip is one
    less n, or less (a + b + .3 n) / 2.3. A clip that a method does not name is to it as far as the last that it does; a
    method that cannot compare the query is left out.

    Attributes:
        left_out: by the name of a query of the last search, why methods could not compare it.

    Args:
        lake: which holds the graph.
        searchers: by name; by default those of `WEIGHTS` that the lake is ready for, or else any that it is ready for.
        graph: go along the neighbour graph.
        explain: give every answer its `shares`.
        matched: and in these what of both is alike, which takes as long as the search.

    Raises:
        UserError: the lake is not ready for any method.
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
    ) -> None:
        super().__init__(lake)
        self._cascade = _cascade(lake) if searchers is None else None
        if searchers is not None:
            order = [*WEIGHTS, *searchers]  # of summation: the same answers whichever way they are given
            self._searchers = {name: searchers[name] for name in dict.fromkeys(order) if name in searchers}
        if self._cascade is None and not self._searchers:
            raise UserError(f"{lake.root}: is not ready for search; make it so with `motionlake run all`")
        self._along, self._explain, self._match = graph, explain, explain and matched
        self.left_out: dict[str, list[str]] = {}

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        """As `Searcher.distances`, without the graph; u is the distance of the tenth nearest of the gallery."""
        of_each = {name: each.distances(queries, gallery) for name, each in self._searchers.items()}
        return fused_distances(of_each)

    def nearest(self, queries: Sequence[Query], k: int, scope: Scope, *, mirrored: bool) -> list[list[Hit]]:
        self.left_out = {}
        return [self._answers(query, k, scope, mirrored=mirrored) for query in queries]

    def _answers(self, query: Query, k: int, scope: Scope, *, mirrored: bool) -> list[Hit]:
        found = dict(self._asked(query, REACH + 1, scope, mirrored=mirrored))
        known = {hit.clip: hit for hits in found.values() for hit in hits}
        own = query.clip if query.whole and not mirrored else None
        same = _same(found)
        views = {name: self._view(name, hits, own, same) for name, hits in found.items()}
        again = near_again(views, _weights(views), len(self._graph.nodes)) if self._along else {}
        by_clip = {name: _Found.of(view) for name, view in views.items()}
        best = self._ranked(by_clip, again, known, query, scope, own, k)
        if len(best) < k and max(map(len, found.values())) > REACH:
            # Who asks for more than the nearest gets the others after them, by distance alone.
            rest = dict(self._asked(query, EVERY if self._cascade is None else k + 1, scope, mirrored=mirrored))
            others = {hit.clip: hit for hits in rest.values() for hit in hits if hit.clip not in known}
            plain = {name: _Found.of(self._view(name, hits, own, same, graph=False)) for name, hits in rest.items()}
            farthest = max((hit.distance for hit in best), default=0.0)
            behind = self._ranked(plain, {}, others, query, scope, own, k)
            best += [replace(hit, distance=max(farthest, hit.distance)) for hit in behind]
        return self._matched(query, best[:k], mirrored=mirrored) if self._match else best[:k]

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

    def _asked(self, query: Query, k: int, scope: Scope, *, mirrored: bool) -> Iterator[tuple[str, list[Hit]]]:
        """The k nearest by each method that can compare the query, itself among them.

        Raises:
            UserError: none can.
        """
        failed: list[UserError] = []
        if self._cascade is not None:
            yield from self._cascade.nearest(query, k, replace(scope, own=True), mirrored=mirrored, failed=failed)
            self.left_out[query.name] = [str(error) for error in failed]
            return
        count = 0
        for name, each in self._searchers.items():
            try:
                (hits,) = each.nearest([query], k, replace(scope, own=True), mirrored=mirrored)
            except DamagedError:
                raise
            except UserError as error:
                failed.append(error)
            else:
                count += 1
                yield name, hits
        if failed and not count:
            raise failed[0]
        self.left_out[query.name] = [str(error) for error in failed]

    def _view(
        self, name: str, hits: Sequence[Hit], own: str | None, same: Container[str], *, graph: bool = True
    ) -> View[str]:
        others = [hit for hit in hits if hit.clip != own]
        clips, distances = [hit.clip for hit in others], np.array([hit.distance for hit in others])
        unit = scale(distances)
        equal = np.array([clip in same for clip in clips], dtype=np.bool_)
        near = np.where(equal, 1.0, _near(distances, np.float64(unit)))
        ways = None
        if graph and self._along and name in self._graph.methods:
            nodes, start = self._graph.of(clips), self._graph.nodes.get(own or "", NOWHERE)
            ways = diffused(self._graph.methods[name], nodes, distances, start)
            ways[-1, :-1][equal] = ways[:-1, -1][equal] = 1.0
        return View(clips, distances, near, ways)

    def _ranked(
        self,
        views: Mapping[str, _Found],
        again: Mapping[str, float],
        known: Mapping[str, Hit],
        query: Query,
        scope: Scope,
        own: str | None,
        k: int,
    ) -> list[Hit]:
        """The first k of the known clips that may be answers, in order."""
        weights = _weights(views)
        total = sum(weights.values())
        distances = {}
        for clip in known:
            if clip == query.clip and not scope.own:
                continue
            scores = {name: 1.0 if clip == own else view.score(clip) for name, view in views.items()}
            near = sum(weights[name] * score for name, score in scores.items()) / total
            if again:
                near = ((1 + DIRECT) * near + (1.0 if clip == own else again.get(clip, 0.0))) / (2 + DIRECT)
            distances[clip] = max(0.0, 1 - near)
        nearest = sorted(distances, key=lambda clip: (distances[clip], clip))[:k]
        return [replace(known[clip], distance=distances[clip], shares=self._shares(views, again, clip))
                for clip in nearest]  # fmt: skip

    def _shares(self, views: Mapping[str, _Found], again: Mapping[str, float], clip: str) -> tuple[Share, ...] | None:
        if not self._explain:
            return None
        weights = _weights(views)
        each = ((1 + DIRECT) / (2 + DIRECT) if again else 1.0) / sum(weights.values())
        shares = [
            Share(
                name, weights[name] * each, view.distances.get(clip), view.near.get(clip, view.far),
                view.along.get(clip, 0.0) if view.along else None,
            )
            for name, view in views.items()
        ]  # fmt: skip
        if again:
            way = again.get(clip, 0.0)
            shares.append(Share(TOGETHER, 1 / (2 + DIRECT), None, way, way))
        return tuple(shares)

    @cached_property
    def _searchers(self) -> dict[str, LakeSearcher]:
        return _ready(self.lake)

    @cached_property
    def _graph(self) -> LakeNeighbours:
        from motionlake.retrieval.lake_neighbours import read_neighbours

        return read_neighbours(self.lake)


def _same(found: Mapping[str, Sequence[Hit]]) -> set[str]:
    """Clips that are the query but for the rounding of stored frames: by moves, which know it, or else by all methods.

    Few takes that are alike, and else far ones, are as near by the other methods as rounding makes a clip to itself.
    """
    if "moves" in found:
        return {hit.clip for hit in found["moves"] if hit.distance <= _SAME}
    equal = [{hit.clip for hit in hits if hit.distance == 0} for hits in found.values()]
    return set.intersection(*equal) if equal else set()


def _weights(methods: Iterable[str]) -> dict[str, float]:
    return {name: WEIGHTS.get(name, 1.0) for name in methods}


def fused_distances(of_each: Mapping[str, Float64Array]) -> Float64Array:
    """[q, g] one less the mean of how near clips are by several methods, by their weights.

    By a method a clip at distance d is as near as 1 / (1 + d / u), u the distance of the tenth nearest of the g.

    Args:
        of_each: [q, g] distances by each method, one at least; infinite where a clip is no answer.
    """
    near = [WEIGHTS.get(name, 1.0) * _near(found, _units(found)) for name, found in of_each.items()]
    return np.asarray(1 - sum(near) / sum(WEIGHTS.get(name, 1.0) for name in of_each))


def _units(distances: Float64Array) -> Float64Array:
    """[q, 1] `scale` of each row of [q, g]."""
    finite = [np.sort(row[np.isfinite(row)]) for row in distances]
    return np.array([scale(row) for row in finite]).reshape(-1, 1)


def _near(distances: Float64Array, units: Float64Array | np.float64) -> Float64Array:
    return np.asarray(1 / (1 + distances / units))


def _cascade(lake: Lake) -> Cascade | None:
    """The search of a lake of more than `MOST` clips that has a shortlist."""
    with reading(lake) as con:
        (count,), files = fetch(con, "count_clips"), [row["file"] for row in fetch(con, "shortlist_files")]
    if count["clips"] <= MOST or not files:
        return None
    from motionlake.retrieval.shortlist import Cascade

    return Cascade(lake, files)


def _ready(lake: Lake) -> dict[str, LakeSearcher]:
    """Those of `WEIGHTS`, or else any; in a lake of more than `MOST` clips those that need not hold all in memory."""
    names = [name for name in ready(lake, "clip") if name != FusedSearcher.name]
    with reading(lake) as con:
        (count,) = fetch(con, "count_clips")
    wanted = WEIGHTS if count["clips"] <= MOST else LARGE
    chosen = [name for name in wanted if name in names] or names
    return {name: cast(LakeSearcher, searcher("clip", name, lake)) for name in chosen}
