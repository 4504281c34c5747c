"""How near clips are by several methods together, of what each makes of one query."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Generic

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.diffusion import scale
from motionlake.retrieval.asked import Clip, Ranking
from motionlake.retrieval.hits import TOGETHER, Share
from motionlake.retrieval.views import View

# How much each counts: looked at on all sets (docs/search.md says what choices with one set left out make of it).
WEIGHTS: Final = {"signature": 1.5, "alignment": 0.5, "moves": 4.0, "descriptor": 1.5}
# A method counts more in a lake by whose neighbours more are mutual by it: by this power of their share over the mean.
AGREEMENT: Final = 4.0
DIRECT: Final = 0.3  # what the distance itself counts beside a way along the graph
_SAME: Final = 5e-3  # of moves, whose root mean square is one, as far as rounding takes a clip from itself


@dataclass(frozen=True)
class Found(Generic[Clip]):
    """What one method makes of one query, by clip.

    Attributes:
        distances: of clips.
        near: by these alone, from 0 to 1.
        along: by the way along the graph; empty without one.
        far: `near` of the farthest: of the other clips no more is known.
    """

    distances: Mapping[Clip, float]
    near: Mapping[Clip, float]
    along: Mapping[Clip, float]
    far: float

    @classmethod
    def of(cls, view: View[Clip]) -> Found[Clip]:
        def by_clip(values: Float64Array) -> dict[Clip, float]:
            return dict(zip(view.clips, values.tolist(), strict=True))

        along = {} if view.ways is None else by_clip(view.ways[-1, :-1])
        far = float(view.near[-1]) if len(view.near) else 0.0
        return cls(by_clip(view.distances), by_clip(view.near), along, far)

    def scores(self, clips: Sequence[Clip]) -> Float64Array:
        """[n] how near some clips are, along the graph where there is one."""
        near = np.array([self.near.get(clip, self.far) for clip in clips])
        if not self.along:
            return near
        return np.asarray(([self.along.get(clip, 0.0) for clip in clips] + DIRECT * near) / (1 + DIRECT))


@dataclass(frozen=True)
class Weighed(Generic[Clip]):
    """What all methods make of one query.

    Attributes:
        views: by each method.
        again: how near clips are along the graph of all; empty without one.
        own: the clip that the query is.
        weights: how much each method counts.
    """

    views: Mapping[str, Found[Clip]]
    again: Mapping[Clip, float]
    own: Clip | None
    weights: Mapping[str, float]

    def nearest(self, clips: Iterable[Clip]) -> list[tuple[float, Clip]]:
        """Distances of some clips, the nearest first, of equal ones that with the first name."""
        known = list(clips)
        if not known:
            return []
        own = np.array([clip == self.own for clip in known])
        scores = [self.weights[name] * np.where(own, 1.0, view.scores(known)) for name, view in self.views.items()]
        near = sum(scores) / sum(self.weights.values())
        if self.again:
            again = np.where(own, 1.0, [self.again.get(clip, 0.0) for clip in known])
            near = ((1 + DIRECT) * near + again) / (2 + DIRECT)
        return sorted(zip(np.maximum(0.0, 1 - near).tolist(), known, strict=True))

    def shares(self, clip: Clip) -> tuple[Share, ...]:
        each = ((1 + DIRECT) / (2 + DIRECT) if self.again else 1.0) / sum(self.weights.values())
        shares = [
            Share(
                name, self.weights[name] * each, view.distances.get(clip), view.near.get(clip, view.far),
                view.along.get(clip, 0.0) if view.along else None,
            )
            for name, view in self.views.items()
        ]  # fmt: skip
        if self.again:
            way = self.again.get(clip, 0.0)
            shares.append(Share(TOGETHER, 1 / (2 + DIRECT), None, way, way))
        return tuple(shares)


def same_clips(found: Mapping[str, Ranking[Clip]]) -> set[Clip]:
    """Clips that are the query but for the rounding of stored frames: by moves, which know it, or else by all methods.

    Few takes that are alike, and else far ones, are as near by the other methods as rounding makes a clip to itself.
    """
    if "moves" in found:
        return _within(found["moves"], _SAME)
    equal = [_within(each, 0.0) for each in found.values()]
    return set.intersection(*equal) if equal else set()


def _within(found: Ranking[Clip], most: float) -> set[Clip]:
    return {clip for clip, distance in zip(found.clips, found.distances.tolist(), strict=True) if distance <= most}


def weights_of(methods: Iterable[str], mutual: Mapping[str, float]) -> dict[str, float]:
    """How much each of some methods counts in a lake.

    Args:
        methods: by name.
        mutual: how many neighbours are mutual by each that has a graph; empty without graphs.
    """
    usual = float(np.mean(list(mutual.values()))) if any(mutual.values()) else 1.0
    known = mutual if any(mutual.values()) else {}
    return {name: WEIGHTS.get(name, 1.0) * (known.get(name, usual) / usual) ** AGREEMENT for name in methods}


def fused_distances(of_each: Mapping[str, Float64Array]) -> Float64Array:
    """[q, g] one less the mean of how near clips are by several methods, by their weights.

    By a method a clip at distance d is as near as 1 / (1 + d / u), u the distance of the tenth nearest of the g.

    Args:
        of_each: [q, g] distances by each method, one at least; infinite where a clip is no answer.
    """
    near = [WEIGHTS.get(name, 1.0) * as_near(found, _units(found)) for name, found in of_each.items()]
    return np.asarray(1 - sum(near) / sum(WEIGHTS.get(name, 1.0) for name in of_each))


def _units(distances: Float64Array) -> Float64Array:
    """[q, 1] `scale` of each row of [q, g]."""
    finite = [np.sort(row[np.isfinite(row)]) for row in distances]
    return np.array([scale(row) for row in finite]).reshape(-1, 1)


def as_near(distances: Float64Array, units: Float64Array | np.float64) -> Float64Array:
    return np.asarray(1 / (1 + distances / units))
