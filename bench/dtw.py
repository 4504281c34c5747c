"""Word distances against aeon and dtaidistance: `python -m bench.dtw`.

Words of 16 frames by 64 numbers, one thread, one process, interleaved. aeon gets its words as transposed
views, the layout that is fast for it. A peer that is not installed is left out. Bars: at least 2 times aeon,
6 times dtaidistance. The plain sum is what both peers compute; the path average and the geodesic metric are
ours alone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from motionlake.arrays import Float32Array
from motionlake.deep_motifs.words.dtw import word_distances
from threadpoolctl import threadpool_limits

from bench.record import installed, interleave, record

LENGTH, WIDTH = 16, 64
ANCHORS, WORDS = 300, 1000
BARS = {"aeon": 2.0, "dtaidistance": 6.0}


def unit_quaternions(values: Float32Array) -> Float32Array:
    parts = values.reshape(*values.shape[:-1], -1, 4)
    return np.asarray((parts / np.linalg.norm(parts, axis=-1, keepdims=True)).reshape(values.shape))


def main() -> None:
    rng = np.random.default_rng(0)
    a = rng.standard_normal((ANCHORS, LENGTH, WIDTH)).astype(np.float32)
    b = rng.standard_normal((WORDS, LENGTH, WIDTH)).astype(np.float32)
    wide_a, wide_b = a.astype(np.float64).transpose(0, 2, 1), b.astype(np.float64).transpose(0, 2, 1)
    series = list(np.concatenate([a, b[:200]]).astype(np.float64))
    block = ((0, ANCHORS), (ANCHORS, len(series)))
    quaternions_a, quaternions_b = unit_quaternions(a), unit_quaternions(b)

    def aeon() -> Any:
        from aeon.distances import dtw_pairwise_distance

        return dtw_pairwise_distance(wide_a, wide_b)

    def dtaidistance() -> Any:
        from dtaidistance import dtw_ndim

        return dtw_ndim.distance_matrix_fast(series, ndim=WIDTH, block=block, parallel=False)

    found = installed(BARS)
    peers: dict[str, Callable[[], Any]] = {"aeon": aeon, "dtaidistance": dtaidistance}
    functions: dict[str, Callable[[], Any]] = {
        "sum": lambda: word_distances(a, b, average=False),
        "average": lambda: word_distances(a, b),
        "geodesic": lambda: word_distances(quaternions_a, quaternions_b, "geodesic"),
    }
    functions |= {peer: peers[peer] for peer in found}
    with threadpool_limits(limits=1):
        ours = functions["sum"]()
        if "aeon" in found:
            np.testing.assert_allclose(ours, aeon(), rtol=1e-4)
        if "dtaidistance" in found:
            theirs = np.square(dtaidistance()[:ANCHORS, ANCHORS:])
            np.testing.assert_allclose(ours[:, :200], theirs, rtol=1e-4)
        seconds = interleave(functions)
    pairs = dict.fromkeys(functions, ANCHORS * WORDS)
    if "dtaidistance" in found:
        pairs["dtaidistance"] = ANCHORS * 200
    rates = {name: pairs[name] / seconds[name] for name in functions}
    ratios = {peer: rates["sum"] / rates[peer] for peer in found}
    for name, rate in rates.items():
        print(f"{name:15} {rate / 1e6:8.3f} M pairs/s")
    for peer, ratio in ratios.items():
        print(f"{ratio:.1f} times {peer} (bar {BARS[peer]:g}: {'met' if ratio >= BARS[peer] else 'MISSED'})")
    figures = {"pairs_per_second": rates, "ratios": ratios, "bars": BARS}
    print(record("dtw", figures, packages=("aeon", "dtaidistance")))


if __name__ == "__main__":
    main()
