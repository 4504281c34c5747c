"""Segmentation by words: paths, distances and thresholds against plain loops, the verdict "unknown", real takes."""

from __future__ import annotations

import csv
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.deep_motifs import word_segmentation
from motionlake.deep_motifs.segmentation import UNKNOWN, LabelledRange
from motionlake.deep_motifs.word_segmentation import (
    ClipWords,
    TaughtWords,
    WordSegmentation,
    WordSegmenter,
    cheapest_path,
    taught_words,
)
from motionlake.errors import UserError
from numpy.typing import NDArray

Vectors = NDArray[np.float32]


def words_of(vectors: Vectors, mirrored: Vectors | None = None) -> ClipWords:
    return ClipWords(vectors, mirrored, np.ones(len(vectors)))


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 5), st.integers(1, 3), st.integers(0, 2**32 - 1))
def test_the_path_is_the_cheapest_of_all(steps: int, states: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    costs, changes = random.uniform(0, 2, (steps, states)), random.uniform(0, 1.5, steps)

    def price(path: tuple[int, ...]) -> float:
        switches = sum(changes[i] for i in range(1, steps) if path[i] != path[i - 1])
        return float(sum(costs[i, state] for i, state in enumerate(path)) + switches)

    found = cheapest_path(costs, changes)
    assert price(tuple(found.tolist())) == pytest.approx(min(map(price, product(range(states), repeat=steps))))


def some_segments(random: np.random.Generator) -> list[TaughtWords]:
    places = (("a", 0, 9), ("b", 0, 4), ("a", 1, 13), ("c", 1, 1), ("b", 2, 6), ("d", 2, 8))
    return [
        TaughtWords(label, clip, *(random.standard_normal((n, 3)).astype(np.float32) for _ in range(2)))
        for label, clip, n in places
    ]


def naive_distance(word: Vectors, segment: TaughtWords, factor: float) -> float:
    assert segment.mirrored is not None
    own = min(float(np.linalg.norm(word - other)) for other in segment.vectors)
    return min(own, factor * min(float(np.linalg.norm(word - other)) for other in segment.mirrored))


@pytest.mark.parametrize("rows", [4096, 5])
def test_words_take_the_nearest_class_where_borders_cost_nothing(rows: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where segments are compared in pieces that cut them."""
    monkeypatch.setattr(word_segmentation, "_ROWS", rows)
    random = np.random.default_rng(rows)
    taught, query = some_segments(random), random.standard_normal((20, 3)).astype(np.float32)
    found = WordSegmenter(taught, WordSegmentation(mirror_factor=1.5, border=0)).label_words(
        words_of(query), forced=True
    )
    for word, label, distance, confidence in zip(query, found.labels, found.distances, found.confidence, strict=True):
        by_class: dict[str, float] = {}
        for segment in taught:
            at = naive_distance(word, segment, 1.5)
            by_class[segment.label] = min(at, by_class.get(segment.label, np.inf))
        first, second, *_ = sorted(by_class, key=lambda name: by_class[name])
        assert label == first
        assert distance == pytest.approx(by_class[first], abs=1e-5)
        assert confidence == pytest.approx(by_class[second] / (by_class[first] + by_class[second]), abs=1e-4)


def test_the_threshold_is_that_of_the_definition() -> None:
    taught = some_segments(np.random.default_rng(8))
    known, other = [], []
    for one in taught:
        apart = [each for each in taught if each.clip != one.clip]
        to_all = [min(naive_distance(word, each, 1.25) for each in apart) for word in one.vectors]
        unlike = [each for each in apart if each.label != one.label]
        to_unlike = [min(naive_distance(word, each, 1.25) for each in unlike) for word in one.vectors]
        if one.label in {each.label for each in apart}:
            known.append(np.mean(to_all))
        other.append(np.mean(to_unlike))
    assert WordSegmenter(taught).threshold == pytest.approx(max(max(known), np.median(other)), rel=1e-5)


def test_one_clip_alone_tells_nothing_of_the_unknown() -> None:
    near = np.zeros((6, 2), dtype=np.float32)
    segmenter = WordSegmenter([TaughtWords("a", 0, near, None), TaughtWords("b", 0, near + 1, None)])
    assert np.isinf(segmenter.threshold)
    far = segmenter.label_words(words_of(near + 50))
    assert set(far.labels) == {"b"}


def two_kinds(random: np.random.Generator) -> list[TaughtWords]:
    """Two classes, each in two clips; all begin with the same rest."""

    def segment(label: str, clip: int, place: tuple[float, float]) -> TaughtWords:
        rest, moving = random.normal(0, 0.1, (8, 2)), random.normal(place, 0.3, (24, 2))
        return TaughtWords(label, clip, np.concatenate([rest, moving]).astype(np.float32), None)

    return [segment(*each) for each in (("a", 0, (6, 0)), ("b", 0, (0, 6)), ("a", 1, (6, 0)), ("b", 1, (0, 6)))]


def test_what_was_never_taught_is_unknown_and_a_rest_within_it_too() -> None:
    random = np.random.default_rng(2)
    rest = random.normal(0, 0.1, (5, 2))
    parts = [random.normal((6, 0), 0.3, (30, 2)), random.normal((-9, -9), 0.3, (20, 2)), rest]
    parts += [random.normal((-9, -9), 0.3, (20, 2)), random.normal((0, 6), 0.3, (30, 2))]
    words = words_of(np.concatenate(parts).astype(np.float32))
    segmenter = WordSegmenter(two_kinds(random))
    found = segmenter.label_words(words).labels
    assert found.tolist() == ["a"] * 30 + [UNKNOWN] * 45 + ["b"] * 30
    assert set(segmenter.label_words(words, forced=True).labels) == {"a", "b"}
    never = WordSegmenter(two_kinds(random), WordSegmentation(unknown=False)).label_words(words)
    assert set(never.labels) == {"a", "b"}


def test_a_short_slip_breaks_no_segment() -> None:
    random = np.random.default_rng(4)
    vectors = random.normal((6, 0), 0.3, (40, 2)).astype(np.float32)
    vectors[20:22] = (2.8, 3.2)
    held = WordSegmenter(two_kinds(random), WordSegmentation(border=1))
    assert set(held.label_words(words_of(vectors), forced=True).labels) == {"a"}
    free = WordSegmenter(two_kinds(random), WordSegmentation(border=0))
    assert "b" in free.label_words(words_of(vectors), forced=True).labels


def test_a_border_lies_where_the_body_rests() -> None:
    """Between the classes 10 words are as near to the one as to the other: the border is at the slowest of them."""
    taught = [TaughtWords("a", 0, np.array([[0, 0]] * 9, np.float32), None),
              TaughtWords("b", 0, np.array([[4, 0]] * 9, np.float32), None)]  # fmt: skip
    vectors = np.array([[0.5, 0]] * 10 + [[2, 0]] * 10 + [[3.5, 0]] * 10, np.float32)
    for slow in (12, 17):
        pace = np.ones(30)
        pace[slow] = 0.1
        found = WordSegmenter(taught).label_words(ClipWords(vectors, None, pace)).labels
        assert np.flatnonzero(found == "b")[0] in (slow, slow + 1)


def test_ranges_take_the_words_whose_centres_they_hold() -> None:
    vectors = np.arange(10, dtype=np.float32).reshape(5, 2)
    words, centres = words_of(vectors, -vectors), np.array([10.0, 20, 30, 40, 50])
    inside, nearest = taught_words(
        [(LabelledRange(3, 15, 40, "a"), words, centres), (LabelledRange(3, 41, 43, "b"), words, centres)]
    )
    assert (inside.label, inside.clip) == ("a", 3)
    assert inside.vectors.tolist() == vectors[1:3].tolist()
    assert nearest.vectors.tolist() == vectors[3:4].tolist()
    assert nearest.mirrored is not None
    assert nearest.mirrored.tolist() == (-vectors[3:4]).tolist()


@pytest.mark.parametrize("wrong", [{"mirror_factor": 0.9}, {"border": -1.0}, {"rest": -0.1}])
def test_settings_without_meaning_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(UserError, match="at least"):
        WordSegmentation(**wrong)  # type: ignore[arg-type]


def test_nothing_taught_is_an_error() -> None:
    with pytest.raises(UserError, match=r"segments\.csv"):
        WordSegmenter([])


@pytest.mark.recordings
def test_real_takes_are_segmented_by_the_others(recordings: Path) -> None:
    """Three takes of cmu_exercises with the pretrained words, each left out in turn."""
    from motionlake.deep_motifs.config import PRETRAINED_WORDS
    from motionlake.deep_motifs.words.network import load_network
    from motionlake.formats import read_clips
    from motionlake.motion.canonicalise import canonicalise
    from motionlake.motion.features import (
        WordConfig,
        mirrored_features,
        native_ranges,
        windows,
        word_features,
        word_windows,
    )
    from motionlake.motion.kinematics import solve
    from motionlake.motion.rigs import identify, load_rigs

    rows = list(csv.DictReader((recordings / "cmu_exercises" / "segments.csv").open(encoding="utf-8")))
    names = sorted({row["file"] for row in rows})[:3]
    config, network = WordConfig(), load_network(PRETRAINED_WORDS.file)
    seen, centres = [], []
    for name in names:
        clip = read_clips(recordings / "cmu_exercises" / name)[0]
        motion = canonicalise(clip, solve(clip), identify(clip.hierarchy.joints, load_rigs()))
        features = word_features(motion.positions, motion.rotations, motion.fps, config)
        starts = windows(len(features), config)
        ranges = native_ranges(starts, motion.fps, len(motion.positions), config)
        centres.append((ranges[:, 0] + ranges[:, 1] - 1) / 2)
        own, turned = (network.embed(word_windows(f, config)) for f in (features, mirrored_features(features, config)))
        seen.append(ClipWords(own, turned, np.ones(len(own))))
    segments = [
        LabelledRange(names.index(row["file"]), int(row["start"]), int(row["stop"]), row["label"])
        for row in rows
        if row["file"] in names
    ]
    for left_out in range(3):
        taught = [(r, seen[r.clip], centres[r.clip]) for r in segments if r.clip != left_out]
        classes = {r.label for r, _, _ in taught}
        found = WordSegmenter(taught_words(taught)).label_words(seen[left_out]).labels
        truth = [next(r.label for r in segments if r.clip == left_out and r.start <= c < r.stop)
                 for c in centres[left_out]]  # fmt: skip
        known = np.isin(truth, sorted(classes))
        assert np.mean(found[known] == np.array(truth)[known]) > 0.9
