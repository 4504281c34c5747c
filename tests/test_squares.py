"""What reading a string without squares is made of: hashes, masks of short squares, names, repetitions, counts."""

from __future__ import annotations

from inspect import unwrap

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from motionlake.pesta import squares, tandem
from motionlake.pesta.squares import square_free
from motionlake.pesta.tandem import LARGEST_TABLE, by_period, by_suffixes, ranks, suffix_order, without_repetitions

from tests.test_tandem import naive_square_free

PRIME = 2**31 - 1
symbols = st.integers(0, 2**31 - 1)


@given(st.integers(0, 2**62 - 1))
@example(0)
@example(PRIME - 1)
@example(PRIME)
@example(PRIME + 1)
@example(2 * PRIME)
@example(PRIME * PRIME)
@example(PRIME << 31)
@example(2**62 - 1)
def test_a_number_is_reduced_by_the_prime(number: int) -> None:
    assert int(squares._modulo(np.uint64(number))) == number % PRIME


@settings(max_examples=60)
@given(st.lists(symbols, min_size=8, max_size=80), st.integers(0, 3), st.integers(0, 72))
@example([PRIME] * 8, 0, 0)
@example([PRIME - 1] * 70, 3, 6)
def test_a_fingerprint_is_the_polynomial_of_its_block(text: list[int], level: int, start: int) -> None:
    block = 8 << level
    if start + block > len(text):
        level, block, start = 0, 8, min(start, len(text) - 8)
    sums = [0]
    for symbol in text:
        sums.append((sums[-1] * int(squares.BASE) + symbol) % PRIME)
    expected = 0
    for symbol in text[start : start + block]:
        expected = (expected * int(squares.BASE) + symbol) % PRIME
    kept = np.array(sums, dtype=np.uint32)
    assert int(squares._fingerprint(kept, start, level)) == expected
    if level == 0:
        key = int(squares._key(kept, start))
        assert key == (expected * int(squares.KEY_FACTOR) % 2**64) >> (64 - squares.KEY_BITS)
        assert 0 <= key < 1 << squares.KEY_BITS


def test_fingerprints_of_a_long_block_have_a_power_of_their_own() -> None:
    """Of every level that a string of some millions of symbols reaches."""
    powers = [pow(int(squares.BASE), 8 << level, PRIME) for level in range(20)]
    assert squares.POWERS[:20].tolist() == powers


few = st.integers(1, 4).flatmap(lambda m: st.lists(st.integers(0, m - 1), min_size=1, max_size=90))


@settings(max_examples=200)
@given(few)
@example([*range(31), *range(31)])
@example([*range(32), *range(32)])
@example([*range(16), *range(16)])
@example([3, *range(3), *range(3)])
def test_masks_tell_which_symbols_are_the_same_so_many_places_before(text: list[int]) -> None:
    masks = np.zeros((len(text), 5), np.uint32)
    last: dict[int, int] = {}
    for at, symbol in enumerate(text):
        found = int(squares._short_square(masks, at, at - last[symbol] if symbol in last else 32))
        last[symbol] = at
        ends = (
            p
            for p in range(1, 32)
            if 2 * p <= at + 1 and text[at - p + 1 : at + 1] == text[at - 2 * p + 1 : at - p + 1]
        )
        assert found == next(ends, 0)
        for power in range(5):
            reach = 1 << power
            expected = sum(
                1 << p
                for p in range(1, 32)
                if at - p - reach + 1 >= 0 and all(text[at - j] == text[at - j - p] for j in range(reach))
            )
            assert int(masks[at, power]) == expected


@settings(max_examples=30, deadline=None)
@given(st.integers(28, 66), st.integers(0, 999), st.integers(0, 20), st.booleans(), st.integers(0, 8))
def test_one_square_of_any_period_goes(period: int, seed: int, before: int, flawed: bool, after: int) -> None:
    """About the length from which periods are read by levels; with one symbol other than in the first half, none."""
    rng = np.random.default_rng(seed)
    half = (rng.permutation(period) + 40).tolist()
    second = [*half]
    if flawed:
        second[int(rng.integers(period))] = 39
    word = [*(np.arange(before)).tolist(), *half, *second, *half[:after], 200, *half]
    kept, compared = square_free(np.array(word, dtype=np.int32), 201)
    assert kept.tolist() == naive_square_free(word)
    assert (len(kept) == len(word)) == flawed
    assert len(word) <= compared < 8 * len(word)


def test_of_short_strings_one_pair_a_symbol_is_compared() -> None:
    for n in (0, 1, 5, 63):
        assert square_free(np.arange(n, dtype=np.int32), 64)[1] == n


def test_of_long_strings_pairs_are_counted_one_by_one() -> None:
    """Of 40 symbols twice, the last one other than before: each symbol with its last; the first eight of the copy, what
    stands before them, and the whole when it would be complete; three further eights, with eight before each that are
    the same and so belong to them, and of sixteen symbols the first eight."""
    word = np.array([*range(40), *range(39), 40], dtype=np.int32)
    kept, compared = square_free(word, 41)
    assert len(kept) == 80
    assert isinstance(compared, int)
    assert compared == 80 + (1 + 1) + 1 + 3 * (1 + 9) + 1


