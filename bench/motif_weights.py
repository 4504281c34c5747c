"""What a motif counts in a signature: `python -m bench.motif_weights [--seeds N] [--keep FOLDER] [SET ...]`.

Default words, network and motifs; rows differ in the mass at a motif alone (Deep Motifs, sections 4.2 and 4.3):

- quantity: the share of a clip's words, with idf (the default) and without
- density: that of the motif wherever the clip holds it, the paper's dense weight taken by the letter
- quantity times density, with idf and without: `emd_deep_motifs`

Signatures of quantity have mass 1 and all of it is moved; the others are not scaled, and the smaller sum is moved
(equation 6). Leave one out over whole clips, MAP and NN; the seeds are those of k-means.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping

import numpy as np
from motionlake.arrays import Float64Array, Int64Array
from motionlake.deep_motifs.emd import emd_matrix, ground_distances, transport
from motionlake.deep_motifs.motifs import assign, fit_motifs
from motionlake.deep_motifs.signatures import inverse_document_frequency, motif_counts, tf_idf
from motionlake.evaluation.ranking import leave_one_out
from motionlake.motion.features import WordConfig
from threadpoolctl import threadpool_limits

from bench.canonical_sets import SETS, features, load
from bench.record import hash_files, record, recordings
from bench.representation import SEEDS, K, learned
from bench.units import Found, in_processes, table, unit_options, with_seeds

# Set and seed.
Unit = tuple[str, int]


def partial_matrix(masses: Float64Array, ground: Float64Array) -> Float64Array:
    """[n, n] `emd_partial` of masses [n, K] that are not scaled."""
    sums = masses.sum(axis=1)
    matrix = np.zeros((len(masses), len(masses)))
    for i, p in enumerate(masses):
        for j in range(i):
            flow = min(sums[i], sums[j])
            matrix[i, j] = matrix[j, i] = transport(p / flow, masses[j] / flow, ground, partial=True)
    return matrix


def distances(counts: Int64Array, density: Float64Array, ground: Float64Array) -> dict[str, Float64Array]:
    """[n, n] of each row, from motif counts [n, K], densities [K] and ground distances [K, K]."""
    idf = inverse_document_frequency(counts)
    quantity, weighed = (tf_idf(counts, each).astype(np.float64) for each in (np.ones(len(idf)), idf))
    return {
        "quantity with idf (default)": emd_matrix(weighed, ground),
        "quantity": emd_matrix(quantity, ground),
        "density": partial_matrix((counts > 0) * density, ground),
        "quantity times density": partial_matrix(quantity * density, ground),
        "quantity with idf times density (the paper's)": partial_matrix(weighed * density, ground),
    }


def measure(unit: Unit) -> dict[str, Found]:
    """MAP and NN of every row on one set, on one thread."""
    name, seed = unit
    with threadpool_limits(limits=1):
        clips = load(name)
        embedded = learned(features(clips, WordConfig()), WordConfig(), seed)
        motifs = fit_motifs(np.concatenate(embedded), K, seed)
        counts = np.stack([motif_counts(assign(words, motifs), motifs.k) for words in embedded])
        labels = [clip.label for clip in clips]
        found = {}
        for row, apart in distances(counts, motifs.strength, ground_distances(motifs.centroids)).items():
            scores = leave_one_out(apart, labels, None)
            found[row] = {"map": scores.map, "nn": scores.nn}
    return found


def _said(unit: Unit) -> str:
    return "{}, seed {}".format(*unit)


def main() -> None:
    parser = argparse.ArgumentParser(description="What a motif counts in a signature.")
    parser.add_argument("sets", nargs="*", default=list(SETS), metavar="SET", help=f"of {', '.join(SETS)}")
    unit_options(parser)
    given = parser.parse_args()
    units = [(name, seed) for name in given.sets for seed in SEEDS[: given.seeds]]
    runs: dict[str, dict[str, dict[int, Found]]] = {name: {} for name in given.sets}
    for (name, seed), found in in_processes(measure, units, given.processes, _said, given.keep):
        for row, scores in found.items():
            runs[name].setdefault(row, {})[seed] = scores
    kept: Mapping[str, dict[str, Found]] = {name: with_seeds(rows, lambda row: False) for name, rows in runs.items()}
    for name, rows in kept.items():
        print(table(name, rows, ("map", "nn")))
    paths = [p for name in given.sets for p in (recordings() / SETS[name].folder).rglob("*") if p.is_file()]
    print(record("motif-weights", {"sets": kept, "k": K}, hash_files(paths, recordings()), kept=given.keep))


if __name__ == "__main__":
    main()
