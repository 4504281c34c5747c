"""Strided temporal alignment against section 6 written out cell by cell, and against librosa."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, get_args

import librosa
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake import threads as kept_threads
from motionlake.arrays import Int32Array
from motionlake.pesta import nearest, scan, thread_work
from motionlake.pesta.config import AlignmentConfig, Method
from motionlake.pesta.matches import Match, best_matches
from motionlake.pesta.nearest import Both, LeastCosts, nearest_strings, symmetric_costs
from motionlake.pesta.scan import best_per_clip, end_costs, pairwise
from motionlake.pesta.strings import Boundaries, Repository, SymbolDistances
from numpy.typing import NDArray

from tests import naive_alignment as naive


@pytest.fixture(autouse=True, scope="module")
def _threads_for_little_work() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(thread_work, "THREAD_CELLS", 1)
        yield


def test_threads_are_for_much_work() -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(thread_work, "THREAD_CELLS", 100)
        assert [thread_work.useful_threads(4, cells) for cells in (0, 199, 200, 399, 10_000)] == [1, 1, 2, 3, 4]
        patch.setattr(kept_threads, "_kept", None)  # to ask for threads is an error
        strings = Repository.of([np.arange(9)] * 64)
        with pytest.raises(TypeError):
            end_costs([1, 2], strings, dictionary(0, 9), threads=8)
        patch.setattr(thread_work, "THREAD_CELLS", 10_000)
        assert len(end_costs([1, 2], strings, dictionary(0, 9), threads=8)) == 9 * 64


def test_a_repository_knows_its_strings() -> None:
    strings = [[3, 1], [], [2, 2, 5], [4]]
    repository = Repository.of(strings)
    assert [repository.string(clip).tolist() for clip in range(len(repository))] == strings
    assert repository.lengths.tolist() == [2, 0, 3, 1]
    assert repository.by_length.tolist() == [2, 0, 3]
    assert repository.largest == 5
    assert repository.joined.string(0).tolist() == [3, 1, 2, 2, 5, 4]
    assert Repository.of([]).largest == Repository.of([[]]).largest == -1
    with pytest.raises(ValueError, match=r"dictionary has 0 to 0$"):
        end_costs([0], Repository.of([[1]]), np.zeros((1, 1), dtype=np.float32))


def dictionary(seed: int, m: int, *, whole: bool = False) -> NDArray[np.float32]:
    """[m, m] distances; of whole numbers, so that costs tie, on demand."""
    points = np.random.default_rng(seed).normal(size=(m, 3))
    matrix = np.linalg.norm(points[:, None] - points[None], axis=2)
    distances: NDArray[np.float32] = (np.ceil(matrix) if whole else matrix).astype(np.float32)
    return distances


@st.composite
def cases(draw: st.DrawFn, clips: int = 6) -> tuple[Int32Array, Repository, NDArray[np.float32], int]:
    """A query, a repository of clips of 0 to 40 symbols, distances, a stride."""
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    m = draw(st.sampled_from([2, 5, 30]))
    distances = dictionary(draw(st.integers(0, 99)), m, whole=draw(st.booleans()))
    query = rng.integers(0, m, draw(st.integers(1, 20)), dtype=np.int32)
    lengths = draw(st.lists(st.integers(0, 40), min_size=1, max_size=clips))
    strings = [rng.integers(0, m, length, dtype=np.int32) for length in lengths]
    return query, Repository.of(strings), distances, draw(st.integers(1, 4))


def naive_ends(query: Int32Array, repository: Repository, distances: Any, stride: int) -> NDArray[np.float32]:
    rows = [naive.weights(query, repository.string(i), distances, stride)[-1] for i in range(len(repository))]
    return np.concatenate(rows)


@given(cases())
@settings(max_examples=40, deadline=None)
def test_end_costs_are_those_of_the_recurrence(case: Any) -> None:
    query, repository, distances, stride = case
    config = AlignmentConfig(stride=stride)
    apart, joined = (
        naive_ends(query, repository, distances, stride),
        naive_ends(query, repository.joined, distances, stride),
    )
    for threads in (1, 3):
        assert np.array_equal(end_costs(query, repository, distances, config, threads=threads), apart)
        best = best_per_clip(query, repository, distances, config, threads=threads)
        assert best.tolist() == [
            min(apart[a:b], default=np.inf) for a, b in zip(repository.offsets, repository.offsets[1:], strict=False)
        ]
        both = pairwise([query, query[::-1]], repository, distances, config, threads=threads)
        assert np.array_equal(both[0], best)
        assert np.array_equal(both[1], best_per_clip(query[::-1], repository, distances, config))
    crossed = end_costs(query, repository, distances, config, boundaries="crossed")
    assert np.array_equal(crossed, joined)
    dtw = end_costs(query, repository, distances, AlignmentConfig("dtw", stride=stride))
    assert np.array_equal(dtw, naive_ends(query, repository, distances, 1))


@pytest.mark.parametrize("stride", [1, 2, 3, 4])
@pytest.mark.parametrize("length", [1, 8, 33])
def test_end_costs_equal_librosa(stride: int, length: int) -> None:
    rng = np.random.default_rng(stride)
    distances, string = dictionary(1, 40), rng.integers(0, 40, 300, dtype=np.int32)
    query = rng.integers(0, 40, length, dtype=np.int32)
    steps = np.array([(m, n) for m in range(stride + 1) for n in range(stride + 1) if m or n])
    costs = librosa.sequence.dtw(
        C=distances[np.ix_(query, string)],
        step_sizes_sigma=steps,
        weights_mul=steps.max(axis=1).astype(np.float64),
        weights_add=np.zeros(len(steps)),
        subseq=True,
        backtrack=False,
    )
    ours = end_costs(query, Repository.of([string]), distances, AlignmentConfig(stride=stride))
    assert np.allclose(ours, costs[-1], rtol=1e-5)


@pytest.mark.parametrize("stride", [1, 2, 4])
@pytest.mark.parametrize("still", [False, True])
def test_long_strings_scanned_in_pieces_are_scanned_exactly(stride: int, still: bool) -> None:
    rng = np.random.default_rng(0)
    distances = dictionary(2, 6)
    string, query = rng.integers(0, 6, 4000, dtype=np.int32), rng.integers(0, 6, 3, dtype=np.int32)
    if still:  # paths that cost nothing for 1500 symbols: no piece can know where they began
        string[700:2200] = query[-1]
    repository = Repository(string, np.array([0, 900, 900, 910, 4000]))
    config = AlignmentConfig(stride=stride)
    for boundaries, strings in (("kept", repository), ("crossed", repository.joined)):
        expected = naive_ends(query, strings, distances, stride)
        for threads in (1, 2, 5):
            costs = end_costs(query, repository, distances, config, boundaries=boundaries, threads=threads)  # type: ignore[arg-type]
            assert np.array_equal(costs, expected)


def spans(query: Int32Array, repository: Repository, distances: Any, stride: int) -> tuple[list[float], list[Any]]:
    costs, paths = [], []
    for clip in range(len(repository)):
        string, first = repository.string(clip), int(repository.offsets[clip])
        w = naive.weights(query, string, distances, stride)
        for y in range(len(string)):
            costs.append(float(w[-1, y]))
            paths.append([(x, n + first) for x, n in naive.path_back(w, query, string, distances, stride, y)])
    return costs, paths


def placed(matches: list[Match], repository: Repository) -> list[tuple[int, int, float]]:
    return [
        (m.start + int(repository.offsets[m.clip]), m.stop + int(repository.offsets[m.clip]), m.cost) for m in matches
    ]


@given(cases(), st.integers(0, 12), st.sampled_from(["kept", "crossed", "dropped"]), st.integers(0, 99))
@settings(max_examples=50, deadline=None)
def test_best_matches_are_those_of_the_text(case: Any, k: int, boundaries: Boundaries, seed: int) -> None:
    query, repository, distances, stride = case
    strings = repository if boundaries == "kept" else repository.joined
    costs, paths = spans(query, strings, distances, stride)
    clip_of = np.repeat(np.arange(len(repository)), repository.lengths)
    ranges = [(p[0][1], p[-1][1] + 1) for p in paths]
    valid = [r if boundaries != "dropped" or clip_of[r[0]] == clip_of[r[1] - 1] else None for r in ranges]
    barred = np.random.default_rng(seed).random(len(repository.symbols)) < 0.05
    expected = naive.apart(costs, valid, k, np.flatnonzero(barred).tolist())
    config = AlignmentConfig(stride=stride)
    found = best_matches(
        query, repository, distances, k, config, boundaries=boundaries, barred=barred, paths=True, threads=2
    )
    assert placed(found, repository) == expected
    for match in found:
        assert match.path is not None
        first = int(repository.offsets[match.clip])
        path = [(x, y + first) for x, y in match.path.tolist()]
        assert path in paths
        assert paths[[r[1] - 1 for r in ranges].index(path[-1][1])] == path
    if expected:
        cheap = best_matches(
            query, repository, distances, k, config, boundaries=boundaries, barred=barred, below=expected[-1][2]
        )
        assert placed(cheap, repository) == [e for e in expected if e[2] < expected[-1][2]]


def test_paths_rise_and_cost_what_they_say() -> None:
    rng = np.random.default_rng(3)
    distances = dictionary(3, 50)
    repository = Repository.of([rng.integers(0, 50, n, dtype=np.int32) for n in (700, 30, 2000)])
    query = rng.integers(0, 50, 25, dtype=np.int32)
    matches = best_matches(query, repository, distances, 40, AlignmentConfig(stride=3), paths=True)
    assert len(matches) == 40
    for match in matches:
        assert match.path is not None
        x, y = match.path.T
        string = repository.string(match.clip)
        steps = np.maximum(np.diff(x), np.diff(y))
        assert (x[0], x[-1], y[0], y[-1]) == (0, 24, match.start, match.stop - 1)
        assert min(np.diff(x).min(), np.diff(y).min()) >= 0
        assert 1 <= steps.min() <= steps.max() <= 3
        cost = distances[query[0], string[y[0]]] + np.sum(steps * distances[query[x[1:]], string[y[1:]]])
        assert match.cost == pytest.approx(float(cost), rel=1e-5)


def test_a_path_longer_than_the_first_stretch_is_traced_to_its_beginning() -> None:
    distances = np.array([[0, 1, 5], [1, 0, 5], [5, 5, 0]], dtype=np.float32)
    string = np.array([2, 0] + [1] * 500 + [2], dtype=np.int32)
    w = naive.weights(np.array([0, 1], dtype=np.int32), string, distances, 2)
    query = np.array([0, 1], dtype=np.int32)
    found = best_matches(query, Repository.of([string]), distances, 1, below=1.0, barred=string == 9, paths=True)
    end = int(np.argmin(w[-1]))
    assert found[0].path is not None
    assert found[0].path.tolist() == [list(c) for c in naive.path_back(w, query, string, distances, 2, end)]
    barred = np.zeros(len(string), dtype=bool)
    barred[2:400] = True
    again = best_matches(query, Repository.of([string]), distances, 1, below=0.5, barred=barred)
    assert again == []  # all that end later begin at symbol 1 at no cost


@given(cases(), st.integers(1, 12))
@settings(max_examples=40, deadline=None)
def test_smith_waterman_is_the_local_alignment(case: Any, k: int) -> None:
    query, repository, distances, _ = case
    config = AlignmentConfig("sw", threshold=0.6, gap=0.2)
    threshold, gap = SymbolDistances(distances).scores(config)
    costs, paths = [], []
    for clip in range(len(repository)):
        string, first = repository.string(clip), int(repository.offsets[clip])
        h = naive.local_weights(query, string, distances, threshold, gap)
        costs += h[:, 1:].min(axis=0).tolist()
        for y in range(len(string)):
            pairs = naive.local_path(h, query, string, distances, threshold, gap, y)
            paths.append([(x, n + first) for x, n in pairs])
    assert np.array_equal(end_costs(query, repository, distances, config), np.array(costs, dtype=np.float32))
    ranges = [(p[0][1], p[-1][1] + 1) if p else None for p in paths]
    found = best_matches(query, repository, distances, k, config, paths=True)
    assert placed(found, repository) == naive.apart(costs, ranges, k)
    for match in found:
        assert match.path is not None
        assert [(x, y + int(repository.offsets[match.clip])) for x, y in match.path.tolist()] in paths


@given(cases(), st.integers(0, 12), st.sampled_from(["kept", "crossed", "dropped"]), st.integers(0, 99))
@settings(max_examples=60, deadline=None)
def test_symbols_may_be_left_out_at_a_price(case: Any, k: int, boundaries: Boundaries, seed: int) -> None:
    query, repository, distances, stride = case
    random = np.random.default_rng(seed)
    config = AlignmentConfig(
        stride=stride, gaps=True, clip_gap=random.uniform(0.01, 0.5), query_gap=random.uniform(0.1, 2)
    )
    query_gap, clip_gap = SymbolDistances(distances).scores(config)
    strings = repository if boundaries == "kept" else repository.joined
    costs, paths = [], []
    for clip in range(len(strings)):
        string, first = strings.string(clip), int(strings.offsets[clip])
        w = naive.gapped_weights(query, string, distances, stride, query_gap, clip_gap)
        costs += w[-1].tolist()
        for y in range(len(string)):
            pairs = naive.gapped_path(w, query, string, distances, stride, clip_gap, y)
            paths.append([(x, n + first) for x, n in pairs])
    for threads in (1, 3):
        ends = end_costs(query, repository, distances, config, boundaries=boundaries, threads=threads)
        assert np.array_equal(ends, np.array(costs, dtype=np.float32))
    if boundaries == "kept":
        best = best_per_clip(query, repository, distances, config)
        assert np.array_equal(pairwise([query], repository, distances, config)[0], best)
    clip_of = np.repeat(np.arange(len(repository)), repository.lengths)
    ranges = [(p[0][1], p[-1][1] + 1) if p else None for p in paths]
    ends_of = [clip_of[y] for y in range(len(ranges))]
    valid = [
        r if r is None or boundaries != "dropped" or clip_of[r[0]] == clip_of[r[1] - 1] == ends_of[y] else None
        for y, r in enumerate(ranges)
    ]
    barred = random.random(len(repository.symbols)) < 0.05
    open_ends = [r if not barred[y] else None for y, r in enumerate(valid)]
    expected = naive.apart(costs, open_ends, k, np.flatnonzero(barred).tolist())
    found = best_matches(
        query, repository, distances, k, config, boundaries=boundaries, barred=barred, paths=True, threads=2
    )
    assert placed(found, repository) == expected
    for match in found:
        assert match.path is not None
        assert [(x, y + int(repository.offsets[match.clip])) for x, y in match.path.tolist()] in paths


def test_a_gap_is_worth_more_than_a_dear_symbol() -> None:
    """The query 0 1 2 3 with a foreign symbol in it, in both, is found at the price of what was left out."""
    distances = np.where(np.eye(6, dtype=bool), 0, 1).astype(np.float32)
    config = AlignmentConfig(stride=1, gaps=True, clip_gap=0.05, query_gap=0.6)
    strings = Repository.of([[0, 1, 5, 5, 5, 2, 3], [4, 4, 4, 4]])
    found = best_matches([0, 1, 2, 3], strings, distances, 9, config, paths=True)
    assert [(m.clip, m.start, m.stop) for m in found] == [(0, 0, 7)]  # where nothing is matched, nothing is found
    assert found[0].cost == pytest.approx(3 * 0.05)
    assert found[0].path is not None
    assert found[0].path.tolist() == [[0, 0], [1, 1], [2, 5], [3, 6]]
    (spoilt,) = best_matches([0, 1, 4, 2, 3], Repository.of([[0, 1, 2, 3]]), distances, 9, config, paths=True)
    assert spoilt.cost == pytest.approx(0.6)
    assert spoilt.path is not None
    assert spoilt.path.tolist() == [[0, 0], [1, 1], [3, 2], [4, 3]]


def test_long_strings_with_gaps_are_scanned_exactly() -> None:
    rng = np.random.default_rng(0)
    distances = dictionary(2, 6)
    string, query = rng.integers(0, 6, 4000, dtype=np.int32), rng.integers(0, 6, 3, dtype=np.int32)
    config = AlignmentConfig(stride=2, gaps=True, clip_gap=1e-7)  # so cheap that no piece can know where it began
    expected = naive.gapped_weights(query, string, distances, 2, *SymbolDistances(distances).scores(config))[-1]
    for threads in (1, 3):
        assert np.array_equal(end_costs(query, Repository.of([string]), distances, config, threads=threads), expected)


def test_costs_between_whole_strings() -> None:
    rng = np.random.default_rng(5)
    distances = dictionary(5, 20)
    strings = [rng.integers(0, 20, n, dtype=np.int32) for n in (4, 9, 1, 30)]
    one_way = np.array(
        [[naive.weights(a, b, distances, 3)[-1].min() / np.float32(len(a)) for b in strings] for a in strings]
    )
    config = AlignmentConfig(stride=3)
    assert np.array_equal(symmetric_costs(strings, distances, config, both="query"), one_way)
    assert np.array_equal(symmetric_costs(strings, distances, config), np.maximum(one_way, one_way.T))
    mean = symmetric_costs(strings, distances, config, both="mean", threads=2)
    assert np.allclose(mean, (one_way + one_way.T) / 2)
    assert np.all(np.diag(one_way) == 0)


@given(
    cases(clips=40), st.sampled_from(get_args(Method)), st.booleans(), st.sampled_from(get_args(Both)),
    st.integers(0, 45), st.sampled_from([1, 3, 64]),
)  # fmt: skip
@settings(max_examples=60)
def test_nearest_strings_are_a_row_of_all_costs(
    case: tuple[Int32Array, Repository, NDArray[np.float32], int], method: Method, gaps: bool, both: Both, k: int,
    together: int,
) -> None:  # fmt: skip
    """To the last bit, whichever clips are compared side by side, on any number of threads."""
    query, repository, distances, stride = case
    config = AlignmentConfig(method=method, stride=stride, gaps=gaps and method == "sta")
    held = [repository.string(clip) for clip in np.flatnonzero(repository.lengths).tolist()]
    costs = symmetric_costs([query, *held], distances, config, both=both)[0]
    expected = sorted((float(cost), clip) for clip, cost in enumerate(costs[1:], start=1))[:k]
    strings = Repository.of([query, *held, [], []])  # empty ones are left out
    with pytest.MonkeyPatch.context() as patch:
        for module, name in ((nearest, "BATCH"), (nearest, "FIRST"), (nearest, "OF_EACH"), (scan, "ALIKE")):
            patch.setattr(module, name, together)
        found = nearest_strings(query, strings, distances, k, config, both=both, without=0, threads=together)
        so_far, shares = LeastCosts(k), [range(first, len(strings), 3) for first in range(1, 4)]
        parts = [
            [(cost, share[clip]) for clip, cost in nearest_strings(
                query, strings.among(np.array(share, dtype=np.int64)), distances, k, config, both=both, so_far=so_far
            )]
            for share in shares
        ]  # fmt: skip
    assert [(cost, clip) for clip, cost in found] == expected
    assert sorted(answer for part in parts for answer in part)[:k] == expected
    with pytest.raises(ValueError, match="at least 0"):
        nearest_strings(query, strings, distances, -1)


def test_of_clips_that_cost_the_same_the_first_is_nearest(monkeypatch: pytest.MonkeyPatch) -> None:
    """Though the other is compared before it: its bound is lower."""
    monkeypatch.setattr(nearest, "BATCH", 1)
    distances = np.array([[0, 1, 0], [0, 0, 1], [1, 1, 0]], dtype=np.float32)
    assert nearest_strings([0], Repository.of([[1], [2]]), distances, 1) == [(0, 1.0)]


def test_few_strings_are_aligned(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of strings of other symbols than the query bounds tell that they are far, and what one share finds spares
    another."""
    rng = np.random.default_rng(3)
    distances = np.abs(np.subtract.outer(np.arange(40), np.arange(40))).astype(np.float32)
    query = rng.integers(0, 10, 30).astype(np.int32)
    like, unlike = ([rng.integers(low, low + 10, 30).astype(np.int32) for _ in range(300)] for low in (0, 25))
    aligned: list[int] = []

    def counted(asked: Int32Array, clips: Repository, *rest: Any, **options: Any) -> Any:
        aligned.append(len(clips))
        return best_per_clip(asked, clips, *rest, **options)

    monkeypatch.setattr(nearest, "best_per_clip", counted)
    strings = Repository.of([*unlike, *like])
    found = nearest_strings(query, strings, distances, 5)
    assert all(clip >= 300 for clip, _ in found)
    assert sum(aligned) == 300, "those that are like it"
    aligned.clear()
    so_far = LeastCosts(5)
    assert nearest_strings(query, Repository.of(like), distances, 5, so_far=so_far)
    assert not nearest_strings(query, Repository.of(unlike), distances, 5, so_far=so_far)
    assert sum(aligned) == 300


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"query": []}, "the query is empty"),
        ({"query": [[1, 2]]}, "one row of symbols"),
        ({"query": [1, 4]}, "the query holds symbol 4, but the dictionary has 0 to 3"),
        ({"query": [-1]}, "the query holds symbol -1"),
        ({"repository": Repository.of([[0, 7]])}, "the repository holds symbol 7"),
        ({"distances": np.ones((3, 4))}, r"\[m, m\]"),
        ({"distances": np.full((4, 4), np.nan)}, "finite"),
        ({"distances": -np.ones((4, 4))}, "below zero"),
        ({"k": -1}, "k is -1"),
        ({"boundaries": "open"}, "boundaries is 'open'"),
        ({"barred": [True]}, "barred"),
    ],
)
def test_mistakes_are_named(change: dict[str, Any], said: str) -> None:
    given_: dict[str, Any] = {"query": [1], "repository": Repository.of([[0, 1, 2]]), "distances": dictionary(0, 4)}
    given_ |= {"k": 1} | change
    with pytest.raises(ValueError, match=said):
        best_matches(**given_)


