"""Where a stretch of a folded string occurs in the unfolded one, against what the frames alone reduce to."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.pesta.config import SymbolsConfig
from motionlake.pesta.cycles import Occurrence, occurrences, repeated, whole
from motionlake.pesta.symbols import UnfoldedString, unfolded

from tests.test_tandem import naive_reduction

# Words of few symbols, of which stretches are said several times over.
stretches = st.tuples(st.lists(st.integers(0, 3), min_size=1, max_size=5), st.integers(1, 4))
words = st.lists(stretches, min_size=1, max_size=5).map(lambda parts: [s for part, n in parts for s in part * n])


def string_of(word: list[int] | str, config: SymbolsConfig | None = None) -> UnfoldedString:
    """One frame a symbol."""
    codes = np.array([ord(s) - ord("a") if isinstance(s, str) else s for s in word], dtype=np.int32)
    return unfolded(codes, codes_fps=30.0, fps=30.0, n_frames=len(codes), config=config or SymbolsConfig())


def reduced(word: list[int]) -> list[int]:
    return [word[k] for k in naive_reduction(word)]


def told(string: UnfoldedString, found: list[Occurrence]) -> list[tuple[str, int]]:
    """The symbols of each occurrence, and its cycles."""
    return [("".join(chr(97 + s) for s in string.symbols[o.start : o.stop]), o.cycles) for o in found]


@pytest.mark.parametrize(
    ("word", "first", "last", "further", "expected"),
    [
        ("abcabcabc", 0, 3, 0, [("abc", 1)] * 3),  # every cycle
        ("abcabcabc", 0, 3, 1, [("abcabc", 2), ("abc", 1)]),  # as many as the query has
        ("abcabcabc", 1, 3, 0, [("bc", 1)] * 3),
        ("abcabcab", 0, 5, 9, [("abcabcab", 2)]),  # abcab, and one cycle more
        ("xabcabcaby", 0, 4, 0, [("xabc", 1)]),  # the first cycle lies next to x
        ("xabcabcabcy", 3, 5, 0, [("cy", 1)]),  # the last one next to y
        ("xabcabcabcy", 2, 5, 0, [("bcy", 1)]),
        ("xabcabcabcy", 0, 5, 0, [("xabcabcabcy", 3)]),  # all lie within
        ("xabcabcabcydededez", 3, 8, 0, [("cydededez", 3)]),  # begins in the last cycle of one, holds another whole
        ("abcdabe", 0, 2, 0, [("ab", 1), ("ab", 1)]),
        ("abcde", 1, 4, 3, [("bcd", 1)]),
    ],
)
def test_occurrences_of_a_stretch(
    word: str, first: int, last: int, further: int, expected: list[tuple[str, int]]
) -> None:
    string = string_of(word)
    assert told(string, occurrences(string, first, last, further)) == expected


@settings(max_examples=400, deadline=None)
@given(words, st.data())
def test_occurrences_reduce_to_what_was_matched(word: list[int], data: st.DataObject) -> None:
    string = string_of(word)
    n = len(string.kept)
    first = data.draw(st.integers(0, n - 1))
    last = data.draw(st.integers(first + 1, n))
    further = data.draw(st.integers(0, 3))
    wanted = string.folded.symbols[first:last].tolist()
    found = occurrences(string, first, last, further)
    assert found
    for one, other in pairwise(found):
        assert one.stop <= other.start
    covered = 0
    for each in found:
        assert string.symbols[each.places].tolist() == wanted
        assert (np.diff(each.places) > 0).all()
        assert each.stop > each.places[-1]
        assert (each.steps(string)[0][0], each.steps(string)[-1][1]) == each.frames(string)
        covered += each.places.tolist() == list(range(each.start, each.start + len(wanted)))
        if each.stop - each.start == len(wanted):
            assert each.cycles == 1
            assert reduced(string.symbols[each.start : each.stop].tolist()) == wanted
    # Read from left to right, what stands there symbol by symbol is found as often as it fits.
    text, at, fits = string.symbols.tolist(), 0, 0
    while not further and at <= len(text) - len(wanted):
        fits, at = (fits + 1, at + len(wanted)) if text[at : at + len(wanted)] == wanted else (fits, at + 1)
    assert further or covered == fits
    own = slice(int(string.kept[first]), int(string.kept[last - 1]) + 1)
    assert any(each.start < own.stop and own.start < each.stop for each in found)


@settings(max_examples=200, deadline=None)
@given(words, st.booleans(), st.booleans())
def test_a_folded_string_is_that_of_its_codes(word: list[int], runs: bool, repeats: bool) -> None:
    config = SymbolsConfig(runs, repeats)
    string = string_of(word, config)
    assert string.stops[-1] == len(word)
    np.testing.assert_array_equal(string.starts[1:], string.stops[:-1])
    if runs and repeats:
        assert string.folded.symbols.tolist() == reduced(word)
    np.testing.assert_array_equal(string.part(0, len(word), config).symbols, string.symbols)
    np.testing.assert_array_equal(string.part(0, len(word), config).kept, string.kept)
    assert repeated(string).any() == (len(string.kept) < len(string.symbols))


@settings(max_examples=200, deadline=None)
@given(words, st.data())
def test_a_part_is_reduced_for_itself(word: list[int], data: st.DataObject) -> None:
    start = data.draw(st.integers(0, len(word) - 1))
    stop = data.draw(st.integers(start + 1, len(word)))
    part = string_of(word).part(start, stop, SymbolsConfig())
    assert part.folded.symbols.tolist() == reduced(word[start:stop])
    assert (part.starts[0], part.stops[-1]) == (start, stop)


def test_a_query_knows_its_cycles_and_the_time_of_one() -> None:
    string = string_of("aaabbcaabbcabc")  # 6 frames, 5 and 3 the cycle
    assert whole(string).cycles == 3
    assert whole(string).once(string) == 6
    every = occurrences(string, 0, 3)
    assert [each.once(string) for each in every] == [6, 5, 3]
    assert [each.frames(string) for each in every] == [(0, 6), (6, 11), (11, 14)]
