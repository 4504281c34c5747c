"""Pieces in millions of words: bounds against their definition, and answers against those of comparing every window."""

from __future__ import annotations

from dataclasses import replace
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Int64Array
from motionlake.deep_motifs import many_ranges, query_by_example
from motionlake.deep_motifs.emd import emd
from motionlake.deep_motifs.many_ranges import ManyWords
from motionlake.deep_motifs.query_by_example import ExampleQuery, NearWindow, distinct, find_ranges
from motionlake.deep_motifs.range_bounds import MOTIFS, WindowBounds, WordMotifs
from motionlake.deep_motifs.rough_bounds import roughly_of_clips
from motionlake.deep_motifs.signatures import Corpus, signature

from tests.test_find import K, made_corpus

LENGTHS = st.lists(st.integers(0, 40), min_size=1, max_size=6).filter(any)


def words_of(corpus: Corpus) -> ManyWords:
    def frames_of(clip: Int64Array, first: Int64Array, last: Int64Array) -> Int64Array:
        at = corpus.offsets[clip]
        return np.column_stack([corpus.starts[at + first], corpus.stops[at + last - 1]])

    words = WordMotifs(corpus.motifs.astype(np.uint16), corpus.offsets)
    return ManyWords(words, frames_of, corpus.idf, corpus.ground)


def query(seed: int, n_words: int, motifs: int, *, mirrored: bool = False) -> ExampleQuery:
    drawn = np.random.default_rng(seed).integers(0, motifs, (2, n_words)).astype(np.int32)
    return ExampleQuery(drawn[0], drawn[1] if mirrored else None)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10_000), lengths=LENGTHS, n_words=st.integers(2, 30), motifs=st.integers(1, 12))
def test_bounds(seed: int, lengths: list[int], n_words: int, motifs: int) -> None:
    """None is above the distance, nor far below its definition; that of a clip is the least of its windows."""
    corpus, asked = made_corpus(seed, lengths, motifs), query(seed + 1, n_words, motifs)
    words = words_of(corpus).words
    (signed,) = asked.signatures(corpus.idf)
    bounds = WindowBounds.of(signed, n_words, corpus.idf, corpus.ground)
    held = np.flatnonzero(signed)
    seen = held[np.argsort(-signed[held], kind="stable")][:MOTIFS]
    found = bounds.of_clips(words)
    assert (bounds.roughly_of_clips(words) <= found).all()
    some = np.random.default_rng(seed).permutation(len(found))[: 1 + seed % len(found)]
    np.testing.assert_array_equal(bounds.of_clips(words, some), found[some])
    for clip, length in enumerate(lengths):
        if not length:
            assert np.isinf(found[clip])
            continue
        clips, first, each = bounds.of_windows(words, np.array([clip]))
        assert (clips == clip).all()
        assert first.tolist() == list(range(max(1, length - n_words + 1)))
        assert found[clip] == each.min()
        for start, bound in zip(first.tolist(), each.tolist(), strict=True):
            own = words.of(clip)[start : start + n_words]
            window = signature(np.bincount(own, minlength=motifs), corpus.idf).astype(np.float64)
            assert bound <= emd(signed, window, corpus.ground) + 1e-9
            least = window @ corpus.ground[:, held].min(axis=1)
            apart = np.abs((window - signed) @ corpus.ground[:, seen]).max()
            assert bound >= max(least, apart) - 1e-4


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10_000), n_words=st.sampled_from([1, 2, 18, 300]),
    lengths=st.lists(st.sampled_from([0, 1, 17, 18, 19, 300, 1023, 1024, 1025, 3000]), min_size=1, max_size=12),
)  # fmt: skip
def test_rough_bounds_are_quotients_of_sums(seed: int, n_words: int, lengths: list[int]) -> None:
    """Wherever clips lie in the blocks of words that are looked at together, and for every way to share them out; the
    sums of all words are greater than whole numbers of 32 bits."""
    rng = np.random.default_rng(seed)
    offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    motifs = rng.integers(0, 7, offsets[-1]).astype(np.uint16)
    most = (1 << 24) // n_words
    table = np.column_stack([rng.integers(1, most, 7), rng.integers(0, most, 7), rng.integers(-most, most, (7, 2))])
    expected = []
    for clip, length in enumerate(lengths):
        sums = np.cumsum(np.concatenate([np.zeros((1, 4)), table[motifs[offsets[clip] : offsets[clip + 1]]]]), axis=0)
        width = min(n_words, length)
        windows = np.abs(sums[width:] - sums[: len(sums) - width])
        expected.append((windows[:, 1:].max(axis=1) / windows[:, 0]).min() if length else np.inf)
    found, cut = np.full(len(lengths), np.inf, dtype=np.float32), seed % (len(lengths) + 1)
    for first, last in ((0, cut), (cut, len(lengths))):
        roughly_of_clips(table.astype(np.int32), motifs, offsets, n_words, first, last, found)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_nothing_is_bounded_where_weights_are_lost_in_rounding() -> None:
    """Of a query of very many words."""
    corpus, asked = made_corpus(1, [30, 20]), query(2, 5, K)
    bounds = WindowBounds.of(asked.signatures(corpus.idf)[0], 10_000_000, corpus.idf, corpus.ground)
    assert bounds.of_clips(words_of(corpus).words).tolist() == [0, 0]


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    lengths=LENGTHS,
    n_words=st.integers(2, 7),
    k=st.integers(0, 12),
    mirrored=st.booleans(),
    ahead=st.sampled_from([1, 8]),
    without=st.sampled_from([None, (0, 10, 40)]),
    left_out=st.booleans(),
)
def test_answers_are_those_of_comparing_every_window(
    seed: int, lengths: list[int], n_words: int, k: int, mirrored: bool, ahead: int,
    without: tuple[int, int, int] | None, left_out: bool,
) -> None:  # fmt: skip
    corpus, asked = made_corpus(seed, lengths), query(seed + 1, n_words, K, mirrored=mirrored)
    admitted = np.array([bool(length) for length in lengths])
    if left_out:
        admitted[-1] = False
    clips = np.flatnonzero(admitted).tolist()
    expected = find_ranges(corpus, asked, k, clips=clips, without=without)
    with mock.patch.object(many_ranges, "AHEAD", ahead):
        found = words_of(corpus).nearest(asked, k, admitted, without)
    assert [(corpus.clips[h.clip].clip, h.start, h.stop, h.distance, h.mirrored) for h in found] == [
        (h.clip, h.start, h.stop, h.distance, h.mirrored) for h in expected
    ]


