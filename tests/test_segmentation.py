"""Segmentation: windows and votes against plain loops, the verdict "unknown", bands, real takes."""

from __future__ import annotations

import csv
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.deep_motifs.emd import emd
from motionlake.deep_motifs.segmentation import (
    UNKNOWN,
    LabelledRange,
    SegmentationConfig,
    Segmenter,
    WordLabels,
    bands,
    centred_signatures,
    labelled_windows,
)
from motionlake.deep_motifs.signatures import Corpus, CorpusClip, signature
from motionlake.errors import UserError
from numpy.typing import NDArray

STRIDE, LENGTH = 20, 80


def corpus_of(
    clips: list[list[int]],
    places: NDArray[np.floating],
    idf: NDArray[np.float64] | None = None,
    *,
    stride: int = STRIDE,
    length: int = LENGTH,
) -> Corpus:
    """Clips of words given by their motifs; a word every `stride` frames, `length` frames long."""
    offsets = np.cumsum([0, *map(len, clips)])
    starts = np.concatenate([np.arange(len(c)) * stride for c in clips])
    frames = [(len(c) - 1) * stride + length for c in clips]
    known = [CorpusClip(f"set/{i}", "set", None, None, None, 120.0, n) for i, n in enumerate(frames)]
    k = len(places)
    weights = np.ones(k) if idf is None else idf
    motifs = np.concatenate(clips).astype(np.int32)
    return Corpus(
        known, offsets, motifs, starts, starts + length, places.astype(np.float32), weights, np.ones(k), "m-1"
    )


def whole(corpus: Corpus, clip: int, label: str) -> LabelledRange:
    return LabelledRange(clip, 0, corpus.clips[clip].frames, label)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.integers(0, 4), min_size=1, max_size=25), st.integers(1, 12))
