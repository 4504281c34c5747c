"""Sub-queries of a long query against section 7 written out, and against plain alignment."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.pesta import long_query, thread_work
from motionlake.pesta.config import AlignmentConfig
from motionlake.pesta.long_query import LongQuery
from motionlake.pesta.matches import best_matches
from motionlake.pesta.strings import Boundaries, Repository

from tests import naive_alignment as naive
from tests.test_alignment import cases, dictionary, placed


@given(cases(), st.data(), st.sampled_from(["kept", "crossed", "dropped"]))
@settings(max_examples=50, deadline=None)
def test_sub_queries_are_those_of_the_text(case: Any, data: st.DataObject, boundaries: Boundaries) -> None:
    query, repository, distances, stride = case
    segments = data.draw(st.integers(1, len(query)))
    asked = LongQuery(
        query, repository, distances, AlignmentConfig(stride=stride), segments=segments, boundaries=boundaries
    )
    strings = repository if boundaries == "kept" else repository.joined
    clip_of = np.repeat(np.arange(len(repository)), repository.lengths)
    barred = np.zeros(len(repository.symbols), dtype=np.bool_)
    barred[3::29] = True
    for _ in range(2):
        start = data.draw(st.integers(0, len(query) - 1))
        stop = data.draw(st.integers(start + 1, len(query)))
        costs: list[float] = []
        portions: list[list[tuple[int, int]]] = []
        for clip in range(len(strings)):
            first = int(strings.offsets[clip])
            for cost, path in naive.long_query(query, strings.string(clip), distances, stride, segments, start, stop):
                costs.append(cost)
                own = [(x, n + first) for x, n in path if start <= x < stop]
                portions.append(own or [next((x, n + first) for x, n in path if x >= start)])
        ranges = [(p[0][1], p[-1][1] + 1) for p in portions]
        valid = [r if boundaries != "dropped" or clip_of[r[0]] == clip_of[r[1] - 1] else None for r in ranges]
        found = asked.best_matches(start, stop, 5, barred=barred, paths=True)
        assert placed(found, repository) == naive.apart(costs, valid, 5, np.flatnonzero(barred).tolist())
        for match in found:
            assert match.path is not None
            assert [(x, y + int(repository.offsets[match.clip])) for x, y in match.path.tolist()] in portions


@pytest.mark.parametrize("boundaries", ["kept", "crossed", "dropped"])
def test_a_sub_query_of_one_segment_is_a_query_of_its_own(boundaries: Boundaries) -> None:
    rng = np.random.default_rng(1)
    distances, config = dictionary(1, 60), AlignmentConfig(stride=2)
    query = rng.integers(0, 60, 6 * 20, dtype=np.int32)
    repository = Repository.of([rng.integers(0, 60, n, dtype=np.int32) for n in (150, 3, 0, 700)])
    asked = LongQuery(query, repository, distances, config, segments=20, boundaries=boundaries)
    assert asked.segment_length == 6
    for segment in (0, 7, 19):
        part = slice(6 * segment, 6 * segment + 6)
        plain = best_matches(query[part], repository, distances, 15, config, boundaries=boundaries, paths=True)
        found = asked.best_matches(part.start, part.stop, 15, paths=True)
        assert placed(found, repository) == placed(plain, repository)
        for ours, theirs in zip(found, plain, strict=True):
            assert ours.path is not None
            assert theirs.path is not None
            assert np.array_equal(ours.path - [part.start, 0], theirs.path)


def test_sub_queries_up_to_the_end_are_aligned_together() -> None:
    """With several of one lane, whose last may end beyond the query."""
    rng = np.random.default_rng(3)
    repository = Repository.of([rng.integers(0, 9, 300), rng.integers(0, 9, 40)])
    for symbols in (90, 120):
        query = rng.integers(0, 9, symbols, dtype=np.int32)
        one_by_one, together = (LongQuery(query, repository, dictionary(0, 9)) for _ in range(2))
        parts = [(start, min(start + 9, symbols)) for start in range(0, symbols, 2)]
        together.align(parts)
        for start, stop in parts:
            ours, theirs = (each.best_matches(start, stop, 4) for each in (together, one_by_one))
            assert placed(ours, repository) == placed(theirs, repository)


def test_sub_queries_are_aligned_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those asked for together, and those that follow one that is asked for."""
    rng = np.random.default_rng(2)
    repository = Repository.of([rng.integers(0, 9, 300), rng.integers(0, 9, 40)])
    one_by_one, together = (LongQuery(rng.integers(0, 9, 120), repository, dictionary(0, 9)) for _ in range(2))
    one_by_one.best_matches(0, 12, 3)
    parts = [(start, start + 12) for start in range(0, 60, 4)]
    together.align(parts)
    monkeypatch.setattr(LongQuery, "_scan", None)
    for part in parts:
        assert len(one_by_one.best_matches(*part, 3)) == len(together.best_matches(*part, 3)) == 3


