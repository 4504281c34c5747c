"""Kernels that are compiled at their first call, and what works alignments out before that."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake import kernels
from motionlake.motion import dtw, stacks
from motionlake.motion.dtw import clip_dtw, clip_dtws
from motionlake.motion.stacks import Halves, Stack, aligned, aligned_halves
from motionlake.pesta import nearest, scan
from motionlake.pesta.config import AlignmentConfig
from motionlake.pesta.nearest import nearest_strings
from motionlake.pesta.plain_scan import GROUP, least_costs
from motionlake.pesta.scan import best_per_clip
from motionlake.pesta.strings import Repository

# A kernel that a function makes, which calls others, one of them made by a function as well.
MADE = """
from motionlake.kernels import njit


@njit(cache=True)
def plus_one(x):
    return x + 1


def maker(step):
    @njit()
    def times(x):
        return x * step

    @njit(cache=True)
    def both(x):
        return plus_one(times(x))

    return both
"""
USED = """
import sys
from made import maker
assert "numba" not in sys.modules
one, two = maker(2), maker(3)
assert (one(5), two(5)) == (11, 16)
print([sum(kernel.stats.cache_hits.values()) for kernel in (one, two)])
"""
lengths = st.lists(st.integers(1, 12), min_size=1, max_size=12)


def used(folder: Path) -> str:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONPATH": str(folder)}
    run = subprocess.run(
        [sys.executable, "-c", USED], env=environment, capture_output=True, text=True, check=False, cwd=folder
    )
    assert run.returncode == 0, run.stderr
    return run.stdout.strip()


def test_kernels_that_functions_make_are_kept_on_disk(tmp_path: Path) -> None:
    """By what they were made with, and by the kernels they call: numba alone would compile them in every process."""
    module = tmp_path / "made.py"
    module.write_text(MADE, encoding="utf-8")
    assert used(tmp_path) == "[0, 0]"
    assert used(tmp_path) == "[1, 1]"


def test_a_kernel_goes_to_other_processes_by_its_name() -> None:
    named: Any = dtw._aligned
    assert named.__reduce__() == "_aligned"

    def same(x: float) -> float:
        return x

    made: Any = kernels.njit()(same)
    again, given = made.__reduce__()
    with pytest.raises(TypeError, match="a kernel that a function makes is made again"):
        again(*given)


def test_modules_of_kernels_import_no_compiler() -> None:
    code = (
        "import sys, motionlake.retrieval.shortlist, motionlake.retrieval.alignment, motionlake.retrieval.moves\n"
        "assert 'numba' not in sys.modules\n"
        "import numpy as np\n"
        "from motionlake.motion.dtw import clip_dtw\n"
        "assert clip_dtw(np.ones((2, 3), np.float32), np.ones((4, 3), np.float32)) == 0\n"
        "assert 'numba' in sys.modules"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


def test_few_cells_are_few_until_there_were_many(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernels, "_worked_out", 0)
    monkeypatch.delitem(sys.modules, "numba", raising=False)
    assert kernels.few(kernels.FEW // 2)
    assert kernels.few(kernels.FEW - kernels.FEW // 2)
    assert not kernels.few(1)
    monkeypatch.setattr(kernels, "_worked_out", 0)
    kernels.expect_many()
    assert not kernels.few(1)
    monkeypatch.setattr(kernels, "_worked_out", 0)
    monkeypatch.setitem(sys.modules, "numba", kernels)
    assert not kernels.few(1)


@given(
    st.integers(1, 9), st.lists(st.integers(0, 14), min_size=1, max_size=20), st.integers(1, 4), st.integers(0, 2**32)
)
def test_costs_of_strings_without_a_kernel_are_its_own(query: int, sizes: list[int], stride: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    distances = random.random((7, 7)).astype(np.float32)
    strings = Repository.of([random.integers(0, 7, size) for size in sizes])
    asked, config = random.integers(0, 7, query).astype(np.int32), AlignmentConfig(stride=stride)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scan, "few", lambda cells: False)
        costs = best_per_clip(asked, strings, distances, config)
        answers = nearest_strings(asked, strings, distances, 5, config)
        patch.setattr(scan, "few", lambda cells: True)
        np.testing.assert_array_equal(best_per_clip(asked, strings, distances, config), costs)
        patch.setattr(nearest, "few", lambda cells: True)
        assert nearest_strings(asked, strings, distances, 5, config) == answers


def test_strings_of_several_groups_are_in_their_order() -> None:
    random = np.random.default_rng(3)
    distances = random.random((5, 5)).astype(np.float32)
    strings = Repository.of([random.integers(0, 5, size) for size in random.integers(1, 6, 2 * GROUP + 3)])
    asked = Repository.of([random.integers(0, 5, 4)])
    found, back = least_costs(asked, strings, distances, 2), least_costs(strings, asked, distances, 2)
    for clip in (0, 1, GROUP, 2 * GROUP + 2):
        alone = Repository.of([strings.string(clip)])
        assert found[clip] == least_costs(asked, alone, distances, 2)[0]
        assert back[clip] == least_costs(alone, asked, distances, 2)[0]


@given(
    st.integers(1, 9), lengths, st.sampled_from([1, 6, 8, 19, 135]), st.integers(1, 5), st.integers(0, 2**32),
    st.sampled_from([1, 100, 960]),
)  # fmt: skip
def test_distances_of_moves_without_a_kernel_are_its_own(
    frames: int, sizes: list[int], width: int, every: int, seed: int, rows: int
) -> None:
    random = np.random.default_rng(seed)
    halves = random.normal(size=(sum(sizes), width)).astype(np.float16)
    counts = np.array(sizes, dtype=np.int64)
    starts = np.cumsum(counts) - counts
    query = random.normal(size=(frames, width)).astype(np.float32)
    clips = [halves[start : start + count].astype(np.float32) for start, count in zip(starts, counts, strict=True)]

    def distances() -> tuple[list[list[float]], list[float], bytes]:
        stack = Stack.of(clips)
        of_halves = aligned_halves(query, Halves([halves], np.zeros_like(starts), starts, counts), every)
        return aligned(query, stack).tolist(), clip_dtws(query, clips).tolist(), of_halves.tobytes()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stacks, "_ROWS", rows)
        for module in (dtw, stacks):
            patch.setattr(module, "few", lambda cells: False)
        by_kernels = distances()
        for module in (dtw, stacks):
            patch.setattr(module, "few", lambda cells: True)
        assert distances() == by_kernels
    assert by_kernels[1] == [clip_dtw(query, clip) for clip in clips]


def test_a_clip_without_frames_is_refused_without_a_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dtw, "few", lambda cells: True)
    some, none = np.ones((3, 4), dtype=np.float32), np.zeros((0, 4), dtype=np.float32)
    for query, clips in ((some, [some, none]), (none, [some])):
        with pytest.raises(ValueError, match="without frames"):
            clip_dtws(query, clips)
    assert clip_dtws(some, []).tolist() == []
