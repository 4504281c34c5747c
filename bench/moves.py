"""Alignment of the moves of whole clips against aeon: `python -m bench.moves`.

Queries are aligned with every clip of a set of recordings; one thread, one process, interleaved. aeon gets its clips as
transposed views, the layout that is fast for it, and its sum of squared distances, which takes no roots. `nearest` is
the search of the ten nearest by bounds, which gives the answers of a scan. The bar is at least 5 times aeon a pair.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from motionlake.deephums.sequence import clip_sequence
from motionlake.motion.moves import Track, at_12
from motionlake.motion.moves_index import MovesIndex, moves_distance
from motionlake.motion.stacks import Stack, aligned
from threadpoolctl import threadpool_limits

from bench.canonical_sets import load
from bench.record import installed, interleave, record

SETS = ("hdm05", "bandai1", "utd_mhad")
QUERIES = 12
BAR = 5.0


def main() -> None:
    figures: dict[str, Any] = {}
    for name in SETS:
        tracks = [Track.of(at_12(clip_sequence(clip.positions, clip.fps))) for clip in load(name)]
        clips = [track.moves() for track in tracks]
        queries = clips[:: max(1, len(clips) // QUERIES)]
        figures[name] = measured(clips, queries)
        rates, ratios = figures[name]["pairs_per_second"], figures[name]["ratios"]
        print(f"{name}: " + ", ".join(f"{how} {rate / 1e3:.0f} k pairs/s" for how, rate in rates.items()))
        for how, ratio in ratios.items():
            print(f"  {how}: {ratio:.1f} times aeon (bar {BAR:g}: {'met' if ratio >= BAR else 'MISSED'})")
    print(record("moves", figures, packages=("aeon",)))


def measured(clips: list[Any], queries: list[Any]) -> dict[str, Any]:
    """Pairs a second, and how many times those of aeon."""
    stack, index = Stack.of(clips), MovesIndex(clips)
    wide = [np.ascontiguousarray(clip.astype(np.float64).T) for clip in clips]
    asked = [np.ascontiguousarray(clip.astype(np.float64).T) for clip in queries]

    def aeon() -> Any:
        from aeon.distances import dtw_pairwise_distance

        return dtw_pairwise_distance(asked, wide)

    functions: dict[str, Callable[[], Any]] = {
        "all": lambda: [aligned(query, stack) for query in queries],
        "nearest": lambda: [index.nearest(query, 10) for query in queries],
        "one by one": lambda: [[moves_distance(query, clip) for clip in clips] for query in queries],
    }
    if installed(["aeon"]):
        functions["aeon"] = aeon
    with threadpool_limits(limits=1):
        seconds = interleave(functions)
    rates = {how: len(queries) * len(clips) / taken for how, taken in seconds.items()}
    ratios = {how: rates[how] / rates["aeon"] for how in ("all", "nearest") if "aeon" in rates}
    return {"clips": len(clips), "pairs_per_second": rates, "ratios": ratios, "bar": BAR}


if __name__ == "__main__":
    main()
