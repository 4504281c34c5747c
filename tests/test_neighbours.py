"""The nearest words under DTW: exact against a naive oracle, approximate against exact, and the stage of a lake."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from motionlake.arrays import Float32Array, Int64Array
from motionlake.deep_motifs.words.dtw import LANES, listed_distances, word_distances
from motionlake.deep_motifs.words.lower_bounds import WordBounds, survivors
from motionlake.deep_motifs.words.neighbours import (
    Method,
    Neighbours,
    SearchConfig,
    load_index,
    save_index,
    search,
)
from motionlake.deep_motifs.words.word_index import IndexConfig, WordSet, along_path, fit_index
from motionlake.formats import read_clips
from motionlake.lake.catalog import reading
from motionlake.lake.config import load_config
from motionlake.lake.layout import Lake
from motionlake.motion.canonicalise import canonicalise
from motionlake.motion.dtw import Metric
from motionlake.motion.features import WordConfig, word_features
from motionlake.motion.kinematics import solve
from motionlake.motion.rigs import identify, load_rigs
from motionlake.stages import words as words_stage

from tests.lakes import motionlake, query
from tests.test_dtw import naive_align, naive_frame_distance, random_words

EXACT = SearchConfig("exact")
# Fewer words are met and aligned than by default: from small corpora, too, candidates must be chosen.
SPARSE = SearchConfig(probed=1000, candidates=160, aligned=48)
CELLS = IndexConfig(cell=60)


def nearest_words(
    words: WordSet | Float32Array, k: int, groups: Int64Array | None = None,
    config: SearchConfig = EXACT, index: IndexConfig | None = None, threads: int = 1,
) -> Neighbours:  # fmt: skip
    """The k nearest words of each word of a corpus."""
    corpus = words if isinstance(words, WordSet) else WordSet.of_words(words)
    made = fit_index(corpus, groups, index)
    return search(made, corpus, made.groups, k, config, threads=threads)


def smooth_words(n: int, length: int, width: int, seed: int) -> Float32Array:
    """Walks that drift, so that some pairs are near and bounds can rule out others."""
    rng = np.random.default_rng(seed)
    steps = 0.2 * rng.standard_normal((n, length, width)) + 0.3 * rng.standard_normal((n, 1, width))
    return np.asarray(np.cumsum(steps, axis=1) + rng.standard_normal((n, 1, width)), dtype=np.float32)


def naive_distances(words: Float32Array) -> np.ndarray:
    frames = [[[[naive_frame_distance(f, g, "euclidean") for g in b] for f in a] for b in words] for a in words]
    return np.array([[naive_align(np.array(pair), True) for pair in row] for row in frames])


def naive_nearest(distances: np.ndarray, groups: Int64Array, apart: int, k: int) -> np.ndarray:
    """[n, k] distances of the nearest words, infinite where there are too few."""
    allowed = np.where(np.abs(groups[:, None] - groups) >= apart, distances, np.inf)
    padded = np.concatenate([allowed, np.full((len(allowed), k), np.inf)], axis=1)
    return np.sort(padded, axis=1)[:, :k]


@settings(max_examples=25, deadline=None)
@given(
    n=st.integers(1, 10), length=st.integers(1, 5), width=st.integers(1, 4), k=st.integers(1, 4),
    apart=st.integers(1, 3), spread=st.integers(1, 12), seed=st.integers(0, 10_000),
)  # fmt: skip
@example(n=5, length=3, width=1, k=2, apart=1, spread=2, seed=94)  # a cheap cell beside the first of its row
def test_exact_search_equals_comparing_everything(
    n: int, length: int, width: int, k: int, apart: int, spread: int, seed: int
) -> None:
    words = smooth_words(n, length, width, seed)
    groups = np.random.default_rng(seed).integers(0, spread, n)
    truth = naive_distances(words)
    few = SearchConfig("exact", apart=apart, probed=2, candidates=2, aligned=1)
    found = nearest_words(words, k, groups, few, IndexConfig(directions=2, dimension=2, cell=4))
    np.testing.assert_allclose(found.distances, naive_nearest(truth, groups, apart, k), rtol=1e-4, atol=1e-4)
    for word, neighbours in enumerate(found.indices):
        some = neighbours[neighbours >= 0]
        assert len(set(some.tolist())) == len(some)
        assert (np.abs(groups[some] - groups[word]) >= apart).all()
        np.testing.assert_allclose(found.distances[word, : len(some)], truth[word, some], rtol=1e-4, atol=1e-4)


@settings(max_examples=25, deadline=None)
@given(length=st.integers(1, 9), directions=st.integers(1, 5), share=st.floats(0, 1), seed=st.integers(0, 10_000))
def test_bounds_never_rule_out_what_is_near(length: int, directions: int, share: float, seed: int) -> None:
    words = smooth_words(40, length, 5, seed)
    distances = word_distances(words[:7], words)
    thresholds = np.quantile(distances, share, axis=1).astype(np.float32)
    basis = np.linalg.qr(np.random.default_rng(seed).standard_normal((5, 5)))[0][:, :directions].astype(np.float32)
    left = survivors(WordBounds.of(words[:7] @ basis), WordBounds.of(words @ basis), thresholds)
    for row, some in enumerate(left):
        assert set(np.flatnonzero(distances[row] <= thresholds[row])) <= set(some.tolist())


def test_bounds_rule_out_most_of_what_is_far() -> None:
    words = smooth_words(300, 16, 6, 1)
    thresholds = np.quantile(word_distances(words[:20], words), 0.02, axis=1).astype(np.float32)
    left = survivors(WordBounds.of(words[:20]), WordBounds.of(words), thresholds)
    assert np.mean([len(some) for some in left]) < 0.1 * len(words)


@pytest.mark.parametrize("metric", ["euclidean", "geodesic"])
def test_listed_words_are_aligned_as_all_are(metric: Metric) -> None:
    a, b = random_words(3, 7, 8, metric, 1), random_words(90, 7, 8, metric, 2)
    lists = np.random.default_rng(0).integers(0, len(b), (3, 2 * LANES + 5))
    lists[1, 4:] = -1
    one, other = WordSet.of_words(a), WordSet.of_words(b)
    found = listed_distances(one, other, lists, metric)
    expected = np.where(lists >= 0, np.take_along_axis(word_distances(a, b, metric), lists, axis=1), np.inf)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)


def test_words_of_clips_share_frames_without_changing_distances() -> None:
    clips = [smooth_words(1, frames, 6, frames)[0] for frames in (7, 60, 33, 16)]
    words, owners = WordSet.of_clips(clips, WordConfig(length=16, stride=4))
    assert owners.tolist() == [0] + [1] * 12 + [2] * 5 + [3]
    found = listed_distances(words, words, np.tile(np.arange(len(words)), (len(words), 1)))
    every = words.take(slice(None))
    np.testing.assert_allclose(found, word_distances(every, every), rtol=1e-4, atol=1e-4)


def test_equally_near_words_come_in_the_order_of_their_indices() -> None:
    words = np.repeat(smooth_words(4, 5, 3, 2), 6, axis=0)
    for config in (EXACT, SearchConfig()):
        found = nearest_words(words, 5, config=config)
        for word, neighbours in enumerate(found.indices):
            twins = [i for i in range(word // 6 * 6, word // 6 * 6 + 6) if i != word]
            assert neighbours.tolist() == twins
        assert found.distances.max() < 1e-5


@pytest.mark.parametrize("method", ["exact", "approximate"])
def test_where_there_are_too_few_neighbours_places_stay_empty(method: Method) -> None:
    words = smooth_words(5, 4, 3, 3)
    found = nearest_words(words, 3, np.array([0, 0, 0, 0, 9]), SearchConfig(method))
    assert found.indices[:4].tolist() == [[4, -1, -1]] * 4
    assert np.isinf(found.distances[:4, 1:]).all()
    assert sorted(found.indices[4].tolist()) != [-1, -1, -1]
    alone = nearest_words(words, 2, np.zeros(5, np.int64), SearchConfig(method))
    assert (alone.indices == -1).all()


def test_threads_change_nothing() -> None:
    words = smooth_words(500, 8, 5, 4)
    one, two = (nearest_words(words, 4, config=SPARSE, index=CELLS, threads=t) for t in (1, 2))
    np.testing.assert_array_equal(one.indices, two.indices)
    np.testing.assert_array_equal(one.distances, two.distances)


def test_rotations_are_searched_with_their_own_distance() -> None:
    words = random_words(40, 4, 8, "geodesic", 5)
    words[20:] = words[:20] + 0.01 * words[::-1][:20]
    words /= np.linalg.norm(words.reshape(40, 4, 2, 4), axis=3).repeat(4, axis=2).reshape(words.shape)
    truth = word_distances(words, words, "geodesic")
    np.fill_diagonal(truth, np.inf)
    found = nearest_words(words, 3, config=SearchConfig("exact", "geodesic"))
    np.testing.assert_allclose(found.distances, np.sort(truth, axis=1)[:, :3], rtol=1e-4, atol=1e-4)


def test_points_along_a_path_do_not_depend_on_its_speed() -> None:
    turn = np.linspace(0, 3, 400)
    slow, fast = (np.column_stack([np.cos(t), np.sin(t)])[None].astype(np.float32) for t in (turn, turn**2 / 3))
    np.testing.assert_allclose(along_path(slow, 6), along_path(fast, 6), atol=5e-3)
    still = np.ones((1, 4, 2), np.float32)
    np.testing.assert_array_equal(along_path(still, 3), np.ones((1, 3, 2), np.float32))


def test_mistakes_are_named() -> None:
    words = smooth_words(4, 3, 2, 6)
    with pytest.raises(ValueError, match="no words"):
        nearest_words(words[:0], 1)
    with pytest.raises(ValueError, match="k is 0"):
        nearest_words(words, 0)
    with pytest.raises(ValueError, match="do not fit 4 words"):
        nearest_words(words, 1, np.zeros(3, np.int64))
    with pytest.raises(ValueError, match="not finite"):
        nearest_words(np.where(words == words[2, 1, 1], np.nan, words), 1)
    with pytest.raises(ValueError, match="different shapes"):
        search(fit_index(WordSet.of_words(words)), WordSet.of_words(words[:, :2]), np.zeros(4, np.int64), 1)
    with pytest.raises(ValueError, match="beyond"):
        WordSet(words[0], np.array([1]), 3)


def test_a_saved_corpus_answers_as_before(tmp_path: Path) -> None:
    words = WordSet.of_words(smooth_words(300, 6, 4, 7))
    searched = fit_index(words, config=CELLS)
    save_index(searched, tmp_path / "index.safetensors", {"clips": ["a"]})
    loaded, notes = load_index(tmp_path / "index.safetensors")
    assert notes == {"clips": ["a"]}
    one, two = (search(s, words, s.groups, 3, SPARSE) for s in (searched, loaded))
    np.testing.assert_array_equal(one.indices, two.indices)
    np.testing.assert_array_equal(one.distances, two.distances)


def lake_words(lake: Path) -> tuple[WordSet, Int64Array, list[str]]:
    """The words of a lake, the clip each is of, and the clips."""
    root = Lake(lake)
    config = load_config(root.config_file).words
    with reading(root) as con:
        files = words_stage.features_files(con, config).values()
    features = dict(f for file in files for f in words_stage.read_features(root.path(file)))
    clips = sorted(features)
    words, owners = WordSet.of_clips([features[c] for c in clips], config)
    return words, owners, clips


def recorded_words(recordings: Path, clips: int) -> tuple[WordSet, Int64Array]:
    """Words of stride 1 of the first clips of bandai1, and the clip each is of."""
    rigs, config = load_rigs(), WordConfig(stride=1)
    features = []
    for path in sorted((recordings / "bandai1" / "clips").rglob("*.bvh"))[:clips]:
        clip = read_clips(path)[0]
        motion = canonicalise(clip, solve(clip), identify(clip.hierarchy.joints, rigs))
        features.append(word_features(motion.positions, motion.rotations, motion.fps, config))
    return WordSet.of_clips(features, config)


@pytest.mark.recordings
def test_both_methods_find_the_neighbours_of_recorded_words(recordings: Path) -> None:
    words, owners = recorded_words(recordings, 24)
    assert len(words) > 2.5 * SPARSE.probed
    every = words.take(slice(None))
    distances = word_distances(every, every)
    allowed = np.where(owners[:, None] != owners, distances, np.inf)
    truth = np.sort(np.partition(allowed, 5, axis=1)[:, :5], axis=1)
    exact = nearest_words(words, 5, owners)
    np.testing.assert_allclose(exact.distances, truth, rtol=1e-3, atol=1e-5)
    found = nearest_words(words, 5, owners, SPARSE, CELLS)
    recall = np.mean(found.distances <= truth[:, -1:] * (1 + 1e-4) + 1e-6)
    assert 0.95 <= recall < 1


def test_the_lake_knows_the_neighbours_of_every_word(lake: Path) -> None:
    run = motionlake("run", "neighbours", "--lake", lake, "--workers", "1")
    assert run.status == 0, run.err
    words, owners, clips = lake_words(lake)
    every = words.take(slice(None))
    allowed = np.where(owners[:, None] != owners, word_distances(every, every), np.inf)
    rows = query(lake, "SELECT clip, word, rank, neighbour, neighbour_word, distance FROM word_neighbours ORDER BY ALL")
    assert len(rows) == 5 * len(words)
    np.testing.assert_allclose(
        np.array([r[5] for r in rows]).reshape(-1, 5), np.sort(allowed, axis=1)[:, :5], rtol=1e-3, atol=1e-5
    )
    first = np.searchsorted(owners, np.arange(len(clips)))
    for clip, word, _, other, other_word, distance in rows[:200]:
        place = allowed[first[clips.index(clip)] + word, first[clips.index(other)] + other_word]
        assert distance == pytest.approx(place, rel=1e-3, abs=1e-5)
    clip = clips[-1]
    similar = query(lake, "FROM similar_words($clip, 0, 3)", clip=clip)
    assert [r[0] for r in similar] == [1, 2, 3]
    assert [r[1:4] for r in similar] == [r[3:] for r in rows if r[:2] == (clip, 0)][:3]
    ranges = query(
        lake, "SELECT start, stop FROM words WHERE clip = $c AND word = $w", c=similar[0][1], w=similar[0][2]
    )
    assert [similar[0][4:]] == ranges

    again = motionlake("run", "neighbours", "--lake", lake, "--workers", "1", "--json")
    assert again.json[0]["shards"] == 0
    stages = {s["stage"]: s for s in motionlake("status", "--lake", lake, "--json").json["stages"]}
    assert stages["neighbours"]["due"] == 0
    gone = rows[0][3]
    assert motionlake("remove", gone, "--lake", lake).status == 0
    assert query(lake, "SELECT count(*) FROM word_neighbours WHERE neighbour = $c OR clip = $c", c=gone) == [(0,)]
    refitted = motionlake("run", "neighbours", "--refit", "--lake", lake, "--workers", "1")
    assert refitted.status == 0, refitted.err
    left = query(lake, "SELECT count(*) FROM words")[0][0]
    assert query(lake, "SELECT count(*) FROM word_neighbours") == [(5 * left,)]


def test_one_clip_has_no_other_clips(lake: Path) -> None:
    clips = [r[0] for r in query(lake, "SELECT clip FROM clips ORDER BY clip")]
    assert motionlake("remove", *clips[1:], "--lake", lake).status == 0
    run = motionlake("run", "neighbours", "--lake", lake, "--workers", "1")
    assert run.status == 2
    assert "neighbours are sought in other clips, and 1 have words" in run.err
