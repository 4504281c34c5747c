"""Words of recordings as the weights that come with the package embed them, for tests of what is made of them."""

from __future__ import annotations

from collections.abc import Sequence

from motionlake.arrays import Float32Array, Float64Array
from motionlake.deep_motifs.config import PRETRAINED_WORDS
from motionlake.motion.features import WordConfig, word_windows

from bench.canonical_sets import LabelledClip, features


def embedded(clips: Sequence[Float32Array]) -> list[Float32Array]:
    """[n, d] of the words of each clip of features [T, D]."""
    from motionlake.deep_motifs.words.network import load_network

    network = load_network(PRETRAINED_WORDS.file)
    return [network.embed(word_windows(clip, WordConfig())) for clip in clips]


def signature_distances(clips: list[LabelledClip], k: int) -> Float64Array:
    """[n, n] distances of the signatures of clips, by motifs of their own words."""
    import numpy as np
    from motionlake.deep_motifs.emd import emd_matrix, ground_distances
    from motionlake.deep_motifs.motifs import assign, fit_motifs
    from motionlake.deep_motifs.signatures import signatures

    words = embedded(features(clips, WordConfig()))
    motifs = fit_motifs(np.concatenate(words), k, 0)
    made, _ = signatures([assign(each, motifs) for each in words], motifs.k)
    return emd_matrix(made, ground_distances(motifs.centroids))