class Symbol:
    """A symbol that counts how often one is compared."""

    compared = 0

    def __init__(self, value: int) -> None:
        self.value = value

    def __eq__(self, other: object) -> bool:
        Symbol.compared += 1
        return isinstance(other, Symbol) and self.value == other.value

    __hash__ = None  # type: ignore[assignment]


@settings(max_examples=60)
@given(st.lists(st.integers(0, 2), min_size=1, max_size=40))
def test_comparisons_are_counted(word: list[int]) -> None:
    """Between two symbols that come once, only from the first of all on is one counted for want of a symbol."""
    text = np.array([7, *word, 8], dtype=np.int32)
    counting = [Symbol(int(symbol)) for symbol in text]
    Symbol.compared = 0
    told = unwrap(by_suffixes)(counting, suffix_order(text, 9))[3]
    assert 0 <= told - Symbol.compared <= 2
    assert told == by_suffixes(text, suffix_order(text, 9))[3]
    Symbol.compared = 0
    told = unwrap(by_period)(counting)[3]
    assert Symbol.compared <= told <= 2 * Symbol.compared


@pytest.mark.parametrize("word", [[*range(150)], [*range(40)] * 3, [*range(50), *range(10, 50), *range(45)]])
def test_arrays_are_as_long_as_what_goes_into_them(word: list[int]) -> None:
    """Compiled kernels do not notice when they write beyond an array; numpy does."""
    text = np.array(word, dtype=np.int32)
    alphabet = int(text.max()) + 1
    kept, compared = unwrap(square_free)(text, alphabet)
    assert kept.tolist() == naive_square_free(word)
    assert compared == square_free(text, alphabet)[1]
    one, other = unwrap(by_period)(text), unwrap(by_suffixes)(text, suffix_order(text, alphabet))
    for ours, theirs in zip(one[:3], other[:3], strict=True):
        np.testing.assert_array_equal(ours, theirs)
    assert (
        unwrap(without_repetitions)(len(text), *one[:3]).tolist() == without_repetitions(len(text), *one[:3]).tolist()
    )
    begins = unwrap(tandem._in_bytes)(text, np.arange(alphabet, dtype=np.int32), 0)[1]
    assert begins.tolist() == [k // 2 if k % 2 == 0 else -1 for k in range(2 * len(text))]


repetitions = st.tuples(st.integers(0, 330), st.integers(1, 40), st.integers(2, 90))


@settings(max_examples=150)
@given(st.lists(repetitions, max_size=12), st.integers(0, 5))
@example([(0, 1, 2), (2, 31, 62), (64, 32, 64), (128, 3, 64)], 0)
@example([(10, 2, 300), (0, 5, 11), (309, 5, 11), (100, 1, 2)], 0)
def test_repetitions_that_overlap_none_taken_before_are_reduced(found: list[tuple[int, int, int]], more: int) -> None:
    ranges = [(start, start + max(length, 2 * period), period) for start, period, length in found]
    n = max((stop for _, stop, _ in ranges), default=0) + more
    taken: set[int] = set()
    gone: set[int] = set()
    for start, stop, period in ranges:
        places = set(range(start, stop))
        if not places & taken:
            taken |= places
            gone |= set(range(start + period, stop - (stop - start) % period))
    columns = np.array(ranges, dtype=np.int32).reshape(-1, 3).T.copy()
    assert without_repetitions(n, *columns).tolist() == [k for k in range(n) if k not in gone]


@settings(max_examples=100)
@given(st.lists(st.integers(-3, 3), min_size=1, max_size=30), st.sampled_from([1, 50, 2**14, 2**16, 2**40]), st.data())
def test_names_are_small_and_ordered_as_the_symbols_are(word: list[int], factor: int, data: st.DataObject) -> None:
    given_symbols = np.array([k * factor for k in word], dtype=np.int64) + data.draw(st.sampled_from([0, 3 * factor]))
    names, count = ranks(given_symbols)
    assert names.dtype == np.int32
    np.testing.assert_array_equal(
        np.unique(given_symbols, return_inverse=True)[1], np.unique(names, return_inverse=True)[1]
    )
    assert names.min() >= 0
    assert names.max() == count - 1
    low, high = int(given_symbols.min()), int(given_symbols.max())
    if low >= 0 and high < LARGEST_TABLE:
        assert names.tolist() == given_symbols.tolist()
    elif low < 0 or high - low >= LARGEST_TABLE:
        assert count == len(set(given_symbols.tolist()))


@pytest.mark.parametrize(
    ("length", "low", "highest", "count"),
    [
        (1_023, 0, 256, 257),  # short: as they are
        (1_024, 0, 256, 2),  # long, so that what costs by the alphabet pays: without those that are not there
        (1_024, 0, 255, 256),
        (1_023, 1, 65_535, 65_536),
        (1_023, 1, 65_536, 2),  # beyond the largest table, however near one another
        (1_023, 2**40, 2**40 + 1, 2),
        (1_023, -1, 300, 2),
        (40_000, 0, 79_999, 2),
    ],
)
def test_names_are_those_of_the_symbols_where_few(length: int, low: int, highest: int, count: int) -> None:
    assert ranks(np.array([low, highest] * length)[:length])[1] == count


def test_no_symbols_have_no_names() -> None:
    names, count = ranks(np.array([], dtype=np.int64))
    assert names.dtype == np.int32
    assert (len(names), count) == (0, 0)
