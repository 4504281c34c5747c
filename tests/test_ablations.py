"""Words grouped by DTW, as `bench.representation` compares them with learned ones."""

from __future__ import annotations

import numpy as np
from motionlake.arrays import Float32Array
from motionlake.motion.features import WordConfig

from bench.representation import by_dtw, medoids_of

CONFIG = WordConfig(stride=12)
RNG_SEED = 3


def bump(at: float, feature: int) -> Float32Array:
    """[12, 88] a word in which one feature rises and falls around frame `at`."""
    word = np.zeros((CONFIG.length, CONFIG.dimension), dtype=np.float32)
    word[:, feature] = np.exp(-((np.arange(CONFIG.length) - at) ** 2) / 2)
    return word


def test_medoids_are_the_words_nearest_to_centroids() -> None:
    rng = np.random.default_rng(RNG_SEED)
    groups = [np.stack([bump(5, f)] * 9) + rng.normal(0, 1e-3, (9, 12, 88)) for f in (0, 7)]
    words = np.concatenate(groups).astype(np.float32)
    medoids = medoids_of(words, 2, 0)
    expected = []
    for group in np.split(words, 2):
        from_centre = np.linalg.norm((group - group.mean(axis=0)).reshape(9, -1), axis=1)
        expected.append(group[np.argmin(from_centre)])
    assert {m.tobytes() for m in medoids} == {e.tobytes() for e in expected}


def test_dtw_groups_words_that_differ_in_time_alone() -> None:
    """A late bump is nearer to stillness than to an early bump frame by frame, and an early bump to DTW."""
    early, still, late = [bump(4, 0)] * 5, [np.zeros_like(bump(4, 0))] * 5, bump(8, 0)
    assert np.linalg.norm(late - still[0]) < np.linalg.norm(late - early[0])
    grouped = by_dtw([*early, *still, late], CONFIG, 2, 0)
    groups = [int(clip[0]) for clip in grouped.clips]
    assert groups[-1] == groups[0] != groups[5]
    assert groups == [groups[0]] * 5 + [groups[5]] * 5 + [groups[0]]
    np.testing.assert_array_equal(grouped.ground, grouped.ground.T)
    assert (np.diag(grouped.ground) == 0).all()
    assert grouped.ground[0, 1] > 0