@pytest.mark.parametrize("most", [3, 20])
def test_of_too_many_windows_the_likeliest_are_compared(most: int) -> None:
    corpus = made_corpus(3, [60, 40, 50, 30])
    lake, asked, everything = words_of(corpus), query(5, 4, K), np.ones(4, dtype=np.bool_)
    with mock.patch.object(many_ranges, "MOST", most):
        found = lake.nearest(asked, 10, everything)
    assert 0 < len(found) <= 10
    (signed,) = asked.signatures(corpus.idf)
    for hit in found:
        words = corpus.words_of(hit.clip)
        first = int(np.searchsorted(corpus.starts[words], hit.start))
        window = signature(np.bincount(corpus.motifs[words][first : first + 4], minlength=K), corpus.idf)
        assert hit.distance == pytest.approx(emd(signed, window, corpus.ground))
    assert [hit.distance for hit in found] == sorted(hit.distance for hit in found)


def test_clips_near_a_query_hold_the_nearest() -> None:
    corpus = made_corpus(11, [30] * 40)
    lake, admitted = words_of(corpus), np.ones(40, dtype=np.bool_)
    admitted[7] = False
    hits = []
    for seed in range(20):
        asked = query(seed, 6, K)
        chosen = lake.clips_near(asked, 15, admitted)
        assert len(chosen) == 15
        assert 7 not in chosen
        assert chosen.tolist() == sorted(chosen)
        (best,) = lake.nearest(asked, 1, admitted)
        hits.append(best.clip in chosen)
    assert np.mean(hits) > 0.9
    assert lake.clips_near(query(0, 6, K), 100, admitted).tolist() == np.flatnonzero(admitted).tolist()


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 99), count=st.integers(1, 50), twins=st.integers(1, 4))
def test_clips_near_a_query_are_those_of_the_least_bounds(seed: int, count: int, twins: int) -> None:
    """Of clips with equal bounds, of which there are many where clips have twins, the first."""
    corpus = made_corpus(seed, [12] * 10)
    motifs = np.concatenate([corpus.motifs] * twins).astype(np.uint16)
    offsets = np.arange(10 * twins + 1) * 12
    alone = words_of(corpus)
    lake = replace(alone, words=WordMotifs(motifs, offsets))
    asked, admitted = query(seed, 6, K), np.random.default_rng(seed).random(10 * twins) < 0.8
    bounds = np.min([side.of_clips(lake.words) for side in lake._sides(asked)], axis=0)
    first = [row for row in np.argsort(bounds, kind="stable").tolist() if admitted[row]][:count]
    assert lake.clips_near(asked, count, admitted).tolist() == sorted(first)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 1000), rows=st.integers(0, 30), width=st.integers(1, 5))
def test_rows_that_differ(seed: int, rows: int, width: int) -> None:
    bags = np.sort(np.random.default_rng(seed).integers(-1, 4, (rows, width)), axis=1).astype(np.int32)
    for numbers_alike in (False, True):
        with (
            mock.patch.object(query_by_example, "_numbers", lambda bags: np.zeros(len(bags), dtype=np.uint64))
            if (numbers_alike)
            else mock.MagicMock()
        ):
            unique, which = distinct(bags)
        assert np.array_equal(unique[which], bags)
        assert len(unique) == len(np.unique(bags, axis=0))


def test_a_near_window_is_what_it_says() -> None:
    corpus = made_corpus(0, [12, 12])
    own = corpus.motifs[2:6]
    found = words_of(corpus).nearest(ExampleQuery(own), 1, np.ones(2, dtype=np.bool_))
    assert found == [NearWindow(0, 10, 45, 0.0, mirrored=False)]