@pytest.mark.parametrize(
    ("settings_", "said"),
    [
        ({"stride": 0}, "stride is 0"),
        ({"stride": 1.5}, "stride"),
        ({"method": "lcs"}, "lcs"),
        ({"gap": 0.0}, "gap"),
        ({"gaps": True, "clip_gap": 0.0}, "clip_gap is 0.0"),
        ({"gaps": True, "method": "sw"}, "gaps are an option"),
        ({"gaps": True, "method": "dtw"}, "gaps are an option"),
    ],
)
def test_settings_are_checked(settings_: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        AlignmentConfig(**settings_)


def test_offsets_and_symbols_of_a_repository_are_checked() -> None:
    for symbols, offsets in (([1, 2], [0, 1]), ([1, 2], [0, 2, 1, 2]), ([1], [1]), ([-1], [0, 1]), ([1], [])):
        with pytest.raises(ValueError, match=r"offsets|symbol"):
            Repository(np.array(symbols, dtype=np.int32), np.array(offsets, dtype=np.int64))


@pytest.mark.parametrize("method", ["sta", "dtw", "sw"])
def test_nothing_to_search(method: Method) -> None:
    config, distances = AlignmentConfig(method), dictionary(0, 4)
    for empty in (Repository.of([]), Repository.of([[], []])):
        assert best_matches([1], empty, distances, 5, config) == []
        assert len(end_costs([1], empty, distances, config)) == 0
        assert np.all(np.isinf(best_per_clip([1], empty, distances, config)))