@given(st.integers(0, 99), st.integers(1, 3), st.integers(1, 5))
@settings(max_examples=12, deadline=None)
def test_answers_do_not_depend_on_what_is_kept_nor_on_what_is_scanned_together(
    seed: int, stride: int, length: int
) -> None:
    """Few blocks kept, so that they do not suffice; many sub-queries of several lengths; one thread and two."""
    rng = np.random.default_rng(seed)
    repository = Repository.of([rng.integers(0, 30, n) for n in (700, 0, 1, 130, 2000)])
    given_ = rng.integers(0, 30, 90), repository, dictionary(seed, 30), AlignmentConfig(stride=stride)
    parts = [(int(a), int(a + n)) for a, n in zip(rng.integers(0, 70, 40), rng.integers(1, 21, 40), strict=True)]
    whole = LongQuery(*given_, segments=-(-90 // length))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(long_query, "_FEWEST_BLOCKS", 10**6)
        expected = [whole.best_matches(*part, 6) for part in parts]
        patch.setattr(long_query, "_FEWEST_BLOCKS", 1)
        patch.setattr(long_query, "KEPT_BYTES", 20_000)
        for threads in (1, 2):
            patch.setattr(thread_work, "THREAD_CELLS", 1)
            together = LongQuery(*given_, segments=-(-90 // length))
            together.align(parts, 0, threads=threads)
            assert [together.best_matches(*part, 6) for part in parts] == expected


def test_answers_do_not_depend_on_how_many_strips_are_scanned_side_by_side(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(5)
    given_ = rng.integers(0, 30, 90, dtype=np.int32), Repository.of([rng.integers(0, 30, 900)]), dictionary(5, 30)
    answers = []
    for lanes in (8, 16):
        monkeypatch.setattr(long_query, "strip_lanes", lambda lanes=lanes: lanes)
        together = LongQuery(*given_)
        together.align([(start, start + 12) for start in range(0, 78, 2)])
        answers.append([together.best_matches(start, start + 12, 5) for start in range(0, 78, 2)])
    assert answers[0] == answers[1]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"query": []}, "the query is empty"),
        ({"segments": 0}, "segments, not 0"),
        ({"segments": 4}, "segments, not 4"),
        ({"config": AlignmentConfig("sw")}, "not by sw"),
        ({"query": [9]}, "the query holds symbol 9"),
        ({"boundaries": "open"}, "boundaries is 'open'"),
    ],
)
def test_mistakes_are_named(change: dict[str, Any], said: str) -> None:
    given_: dict[str, Any] = {"query": [1, 2, 3], "repository": Repository.of([[0, 1, 2]])}
    given_ |= {"distances": dictionary(0, 4)} | change
    with pytest.raises(ValueError, match=said):
        LongQuery(**given_)


@pytest.mark.parametrize(("start", "stop"), [(0, 0), (2, 1), (-1, 2), (0, 4)])
def test_sub_queries_lie_within_the_query(start: int, stop: int) -> None:
    asked = LongQuery([1, 2, 3], Repository.of([[0, 1, 2]]), dictionary(0, 4))
    with pytest.raises(ValueError, match="sub-query"):
        asked.best_matches(start, stop, 1)
    with pytest.raises(ValueError, match="k is -1"):
        asked.best_matches(0, 1, -1)


def test_nothing_to_search() -> None:
    for empty in (Repository.of([]), Repository.of([[], []])):
        assert LongQuery([1, 2, 3], empty, dictionary(0, 4)).best_matches(0, 3, 5, paths=True) == []
