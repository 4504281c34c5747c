"""tf-idf signatures by hand."""

from __future__ import annotations

import numpy as np
import pytest
from motionlake.deep_motifs.signatures import (
    inverse_document_frequency,
    signature,
    signatures,
)


def test_signatures_by_hand() -> None:
    clips = [np.array([0, 0, 1, 0]), np.array([0, 2]), np.array([0])]
    made, idf = signatures(clips, 4)
    expected_idf = [1.0, np.log(4 / 2) + 1, np.log(4 / 2) + 1, np.log(4) + 1]
    np.testing.assert_allclose(idf, expected_idf)
    rare = np.log(2) + 1
    np.testing.assert_allclose(made[0], [3 / (3 + rare), rare / (3 + rare), 0, 0], rtol=1e-6)
    np.testing.assert_allclose(made[1], [1 / (1 + rare), 0, rare / (1 + rare), 0], rtol=1e-6)
    np.testing.assert_allclose(made[2], [1, 0, 0, 0])
    assert made.dtype == np.float32


def test_a_signature_knows_neither_length_nor_order() -> None:
    words = np.random.default_rng(0).integers(0, 30, 50)
    idf = np.linspace(1, 4, 30)
    once, thrice = (signature(np.bincount(w, minlength=30), idf) for w in (words, np.tile(words[::-1], 3)))
    np.testing.assert_allclose(once, thrice, rtol=1e-6)
    assert once.sum() == pytest.approx(1)


def test_document_frequency_counts_clips_not_words() -> None:
    idf = inverse_document_frequency(np.array([[5, 0, 1], [1, 0, 0]]))
    np.testing.assert_allclose(idf, np.log(3 / (1 + np.array([2, 0, 1]))) + 1)


def test_a_clip_without_words_has_no_signature() -> None:
    with pytest.raises(ValueError, match="without words"):
        signature(np.zeros(3, dtype=np.int64), np.ones(3))
