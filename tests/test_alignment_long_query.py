"""Sub-queries of a long query against section 7 written out, and against plain alignment."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
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
    long_query = LongQuery(
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
        found = long_query.best_matches(start, stop, 5, barred=barred, paths=True)
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
    long_query = LongQuery(query, repository, distances, config, segments=20, boundaries=boundaries)
    assert long_query.segment_length == 6
    for segment in (0, 7, 19):
        part = slice(6 * segment, 6 * segment + 6)
        plain = best_matches(query[part], repository, distances, 15, config, boundaries=boundaries, paths=True)
        found = long_query.best_matches(part.start, part.stop, 15, paths=True)
        assert placed(found, repository) == placed(plain, repository)
        for ours, theirs in zip(found, plain, strict=True):
            assert ours.path is not None
            assert theirs.path is not None
            assert np.array_equal(ours.path - [part.start, 0], theirs.path)


def test_segments_are_aligned_once() -> None:
    distances = dictionary(0, 9)
    repository = Repository.of([np.arange(9), np.arange(8, -1, -1)])
    long_query = LongQuery(np.arange(9).repeat(12), repository, distances)
    before = long_query.best_matches(0, 20, 3)
    long_query._segments[:] = 0  # were a segment aligned again, the answer would change
    long_query._matrix.matrix[:] = 0
    assert long_query.best_matches(0, 20, 3) == before


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
    long_query = LongQuery([1, 2, 3], Repository.of([[0, 1, 2]]), dictionary(0, 4))
    with pytest.raises(ValueError, match="sub-query"):
        long_query.best_matches(start, stop, 1)
    with pytest.raises(ValueError, match="k is -1"):
        long_query.best_matches(0, 1, -1)


def test_nothing_to_search() -> None:
    for empty in (Repository.of([]), Repository.of([[], []])):
        assert LongQuery([1, 2, 3], empty, dictionary(0, 4)).best_matches(0, 3, 5, paths=True) == []