def test_windows_are_centred_and_cut_at_the_ends(motifs: list[int], n_words: int) -> None:
    idf = np.array([1.0, 2, 1.5, 1, 3])
    found = centred_signatures(np.array(motifs), idf, n_words)
    for i in range(len(motifs)):
        window = [motifs[j] for j in range(i - n_words // 2, i - n_words // 2 + n_words) if 0 <= j < len(motifs)]
        np.testing.assert_allclose(found[i], signature(np.bincount(window, minlength=5), idf), atol=1e-6)


def naive_labels(corpus: Corpus, taught: list[LabelledRange], clip: int, config: SegmentationConfig) -> list[str]:
    """The definition, by loops over every pair of windows."""
    rows = []
    for r in taught:
        windows = centred_signatures(corpus.motifs[corpus.words_of(r.clip)], corpus.idf, config.window)
        rows += [
            (windows[i], r.label) for i in range(len(windows)) if r.start <= i * STRIDE + (LENGTH - 1) / 2 < r.stop
        ]
    queries = centred_signatures(corpus.motifs[corpus.words_of(clip)], corpus.idf, config.window)
    ballots: list[Any] = []  # Counters of shares: their annotation knows whole numbers alone
    for query in queries:
        ranked = sorted((emd(query, window, corpus.ground), i) for i, (window, _) in enumerate(rows))
        names = [rows[i][1] for _, i in ranked[: config.k]]
        ballots.append(Counter({name: count / len(names) for name, count in Counter(names).items()}))
        for name in set(names):
            ballots[-1][name] += 1e-9 / (1 + names.index(name))
    labels = []
    for j in range(len(queries)):
        votes: Counter[str] = sum((ballots[i] for i in range(len(queries)) if abs(i - j) <= config.reach), Counter())
        labels.append(max(sorted(votes), key=lambda name: votes[name]))
    return labels


@pytest.mark.parametrize("reach", [0, 4, 40])
@pytest.mark.parametrize("window", [1, 4, 9])
def test_classes_are_those_of_the_definition(reach: int, window: int) -> None:
    random = np.random.default_rng(window)
    clips = [random.integers(0, 8, size=n).tolist() for n in (30, 21, 17, 26)]
    corpus = corpus_of(clips, random.standard_normal((8, 3)), random.uniform(1, 2, 8))
    taught = [
        LabelledRange(0, 0, 300, "a"),
        LabelledRange(0, 300, 660, "b"),
        whole(corpus, 1, "c"),
        whole(corpus, 2, "b"),
    ]
    config = SegmentationConfig(window, 5, reach, unknown=None)
    segmenter = Segmenter(labelled_windows(corpus, taught, window), corpus.ground, config)
    found = segmenter.label_words(corpus.motifs[corpus.words_of(3)], corpus.idf)
    assert found.labels.tolist() == naive_labels(corpus, taught, 3, config)


def test_a_tie_of_votes_goes_to_the_class_of_the_nearest() -> None:
    """Two voters of two classes: the nearer decides, whichever name comes first."""
    places = np.array([[0.0], [1.0], [-2.0]])
    for near, far in (("a", "b"), ("b", "a")):
        corpus = corpus_of([[1] * 6, [2] * 6, [0] * 6], places)
        taught = [whole(corpus, 0, near), whole(corpus, 1, far)]
        config = SegmentationConfig(window=1, k=12, reach=0, unknown=None)
        segmenter = Segmenter(labelled_windows(corpus, taught, 1), corpus.ground, config)
        judged = segmenter.label_words(corpus.motifs[corpus.words_of(2)], corpus.idf)
        assert judged.labels.tolist() == [near] * 6


def test_what_was_never_taught_is_unknown() -> None:
    """Two classes near two motifs, taught by two clips each; a third movement lies far from both."""
    places = np.array([[0.0, 0], [0.2, 0], [5, 0], [5.2, 0], [0, 9]])
    clips = [[0, 1] * 10, [1, 0, 0] * 7, [2, 3] * 10, [3, 2, 2] * 7, [0, 1] * 10 + [4] * 20 + [2, 3] * 10]
    corpus = corpus_of(clips, places)
    taught = [whole(corpus, i, label) for i, label in enumerate("aabb")]
    config = SegmentationConfig(window=9, reach=6)
    segmenter = Segmenter(labelled_windows(corpus, taught, 9), corpus.ground, config)
    motifs = corpus.motifs[corpus.words_of(4)]
    judged = segmenter.label_words(motifs, corpus.idf).labels
    assert judged[:15].tolist() == ["a"] * 15
    assert judged[22:38].tolist() == [UNKNOWN] * 16
    assert judged[45:].tolist() == ["b"] * 15
    assert set(segmenter.label_words(motifs, corpus.idf, forced=True).labels) == {"a", "b"}


def test_thresholds_are_the_largest_distances_from_other_clips() -> None:
    random = np.random.default_rng(3)
    clips = [random.integers(0, 6, size=n).tolist() for n in (14, 11, 16)]
    corpus = corpus_of(clips, random.standard_normal((6, 2)))
    taught = [whole(corpus, 0, "a"), whole(corpus, 1, "a"), whole(corpus, 2, "alone")]
    teaching = labelled_windows(corpus, taught, 9)
    segmenter = Segmenter(teaching, corpus.ground)
    nearest = [
        min(
            emd(s, t, corpus.ground) for t, other in zip(teaching.signatures, teaching.clips, strict=True) if other != c
        )
        for s, c in zip(teaching.signatures, teaching.clips, strict=True)
        if c != 2
    ]
    # The class that one clip alone teaches has the threshold of the others.
    assert segmenter.thresholds == pytest.approx([max(nearest), max(nearest)])
    alone = Segmenter(labelled_windows(corpus, taught[:1], 9), corpus.ground)
    assert np.isinf(alone.thresholds).all()


def test_a_range_shorter_than_a_word_teaches_one_window_and_mirrors_teach_too() -> None:
    corpus = corpus_of([[0] * 12, [1] * 12], np.eye(2))
    teaching = labelled_windows(corpus, [LabelledRange(0, 100, 104, "a")], 9)
    assert teaching.labels.tolist() == ["a"]
    mirrored = labelled_windows(corpus, [LabelledRange(0, 100, 104, "a")], 9, {0: np.ones(12, dtype=np.int32)})
    assert mirrored.signatures.tolist() == [[1, 0], [0, 1]]
    assert mirrored.mirrored.tolist() == [False, True]


def test_a_mirror_image_counts_as_farther() -> None:
    """Class "a" lies at 1 from the query, the mirror image of class "b" at 0.9: at 1.25 as far it loses."""
    corpus = corpus_of([[0] * 9, [1] * 9, [2] * 9], np.array([[1.0, 0], [0, 50], [0, 0], [0.9, 0]]))
    taught = [whole(corpus, 0, "a"), whole(corpus, 1, "b")]
    images = {0: np.full(9, 1, dtype=np.int32), 1: np.full(9, 3, dtype=np.int32)}
    for factor, label in ((1.25, "a"), (1.0, "b")):
        config = SegmentationConfig(mirror_factor=factor, unknown=None)
        segmenter = Segmenter(labelled_windows(corpus, taught, 9, images), corpus.ground, config)
        found = segmenter.label_words(corpus.motifs[corpus.words_of(2)], corpus.idf)
        assert set(found.labels) == {label}
        assert found.distances == pytest.approx(1.0 if label == "a" else 0.9)


def test_frames_take_the_class_of_the_word_whose_centre_is_nearest() -> None:
    centres = np.array([39.5, 59.5, 79.5, 99.5])
    found = WordLabels(np.array(["a", "a", "b", "b"]), np.array([0.0, 1, 2, 3]), np.ones(4))
    assert [(b.start, b.stop, b.label, b.distance) for b in bands(found, centres, 140)] == [
        (0, 70, "a", 0.5),
        (70, 140, "b", 2.5),
    ]
    for frame in range(140):
        (band,) = [b for b in bands(found, centres, 140) if b.start <= frame < b.stop]
        assert band.label == found.labels[np.argmin(np.abs(centres - frame))]


@pytest.mark.parametrize(
    ("wrong", "says"), [({"window": 0}, "at least 1"), ({"k": 0}, "at least 1"), ({"unknown": 2}, "quantile")]
)
def test_settings_without_meaning_are_refused(wrong: dict[str, int], says: str) -> None:
    with pytest.raises(UserError, match=says):
        SegmentationConfig(**wrong)


def test_nothing_taught_is_an_error() -> None:
    with pytest.raises(UserError, match=r"segments\.csv"):
        labelled_windows(corpus_of([[0, 1]], np.eye(2)), [], 9)


@pytest.mark.recordings
def test_real_takes_are_segmented_by_the_others(recordings: Path) -> None:
    """cmu_exercises with the pretrained words, one take left out: nearly every word, by few bands.

    With the columns of the weights shuffled .94 of the words are right.
    """
    from motionlake.deep_motifs.motifs import assign, fit_motifs
    from motionlake.formats import read_clips
    from motionlake.motion.canonicalise import canonicalise
    from motionlake.motion.features import WordConfig, word_features
    from motionlake.motion.kinematics import solve
    from motionlake.motion.rigs import identify, load_rigs

    from tests.pretrained_words import embedded

    rows = list(csv.DictReader((recordings / "cmu_exercises" / "segments.csv").open(encoding="utf-8")))
    names = sorted({row["file"] for row in rows})[:3]
    config, features = WordConfig(), []
    for name in names:
        clip = read_clips(recordings / "cmu_exercises" / name)[0]
        motion = canonicalise(clip, solve(clip), identify(clip.hierarchy.joints, load_rigs()))
        features.append(word_features(motion.positions, motion.rotations, motion.fps, config))
    words = embedded(features)
    motifs = fit_motifs(np.concatenate(words), 100, 0)
    assigned = [assign(each, motifs).tolist() for each in words]
    corpus = corpus_of(assigned, motifs.centroids, stride=10, length=60)  # of the recordings' 120 frames a second
    taught = [
        LabelledRange(names.index(row["file"]), int(row["start"]), int(row["stop"]), row["label"])
        for row in rows
        if row["file"] in names[:2]
    ]
    truth = [(int(r["start"]), int(r["stop"]), r["label"]) for r in rows if r["file"] == names[2]]
    segmenter = Segmenter(labelled_windows(corpus, taught, 18), corpus.ground, SegmentationConfig(window=18, reach=12))
    last = corpus.words_of(2)
    centres = (corpus.starts[last] + corpus.stops[last] - 1) / 2
    found = segmenter.label_words(corpus.motifs[last], corpus.idf)
    expected = [next((label for start, stop, label in truth if start <= c < stop), "") for c in centres]
    assert np.mean(found.labels == np.array(expected)) > 0.95
    assert len(bands(found, centres, corpus.clips[2].frames)) < 3 * len(truth)
