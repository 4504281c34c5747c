"""Which word representation retrieves best: `python -m bench.representation [SET ...]`.

Leave-one-out retrieval over whole clips with one pipeline: embedded words, k-means K = 100, tf-idf, exact
Earth Mover's Distance over the distances of centroids. Words are embedded by their first 48 principal
components ("shallow") or by the trained network; means over 3 seeds. Defaults are chosen by the mean over
the sets, never per set.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import asdict
from typing import Final

import numpy as np
from sklearn.decomposition import PCA
from threadpoolctl import threadpool_limits

from bench.canonical_sets import LabelledClip, features, load
from bench.record import record
from pipeline.emd import emd_matrix, ground_distances
from pipeline.evaluation.retrieval import RetrievalScores, leave_one_out
from pipeline.motifs import assign, fit_motifs
from pipeline.signatures import signatures
from pipeline.words.config import NetworkConfig
from pipeline.words.features import Float32Array, WordConfig
from pipeline.words.training import Recipe, train_words
from pipeline.words.windows import word_windows

SEEDS: Final = (0, 1, 2)
K: Final = 100
COMPONENTS: Final = 48
STEPS: Final = 500
FLOORS: Final = {"hdm05": 0.963, "salsa": 0.947, "bandai1": 0.377, "utd_mhad": 0.724}
Embedding = Callable[[list[Float32Array], WordConfig, int], list[Float32Array]]

VARIANTS: Final = {
    "positions": WordConfig(root_weight=0, velocity_weight=0),
    "positions, root 3": WordConfig(root_weight=3, velocity_weight=0),
    "positions, velocities 2": WordConfig(root_weight=0, velocity_weight=2),
    "positions, root 3, velocities 2": WordConfig(root_weight=3, velocity_weight=2),
    "positions of 16 joints, root 3": WordConfig(joints="deep_motifs16", root_weight=3, velocity_weight=0),
    "rotations": WordConfig.deep_motifs(),
}


def shallow(clips: list[Float32Array], config: WordConfig, seed: int) -> list[Float32Array]:
    """The first principal components of flattened words."""
    words = [word_windows(clip, config) for clip in clips]
    flat = np.concatenate([w.reshape(len(w), -1) for w in words])
    with threadpool_limits(limits=1):
        reduced = PCA(COMPONENTS, svd_solver="covariance_eigh").fit_transform(flat).astype(np.float32)
    return np.split(reduced, np.cumsum([len(w) for w in words])[:-1])


def trained(clips: list[Float32Array], config: WordConfig, seed: int) -> list[Float32Array]:
    """The default network, trained on the set's own clips without their labels."""
    network = train_words(clips, config, NetworkConfig(seed=seed, steps=STEPS))
    return [network.embed(word_windows(clip, config)) for clip in clips]


def trained_as_published(clips: list[Float32Array], config: WordConfig, seed: int) -> list[Float32Array]:
    """The same network, trained with the paper's positives, distance and loss."""
    network = train_words(clips, config, NetworkConfig(seed=seed, steps=STEPS), recipe=Recipe.deep_motifs())
    return [network.embed(word_windows(clip, config)) for clip in clips]


def score(embedded: list[Float32Array], clips: list[LabelledClip], seed: int) -> RetrievalScores:
    """Motifs, signatures, distances, measures."""
    motifs = fit_motifs(np.concatenate(embedded), K, seed)
    made, _ = signatures([assign(words, motifs) for words in embedded], motifs.k)
    distances = emd_matrix(made, ground_distances(motifs.centroids))
    subjects = [clip.subject for clip in clips]
    labels = [clip.label for clip in clips]
    return leave_one_out(distances, labels, subjects if len(set(subjects)) > 1 else None)


def measure(clips: list[LabelledClip], config: WordConfig, embedding: Embedding) -> dict[str, float]:
    """Each measure's mean over the seeds."""
    cut = features(clips, config)
    runs = [asdict(score(embedding(cut, config, seed), clips, seed)) for seed in SEEDS]
    return {name: float(np.mean([run[name] for run in runs])) for name in runs[0] if runs[0][name] is not None}


def main() -> None:
    names = sys.argv[1:] or list(FLOORS)
    figures: dict[str, dict[str, dict[str, float]]] = {}
    for name in names:
        clips = load(name)
        print(f"{name}: {len(clips)} clips; shallow floor MAP {FLOORS[name]:.3f}")
        methods: dict[str, tuple[WordConfig, Embedding]] = {
            f"shallow {variant}": (config, shallow) for variant, config in VARIANTS.items()
        }
        methods["trained default"] = (WordConfig(), trained)
        methods["trained as published"] = (WordConfig(), trained_as_published)
        methods["trained rotations"] = (WordConfig.deep_motifs(), trained)
        figures[name] = {}
        for method, (config, embedding) in methods.items():
            found = measure(clips, config, embedding)
            figures[name][method] = found
            line = "  ".join(f"{measure} {value:.3f}" for measure, value in found.items() if measure != "queries")
            print(f"  {method:42} {line}", flush=True)
    means = {m: float(np.mean([figures[n][m]["map"] for n in names])) for m in figures[names[0]]}
    for method, value in sorted(means.items(), key=lambda item: -item[1]):
        print(f"mean MAP {value:.3f}  {method}")
    name = "-".join(["representation", *sys.argv[1:]])
    print(record(name, {"sets": figures, "mean_map": means, "floors": FLOORS}))


if __name__ == "__main__":
    main()
