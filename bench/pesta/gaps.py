"""What it is worth to leave symbols out: whole clips with pieces replaced, as `bench.pesta.robustness`, on three sets.

The prices of `AlignmentConfig.gaps` were chosen on hdm05, by rates 0 and .5 of seed 0; the other sets took no part.
"Forms" are what else strided alignment was given there, by a plain kernel of the bench's own:

- cap: no two symbols cost more than that;
- gaps: symbols are left out of the clip and of the query, each at its price;
- affine: the first of some symbols that are left out costs more than each further one;
- strides: a symbol that is strided over costs so much, where that is less than the distance at the end of the stride.

All prices are in units of the mean distance of two symbols.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Int32Array, Int64Array
from motionlake.kernels import njit
from motionlake.pesta.config import AlignmentConfig
from motionlake.pesta.nearest import Both
from motionlake.pesta.strings import Repository, SymbolDistances

from bench.pesta.dictionaries import fitted
from bench.pesta.measuring import GAPS2, GAPS3, MAIN, STA2, STA3, score_distances, whole_scores
from bench.pesta.robustness import replaced_strings
from bench.pesta.sets import labels_of
from bench.pesta.whole import DTW, SW, specs
from bench.units import Found

CHOSEN_ON: Final = "hdm05"
SETS: Final = (CHOSEN_ON, "bandai1", "utd_mhad")
RATES: Final = (0.0, 0.1, 0.3, 0.5)
FORM_RATES: Final = (0.0, 0.5)
ALIGNMENTS: Final[dict[str, tuple[AlignmentConfig, Both]]] = {
    "STA w = 3": (STA3, "max"),
    "STA w = 2": (STA2, "max"),
    "STA w = 3, gaps": (GAPS3, "max"),
    "STA w = 2, gaps": (GAPS2, "max"),
    "DTW": (DTW, "max"),
    "SW": (SW, "max"),
    "STA w = 3, one way": (STA3, "query"),
    "STA w = 3, gaps, one way": (GAPS3, "query"),
    "SW, one way": (SW, "query"),
}
_NEVER: Final = 1e30


@dataclass(frozen=True)
class Form:
    """Prices of one form: of the first symbol left out of the clip and of each further one, and so of the query."""

    cap: float = _NEVER
    clip: tuple[float, float] = (_NEVER, _NEVER)
    query: tuple[float, float] = (_NEVER, _NEVER)
    stride: float = _NEVER


FORMS: Final[dict[str, Form]] = {
    "none": Form(),
    "cap .7": Form(cap=0.7),
    "cap .35": Form(cap=0.35),
    "strides .05": Form(stride=0.05),
    "affine, both .4 + .05": Form(clip=(0.4, 0.05), query=(0.4, 0.05)),
    "affine, clip .1 + .02, query .8 + .4": Form(clip=(0.1, 0.02), query=(0.8, 0.4)),
    "gaps of the clip alone, .05": Form(clip=(0.05, 0.05)),
    "cap .6, gaps of the clip .05": Form(cap=0.6, clip=(0.05, 0.05)),
    **{
        f"gaps, clip {clip:g}, query {query:g}": Form(clip=(clip, clip), query=(query, query))
        for clip in (0.02, 0.05, 0.1)
        for query in (0.4, 0.6, 0.8)
    },
}  # fmt: skip


@dataclass(frozen=True)
class Unit:
    """The alignments of a set, or its forms."""

    set_name: str
    seed: int
    forms: bool = False

    def __str__(self) -> str:
        return f"{self.set_name}, {'forms' if self.forms else 'alignments'}, seed {self.seed}"


def units(seeds: Sequence[int]) -> list[Unit]:
    return [Unit(name, seed) for name in SETS for seed in seeds] + [Unit(CHOSEN_ON, seed, True) for seed in seeds]


def measure(unit: Unit) -> dict[str, Found]:
    """MAP by the share replaced; the seed is that of the dictionary and of the pieces."""
    spec, labels = specs(None)[MAIN].seeded(unit.seed), labels_of(unit.set_name)
    ground = SymbolDistances.of(fitted(unit.set_name, spec).distances)
    rows: dict[str, Found] = {}
    for rate in FORM_RATES if unit.forms else RATES:
        strings = replaced_strings(unit.set_name, spec, rate, unit.seed)
        if unit.forms:
            repository = Repository.of([each.symbols for each in strings])
            found = {
                name: score_distances(form_costs(repository, ground, form), labels) for name, form in FORMS.items()
            }
        else:
            found = {name: whole_scores(strings, ground, labels, *how) for name, how in ALIGNMENTS.items()}
        rows |= {f"{'form: ' * unit.forms}{name}, rate {rate:g}": scores for name, scores in found.items()}
    return rows


def form_costs(strings: Repository, distances: SymbolDistances, form: Form, stride: int = STA3.stride) -> Float32Array:
    """[n, n] as `symmetric_costs`, both ways, the greater."""
    cap, (clip, more_clip), (query, more_query), over = astuple(form)
    prices = np.array([cap, clip, more_clip, query, more_query, over], dtype=np.float32)
    costs = _costs(strings.symbols, strings.offsets, distances.matrix / np.float32(distances.mean), stride, prices)
    costs /= strings.lengths[:, None].astype(np.float32)
    return np.asarray(np.maximum(costs, costs.T), dtype=np.float32)


@njit(cache=True, nogil=True)
def _costs(
    symbols: Int32Array, offsets: Int64Array, distances: Float32Array, stride: int, prices: Float32Array
) -> Float32Array:
    n = len(offsets) - 1
    costs = np.empty((n, n), dtype=np.float32)
    for i in range(n):
        query = symbols[offsets[i] : offsets[i + 1]]
        for j in range(n):
            costs[i, j] = _cost(query, symbols[offsets[j] : offsets[j + 1]], distances, stride, prices)
    return costs


@njit(cache=True, nogil=True)
def _cost(
    query: Int32Array, string: Int32Array, distances: Float32Array, stride: int, prices: Float32Array
) -> np.float32:
    """The least cost of a query in a string."""
    cap, clip, more_clip, left, more_left, over = prices
    shape = (len(query), len(string))
    w = np.empty(shape, dtype=np.float32)
    without_clip, without_query = np.full(shape, np.float32(np.inf)), np.full(shape, np.float32(np.inf))
    best = np.float32(np.inf)
    for y in range(len(string)):
        for x in range(len(query)):
            distance = min(distances[query[x], string[y]], cap)
            low = distance if x == 0 else np.float32(np.inf)
            for p in range(1, stride + 1 if x else 1):
                nearest = np.float32(np.inf)
                for k in range(p + 1):
                    if x >= p and y >= k:
                        nearest = min(nearest, w[x - p, y - k])
                    if y >= p and x >= k:
                        nearest = min(nearest, w[x - k, y - p])
                low = min(low, nearest + min(distance * p, distance + over * (p - 1)))
            if y:
                without_clip[x, y] = min(w[x, y - 1] + clip, without_clip[x, y - 1] + more_clip)
            without_query[x, y] = min(w[x - 1, y] + left, without_query[x - 1, y] + more_left) if x else left
            w[x, y] = min(low, min(without_clip[x, y], without_query[x, y]))
        best = min(best, w[len(query) - 1, y])
    return best


def verdict(rows: Mapping[str, Mapping[str, Found]]) -> str:
    """Where gaps are ahead of Smith-Waterman, and of none, by MAP."""
    lines = []
    for name, own in rows.items():
        for rate in RATES:
            gaps, plain, local = (
                own[f"{row}, rate {rate:g}"]["mean"]["map"] for row in ("STA w = 3, gaps", "STA w = 3", "SW")
            )
            lines.append(f"  {name}, rate {rate:g}: gaps {gaps:.3f}, without {plain:.3f}, Smith-Waterman {local:.3f}")
    return "\n".join(lines)
