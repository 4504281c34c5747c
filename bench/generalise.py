"""Constants of the default search, chosen with one set of recordings left out in turn: `python -m bench.generalise`.

Every set becomes a lake with the default configuration and a seed of its motifs. Each labelled clip is searched for
among all others. For every set the constants are those with the greatest mean average precision, mean over the seeds of
the other sets (`best`), or else those by which none of the other sets loses much (`steadiest`); what they reach on the
set itself is what to expect of recordings that nobody tuned on. Beside them stand every method and every combination of
methods, along the graph and without it; so do dynamic time warping of the joints that moves see, and late interaction
of windows. What displacement counts in moves is chosen in the same way, with the other constants as they are.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final, TypeVar
from unittest import mock

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.evaluation.ranking import SearchScores
from motionlake.motion import diffusion
from motionlake.motion.diffusion import NeighbourGraph, diffused, scale
from motionlake.retrieval import weighing
from motionlake.retrieval.fused import REACH
from motionlake.retrieval.views import View, near_again
from motionlake.retrieval.weighing import AGREEMENT, DIRECT, WEIGHTS, weights_of
from motionlake.stages.graph import KEPT

from bench.record import hash_files, record, recordings
from bench.search_lakes import DISPLACEMENTS, METHODS, SEEDED, TASKS, WINDOWS, Measured, counting, kept

SEEDS: Final = (0, 1, 2)
# How much each of them counts.
SHARES: Final = ((2, 1, 4, 1), (2, 1, 4, 1.5), (1.5, 1, 4, 1), (1.5, 0.5, 4, 1.5))
RECIPROCALS: Final = (24,)
DIRECTS: Final = (0.3, 1.0)
AGREEMENTS: Final = (0.0, 2.0, 4.0)
WINDOW_SHARES: Final = (1.0,)


@dataclass(frozen=True)
class Constants:
    """Of the default search.

    Attributes:
        reciprocal: `diffusion.RECIPROCAL`.
        direct: `fused.DIRECT`.
        shares: what each method counts.
        agreement: `weighing.AGREEMENT`.
    """

    reciprocal: int
    direct: float
    shares: tuple[float, ...]
    agreement: float


NOW: Final = Constants(diffusion.RECIPROCAL, DIRECT, tuple(WEIGHTS.get(method, 0.0) for method in METHODS), AGREEMENT)


def every_constants() -> Iterator[Constants]:
    return itertools.starmap(Constants, itertools.product(RECIPROCALS, DIRECTS, SHARES, AGREEMENTS))


How = TypeVar("How")


@dataclass(frozen=True)
class Near:
    """Of all clips [n, n], by one method or by several."""

    direct: Float64Array
    along: Float64Array


def _views(distances: Float64Array) -> tuple[list[View[int]], float]:
    """What every clip as a query makes of the others, and how many neighbours are mutual."""
    count = len(distances)
    others = [np.flatnonzero(np.arange(count) != row) for row in range(count)]
    order = [clips[np.argsort(distances[row, clips], kind="stable")] for row, clips in enumerate(others)]
    kept = np.stack([clips[:KEPT] for clips in order])
    apart = distances[np.arange(count)[:, None], kept]
    graph = NeighbourGraph(np.where(np.isfinite(apart), kept, -1), apart, count)
    found = []
    for row, clips in enumerate(order):
        there = clips[np.isfinite(distances[row, clips])]
        near = 1 / (1 + distances[row, there] / scale(distances[row, there]))
        nodes = there[:REACH]
        ways = diffused(graph, nodes, distances[row, nodes], row) if len(nodes) else None
        found.append(View(there.tolist(), distances[row, there], near, ways))
    return found, graph.mutual()


def near_of(
    one: Measured, rows: Sequence[Mapping[str, View[int]]], shares: Mapping[str, float], *, together: bool
) -> Near:
    """How near clips are by some methods: by distances, and along the graph, by all of them together too."""
    direct, along = np.zeros((2, one.clips, one.clips))
    total = sum(shares.values())
    for row, of_each in enumerate(rows):
        nearest = {}
        for method, share in shares.items():
            view = of_each[method]
            direct[row, list(view.clips)] += share / total * view.near
            if view.ways is not None:
                nodes = list(view.clips[: len(view.ways) - 1])
                along[row, nodes] += share / total * view.ways[-1, :-1]
                nearest[method] = replace(view, clips=nodes)
        if together:
            again = near_again(nearest, shares, one.clips)
            along[row, list(again)] += list(again.values())
    return Near(direct, along)


def best(scores: Mapping[How, Mapping[str, float]], sets: Sequence[str]) -> How:
    """The choice with the greatest mean over some sets; of equal ones the first."""
    return max(scores, key=lambda how: float(np.mean([scores[how][name] for name in sets])))


def steadiest(scores: Mapping[How, Mapping[str, float]], sets: Sequence[str]) -> How:
    """The choice that no set would much rather do without: the most that any of some sets loses by it, against the
    choice that is best for that set alone, is least. A mean lets one set with much to win decide for all."""
    most = {name: max(each[name] for each in scores.values()) for name in sets}
    return min(scores, key=lambda how: max(most[name] - scores[how][name] for name in sets))


RULES: Final = (best, steadiest)


class Scores:
    """Scores by what was measured, set and seed."""

    def __init__(self) -> None:
        self._runs: dict[Any, dict[str, list[SearchScores]]] = {}

    def add(self, what: Constants | str, name: str, scores: SearchScores) -> None:
        self._runs.setdefault(what, {}).setdefault(name, []).append(scores)

    def means(self, what: Constants | str, name: str) -> dict[str, float]:
        """Over the seeds."""
        return _mean(self._runs[what][name])

    def kinds(self, kind: type) -> list[Any]:
        return [what for what in self._runs if isinstance(what, kind)]


def measure(names: Sequence[str], seeds: Sequence[int], keep: Path | None) -> dict[str, object]:
    """Scores of every choice of constants, of each method alone and of every combination of methods; a folder keeps the
    distances, which take longest."""
    found = Scores()
    for name in names:
        lakes = kept(keep, name, seeds)
        for reciprocal in sorted({*RECIPROCALS, NOW.reciprocal}):
            _of_set(found, name, lakes, reciprocal)
        print(f"{name}: {found.means(NOW, name)}", flush=True)
    order = {how: {name: found.means(how, name)["map"] for name in names}
             for how in sorted(found.kinds(Constants), key=str)}  # fmt: skip
    left_out: dict[str, dict[str, object]] = {rule.__name__: {} for rule in RULES}
    for rule, name in itertools.product(RULES, names):
        chosen = rule(order, [other for other in names if other != name] or [name])
        left_out[rule.__name__][name] = {"constants": asdict(chosen), **found.means(chosen, name)}
    on_all = {}
    for rule in RULES:
        chosen = rule(order, names)
        on_all[rule.__name__] = {"constants": asdict(chosen), **order[chosen]}
    of_moves = {_with(count): {name: found.means(_with(count), name)["map"] for name in names}
                for count in DISPLACEMENTS}  # fmt: skip
    displacement = {}
    for name in names:
        counted = best(of_moves, [other for other in names if other != name] or [name])
        displacement[name] = {"chosen": counted, **found.means(counted, name)}
    return {
        "sets": list(names),
        "seeds": list(seeds),
        "left out": left_out,
        "displacement left out": displacement,
        "on all": on_all,
        "by constants": {str(how): by_set for how, by_set in order.items()},
        "now": {"constants": asdict(NOW), **{name: found.means(NOW, name) for name in names}},
        "methods": {what: {name: found.means(what, name) for name in names} for what in found.kinds(str)},
    }


def _of_set(found: Scores, name: str, lakes: Sequence[Measured], reciprocal: int) -> None:
    """One set, with the lake of each seed; what no seed of motifs changes is computed once."""
    with mock.patch.object(diffusion, "RECIPROCAL", reciprocal):
        fixed = {method: _views(far) for method, far in lakes[0].distances.items() if method != SEEDED}
        for one in lakes:
            of_each = {SEEDED: _views(one.distances[SEEDED]), **fixed}
            mutual = {method: share for method, (_, share) in of_each.items()}
            rows = [{method: views[row] for method, (views, _) in of_each.items()} for row in range(one.clips)]
            for shares, agreement in {(how.shares, how.agreement) for how in (NOW, *every_constants())}:
                near = near_of(one, rows, _counted(shares, mutual, agreement), together=True)
                for direct in sorted({*DIRECTS, NOW.direct}):
                    how = Constants(reciprocal, direct, shares, agreement)
                    found.add(how, name, one.scores(near.along + direct * near.direct))
            if reciprocal == NOW.reciprocal:
                counted = _counted(NOW.shares, mutual, NOW.agreement)
                for count in DISPLACEMENTS:
                    other = [{**each, "moves": each[counting(count)]} for each in rows]
                    near = near_of(one, other, counted, together=True)
                    found.add(_with(count), name, one.scores(near.along + NOW.direct * near.direct))
                for what, some in _combinations(counted, first=one is lakes[0]):
                    near = near_of(one, rows, some, together=len(some) > 1)
                    found.add(f"{what}, no graph", name, one.scores(near.direct))
                    found.add(what, name, one.scores(near.along + NOW.direct * near.direct))


def _with(displacement: float) -> str:
    return f"all, {counting(displacement)}"


def _counted(shares: Sequence[float], mutual: Mapping[str, float], agreement: float) -> dict[str, float]:
    """What methods count in a lake in which so many neighbours are mutual by each."""
    base = {method: share for method, share in zip(METHODS, shares, strict=True) if share}
    with mock.patch.multiple(weighing, WEIGHTS=base, AGREEMENT=agreement):
        return weights_of(base, {method: mutual[method] for method in METHODS})


def _combinations(now: Mapping[str, float], *, first: bool) -> Iterator[tuple[str, dict[str, float]]]:
    """Every combination of methods, as each counts now, and what stands beside them; all of them for the first seed,
    then those that its motifs change."""
    chosen = [dict(some) for size in range(1, len(now) + 1) for some in itertools.combinations(now.items(), size)]
    chosen += [{"dtw": 1.0}, {WINDOWS: 1.0}, *({counting(count): 1.0} for count in DISPLACEMENTS)]
    chosen += [*({**now, WINDOWS: share} for share in WINDOW_SHARES)]
    for counted in chosen:
        if first or SEEDED in counted:
            said = "+".join(method if method != WINDOWS or len(counted) == 1 else f"{share:g} windows"
                            for method, share in counted.items())  # fmt: skip
            yield said, counted


def _mean(runs: Sequence[SearchScores]) -> dict[str, float]:
    rows = [asdict(each) for each in runs]
    return {key: float(np.mean([row[key] for row in rows])) for key in rows[0] if rows[0][key] is not None}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sets", nargs="*", default=list(TASKS), help="which to measure (default: all)")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(SEEDS))
    parser.add_argument("--keep", type=Path, help="goes on from the distances in this folder")
    given = parser.parse_args()
    figures = measure(given.sets, given.seeds, given.keep)
    for part in ("left out", "displacement left out", "on all", "now", "methods"):
        print(part, figures[part])
    folders = [recordings() / TASKS[name].folder for name in given.sets]
    files = [path for folder in folders for path in folder.rglob("*") if path.is_file()]
    print(record("generalise", figures, hash_files(files, recordings())))


if __name__ == "__main__":
    main()
