"""Tandem repeats and maximal repetitions against naive versions, and how many symbols they compare."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Int32Array
from motionlake.pesta.squares import square_free
from motionlake.pesta.tandem import by_period, by_suffixes, ranks, reduce_repeats, suffix_order, without_repetitions
from numpy.typing import NDArray

words = st.integers(2, 4).flatmap(lambda m: st.lists(st.integers(0, m - 1), max_size=60))


def naive_repetitions(word: list[int]) -> list[tuple[int, int, int]]:
    found: dict[tuple[int, int], int] = {}
    for period in range(1, len(word) // 2 + 1):
        for start in range(len(word) - 2 * period + 1):
            if start and word[start - 1] == word[start - 1 + period]:
                continue
            stop = start + period
            while stop < len(word) and word[stop] == word[stop - period]:
                stop += 1
            if stop - start >= 2 * period:
                found.setdefault((start, stop), period)
    return sorted(((*ends, period) for ends, period in found.items()), key=lambda found: (found[2], found[0]))


def naive_square_free(word: list[int]) -> list[int]:
    kept: list[int] = []
    for place in range(len(word)):
        kept.append(place)
        read = [word[k] for k in kept]
        for period in range(1, len(read) // 2 + 1):
            if read[-period:] == read[-2 * period : -period]:
                del kept[-period:]
                break
    return kept


def naive_reduction(word: list[int]) -> list[int]:
    runs = [k for k in range(len(word)) if k == 0 or word[k] != word[k - 1]]
    taken: set[int] = set()
    gone: set[int] = set()
    for start, stop, period in naive_repetitions([word[k] for k in runs]):
        places = set(range(start, stop))
        if not places & taken:
            taken |= places
            gone |= set(range(start + period, stop - (stop - start) % period))
    left = [k for i, k in enumerate(runs) if i not in gone]
    return [left[k] for k in naive_square_free([word[k] for k in left])]


def kept_text(text: str) -> str:
    return "".join(text[k] for k in reduce_repeats(np.array([ord(c) for c in text], dtype=np.int32)))


def fibonacci(n: int) -> Int32Array:
    short, long = "a", "ab"
    while len(long) < n:
        short, long = long, long + short
    return np.frombuffer(long[:n].encode(), np.uint8).astype(np.int32) - ord("a")


def thue_morse(n: int) -> Int32Array:
    return np.array([bin(k).count("1") & 1 for k in range(n)], dtype=np.int32)


def square_free_ternary(n: int) -> Int32Array:
    return np.diff(thue_morse(n + 1)) + np.int32(1)


def run_rich(n: int) -> Int32Array:
    """The strings of Matsubara et al. (2008), among those with the most repetitions known."""
    earlier = ["0110101101001011010", "110101101001"]
    while len(earlier[-1]) < n:
        k = len(earlier)
        earlier.append(earlier[-1] + earlier[-4 if k % 3 == 0 and k >= 4 else -2])
    return np.frombuffer(earlier[-1][:n].encode(), np.uint8).astype(np.int32) - ord("0")


def copied(n: int, m: int) -> Int32Array:
    """Pieces of a random string one after another, each repeated up to five times."""
    rng = np.random.default_rng(m)
    source = rng.integers(0, m, n // 8)
    pieces: list[NDArray[np.int64]] = []
    while sum(map(len, pieces[-n // 50 :])) < n and len(pieces) < n // 50:
        length = int(rng.choice([1, 5, 20, 60, 300]))
        start = int(rng.integers(0, len(source) - length))
        pieces.append(np.tile(source[start : start + length], int(rng.integers(1, 6))))
    return np.concatenate(pieces)[:n].astype(np.int32)


def uniform(n: int, m: int) -> Int32Array:
    return np.random.default_rng(m).integers(0, m, n).astype(np.int32)


@settings(max_examples=300, deadline=None)
@given(words, st.sampled_from([4, 256, 300, 70_000]))
def test_the_maximal_repetitions_are_those_found_by_trying_all(word: list[int], alphabet: int) -> None:
    text = np.array(word, dtype=np.int32)
    expected = naive_repetitions(word)
    assert list(zip(*(column.tolist() for column in by_period(text)[:3]), strict=True)) == expected
    if word:
        found = by_suffixes(text, suffix_order(text, alphabet))
        assert list(zip(*(column.tolist() for column in found[:3]), strict=True)) == expected


@pytest.mark.parametrize("m", [200, 300, 700, 3_000])
def test_symbols_of_one_and_two_bytes_give_the_repetitions_that_trying_all_periods_gives(m: int) -> None:
    text = copied(3_000, m)
    short, long = by_period(text), by_suffixes(text, suffix_order(text, m))
    for one, other in zip(short[:3], long[:3], strict=True):
        np.testing.assert_array_equal(one, other)


def test_more_symbols_than_two_bytes_hold_are_told_apart() -> None:
    """Of 70,000 symbols, each of them twice, those that are 65,536 apart are repeated together."""
    near, far = np.arange(4_464), np.arange(4_464) + (1 << 16)
    others = np.arange(4_464, 1 << 16)
    repeated = np.stack([near, far, near, far], axis=1).ravel()
    text = np.concatenate([others, repeated, others[::-1]]).astype(np.int32)
    starts, stops, periods, _ = by_suffixes(text, suffix_order(text, 70_000))
    np.testing.assert_array_equal(starts, len(others) + 4 * near)
    np.testing.assert_array_equal(stops - starts, 4)
    np.testing.assert_array_equal(periods, 2)


@settings(max_examples=300, deadline=None)
@given(words)
def test_the_reduction_is_the_one_described(word: list[int]) -> None:
    assert reduce_repeats(np.array(word, dtype=np.int32)).tolist() == naive_reduction(word)


@settings(max_examples=150, deadline=None)
@given(words, st.permutations(range(4)), st.integers(-(2**31), 2**31 - 9), st.sampled_from([1, 997, 2**40]))
def test_names_of_symbols_do_not_matter(word: list[int], names: list[int], shift: int, factor: int) -> None:
    renamed = np.array([names[c] * factor + shift for c in word], dtype=np.int64)
    np.testing.assert_array_equal(reduce_repeats(renamed), reduce_repeats(np.array(word, dtype=np.int32)))


@pytest.mark.parametrize("seed", range(30))
def test_squares_of_long_period_go_as_in_the_naive_version(seed: int) -> None:
    """Strings grown from pieces of themselves, so that removed squares uncover others of every length."""
    rng = np.random.default_rng(seed)
    m = int(rng.choice([3, 4, 5, 50, 400]))
    word = square_free_ternary(100).tolist() if m == 3 else rng.integers(0, m, 30).tolist()
    while len(word) < 900:
        length = int(rng.choice([1, 3, 10, 30, 70, 150, 300]))
        start = int(rng.integers(0, len(word)))
        word += [word[-length:], word[start : start + length], rng.integers(0, m, min(length, 5)).tolist()][
            rng.integers(0, 3)
        ]
    kept, _ = square_free(np.array(word, dtype=np.int32), m)
    assert kept.tolist() == naive_square_free(word)
    assert reduce_repeats(np.array(word, dtype=np.int32)).tolist() == naive_reduction(word)


@pytest.mark.parametrize("m", [4, 40, 400])
def test_a_long_string_becomes_free_of_squares_and_stays_so(m: int) -> None:
    text = copied(60_000, m)
    kept = reduce_repeats(text)
    assert 0 < len(kept) < 0.9 * len(text)
    assert kept[0] == 0
    assert all(one < other for one, other in pairwise(kept.tolist()))
    left, alphabet = ranks(text[kept])
    assert len(by_suffixes(left, suffix_order(left, alphabet))[0]) == 0
    np.testing.assert_array_equal(reduce_repeats(text[kept]), np.arange(len(kept)))


@pytest.mark.parametrize(
    ("text", "kept"),
    [
        ("", ""),
        ("a", "a"),
        ("aaaa", "a"),
        ("abcabcabc", "abc"),
        ("abcabcab", "abcab"),
        ("aabaab", "ab"),
        ("abacabacd", "abacd"),
        ("ababcababc", "abc"),
        ("abcbabcbc", "abcbabc"),
        ("abc" * 500 + "a", "abca"),
    ],
)
def test_nested_and_overlapping_repeats_of_the_docstring(text: str, kept: str) -> None:
    assert kept_text(text) == kept


STRINGS: dict[str, Callable[[int], Int32Array]] = {
    "random, 4": lambda n: uniform(n, 4),
    "random, 400": lambda n: uniform(n, 400),
    "periodic": lambda n: np.tile(uniform(7, 400), n // 7),
    "periodic, long": lambda n: np.tile(uniform(999, 5), n // 999),
    "one symbol": lambda n: np.zeros(n, dtype=np.int32),
    "Fibonacci": fibonacci,
    "Thue-Morse": thue_morse,
    "square-free": square_free_ternary,
    "run-rich": run_rich,
    "pieces": lambda n: copied(n, 8),
}


@pytest.mark.parametrize("kind", STRINGS)
def test_few_symbols_are_compared_for_each_symbol_of_a_long_string(kind: str) -> None:
    """Comparisons a symbol hardly grow from 50,000 symbols to eight times as many: near-linear time."""
    costs = []
    for n in (50_000, 400_000):
        text, alphabet = ranks(STRINGS[kind](n))
        starts, stops, periods, compared = by_suffixes(text, suffix_order(text, alphabet))
        left = text[without_repetitions(len(text), starts, stops, periods)]
        costs.append((compared + square_free(left, alphabet)[1] + square_free(text, alphabet)[1]) / len(text))
    assert costs[1] < 60
    assert costs[1] < 1.3 * costs[0] + 1
