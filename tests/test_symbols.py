"""Symbol strings of clips: what stays of the codes, and which frames each symbol covers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.pesta.config import SymbolsConfig
from motionlake.pesta.symbols import SymbolString, symbolise, unfolded
from motionlake.pesta.tandem import reduce_repeats, reduce_runs

BOTH = SymbolsConfig()
CONFIGS = [SymbolsConfig(runs, repeats) for runs in (True, False) for repeats in (True, False)]
rates = st.sampled_from([12.0, 24.0, 25.0, 30.0, 50.0, 59.94, 60.0, 120.0, 240.0])


def string_of(codes: list[int], config: SymbolsConfig = BOTH) -> SymbolString:
    """Of the codes of a clip with four frames a sample that ends with its last sample."""
    n_frames = 4 * len(codes) - 3
    return symbolise(np.array(codes, np.int32), codes_fps=30.0, fps=120.0, n_frames=n_frames, config=config)


@settings(max_examples=200, deadline=None)
@given(st.lists(st.integers(0, 3), min_size=150, max_size=150), st.integers(1, 60), st.sampled_from(CONFIGS), rates)
def test_ranges_tile_the_clip_and_a_frame_goes_with_its_nearest_sample(
    source: list[int], n_frames: int, config: SymbolsConfig, fps: float
) -> None:
    n_samples = int(np.floor((n_frames - 1) / fps * 30 + 1e-6)) + 1
    codes = np.array(source[:n_samples], np.int32)
    string = symbolise(codes, codes_fps=30.0, fps=fps, n_frames=n_frames, config=config)
    samples = symbolise(codes, codes_fps=30.0, fps=30.0, n_frames=n_samples, config=config)
    assert string.starts[0] == 0
    assert string.stops[-1] == n_frames
    np.testing.assert_array_equal(string.starts[1:], string.stops[:-1])
    np.testing.assert_array_equal(string.symbols, codes[samples.starts])
    for frame in range(n_frames):
        nearest = min(range(n_samples), key=lambda k: (round(abs(k * fps / 30 - frame), 6), -k))
        symbol = int(np.searchsorted(samples.stops, nearest, side="right"))
        assert string.starts[symbol] <= frame < string.stops[symbol]


@settings(max_examples=100, deadline=None)
@given(st.lists(st.integers(0, 3), min_size=1, max_size=60))
def test_with_both_reductions_runs_and_then_repeats_go(codes: list[int]) -> None:
    runs = reduce_runs(np.array(codes, np.int32))
    kept = runs[reduce_repeats(np.array(codes, np.int32)[runs])]
    assert string_of(codes).symbols.tolist() == [codes[k] for k in kept]
    assert string_of(codes, SymbolsConfig(True, False)).symbols.tolist() == [codes[k] for k in runs]
    assert string_of(codes, SymbolsConfig(False, False)).symbols.tolist() == codes


def test_frames_of_removed_instances_belong_to_the_last_symbol_of_the_first() -> None:
    string = string_of([1, 1, 2, 3, 1, 2, 3, 3, 4])
    assert string.symbols.tolist() == [1, 2, 3, 4]
    assert string.starts.tolist() == [0, 6, 10, 30]
    assert string.stops.tolist() == [6, 10, 30, 33]


def test_without_runs_patterns_repeat_with_their_lengths() -> None:
    repeats_only = SymbolsConfig(runs=False, repeats=True)
    assert string_of([1, 1, 2, 1, 1, 2], repeats_only).symbols.tolist() == [1, 1, 2]
    assert string_of([1, 1, 2, 1, 1, 1, 2], repeats_only).symbols.tolist() == [1, 1, 2, 1, 1, 1, 2]
    assert string_of([1, 1, 1, 1], repeats_only).symbols.tolist() == [1, 1, 1, 1]


@pytest.mark.parametrize(
    ("codes", "n_frames", "fps", "message"),
    [
        ([], 1, 30.0, "without codes"),
        ([1, -1], 2, 30.0, "symbol -1 is negative"),
        ([1, 2], 2, 0.0, "not positive"),
        ([1, 2], 9, 30.0, "2 codes for 9 frames"),
        ([1], 0, 30.0, "1 codes for 0 frames"),
    ],
)
def test_bad_input_is_named(codes: list[int], n_frames: int, fps: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        symbolise(np.array(codes, np.int32), codes_fps=30.0, fps=fps, n_frames=n_frames, config=SymbolsConfig())


def test_codes_that_are_not_whole_numbers_are_refused() -> None:
    with pytest.raises(ValueError, match="whole numbers"):
        symbolise(np.zeros(3), codes_fps=30.0, fps=30.0, n_frames=3, config=SymbolsConfig())  # type: ignore[arg-type]


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(0, 3), min_size=2, max_size=40), st.data())
def test_a_part_is_reduced_as_if_it_were_a_clip_and_moved_as_a_whole(codes: list[int], data: st.DataObject) -> None:
    """One frame a sample: the part's own string is that of its codes, with ranges within it."""
    whole = unfolded(np.array(codes, np.int32), codes_fps=30.0, fps=30.0, n_frames=len(codes), config=BOTH)
    start = data.draw(st.integers(0, len(codes) - 1))
    stop = data.draw(st.integers(start + 1, len(codes)))
    cut = np.array(codes[start:stop], np.int32)
    alone = unfolded(cut, codes_fps=30.0, fps=30.0, n_frames=len(cut), config=BOTH)
    part, moved = whole.part(start, stop, BOTH), alone.moved(start)
    for name in ("symbols", "starts", "stops", "kept"):
        np.testing.assert_array_equal(getattr(part, name), getattr(moved, name))
    assert (part.folded.starts[0], part.folded.stops[-1]) == (start, stop)
