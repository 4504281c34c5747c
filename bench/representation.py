"""Ablations of motion words: `python -m bench.representation [--processes N] [--seeds N] [--rows ROW,...] [SET ...]`.

Every row goes through the same pipeline: words, their groups (K motifs), tf-idf signatures, exact Earth Mover's
Distance, leave one out over whole clips (MAP and NN). Rows differ in one thing each (Deep Motifs, section 5.1):

- what words are compared by: raw numbers, DTW, principal components ("shallow"), learned embeddings
- the network and its recipe; rotations against positions; length of words, K, smoothing, the linear embedding
- words as they are, as moves (over what they are in the word), and both side by side

The first group has 3 seeds of training and k-means on all sets; all else seed 0 without utd_mhad, whose 861 clips cost
more than the rest together. "conv" is trained for 150 steps; the paper's network is measured by `bench.word_network`.
Networks are trained on the clips that they are measured on, without labels, but for the pretrained one.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from motionlake.arrays import Float32Array, Float64Array
from motionlake.deep_motifs.config import NetworkConfig
from motionlake.deep_motifs.emd import emd_matrix, ground_distances
from motionlake.deep_motifs.motifs import Motifs, assign, fit_motifs
from motionlake.deep_motifs.signatures import signatures
from motionlake.deep_motifs.words.dtw import word_distances
from motionlake.deep_motifs.words.linear import LinearConfig
from motionlake.deep_motifs.words.network import moves as word_moves
from motionlake.evaluation.ranking import RetrievalScores, leave_one_out
from motionlake.motion.features import WordConfig, word_windows
from numpy.typing import NDArray
from sklearn.decomposition import PCA
from threadpoolctl import threadpool_limits

from bench.canonical_sets import SETS, LabelledClip, features, load
from bench.record import hash_files, record, recordings
from bench.units import Found, in_processes, unit_options

K: Final = 100
COMPONENTS: Final = 48
SEEDS: Final = (0, 1, 2)
CONV_STEPS: Final = 150
ALL: Final = tuple(SETS)
SMALL: Final = ("hdm05", "salsa", "bandai1")
Embedding = Callable[[list[Float32Array], WordConfig, int], list[Float32Array]]


@dataclass(frozen=True)
class Grouped:
    """Words in groups: the group of each word of each clip, and the ground distances [K, K] of the groups."""

    clips: list[NDArray[np.int32]]
    ground: Float64Array


Grouping = Callable[[list[Float32Array], WordConfig, int, int], Grouped]


@dataclass(frozen=True)
class Row:
    """One way to make signatures, and where it is measured.

    Attributes:
        group: of rows that are compared with one another.
        grouping: puts words [T, D] of each clip in k groups: (clips, words, k, seed).
    """

    group: str
    grouping: Grouping
    words: WordConfig = field(default_factory=WordConfig)
    k: int = K
    seeds: tuple[int, ...] = (0,)
    sets: tuple[str, ...] = SMALL


def shallow(clips: list[Float32Array], config: WordConfig, seed: int) -> list[Float32Array]:
    """The first principal components of flattened words."""
    flat = raw(clips, config, seed)
    with threadpool_limits(limits=1):
        reduced = PCA(COMPONENTS, svd_solver="covariance_eigh").fit_transform(np.concatenate(flat))
    return _split(reduced.astype(np.float32), flat)


def raw(clips: list[Float32Array], config: WordConfig, seed: int) -> list[Float32Array]:
    """Words as they are, flattened."""
    return [np.ascontiguousarray(w.reshape(len(w), -1)) for w in (word_windows(clip, config) for clip in clips)]


def moves(clips: list[Float32Array], config: WordConfig, seed: int, *, beside: bool = False) -> list[Float32Array]:
    """Principal components of the moves of words; `beside` the words as they are, with as much variance."""
    words = [word_windows(clip, config).copy() for clip in clips]
    stacked = np.concatenate([word_moves(torch.from_numpy(w), config.posture).flatten(1).numpy() for w in words])
    if beside:
        plain = np.concatenate(raw(clips, config, seed))
        stacked = np.hstack([part / np.sqrt(part.var(axis=0).sum()) for part in (plain, stacked)])
    with threadpool_limits(limits=1):
        reduced = PCA(COMPONENTS, svd_solver="covariance_eigh").fit_transform(stacked)
    return _split(reduced.astype(np.float32), words)


def learned(
    clips: list[Float32Array],
    config: WordConfig,
    seed: int,
    *,
    architecture: str = "moves",
    steps: int = 0,
    linear: LinearConfig | None = None,
) -> list[Float32Array]:
    """A network trained on the clips themselves, without labels."""
    from motionlake.deep_motifs.words.training import Recipe, train_words

    recipe = Recipe()
    network = train_words(
        clips,
        config,
        NetworkConfig(architecture, weights="own", seed=seed, steps=steps),
        recipe=replace(recipe, linear=linear or recipe.linear),
        device="cpu",
    )
    return [network.embed(word_windows(clip, config)) for clip in clips]


def by_l2(embedding: Embedding) -> Grouping:
    """K-means in the space of an embedding; ground distances are L2."""

    def grouping(clips: list[Float32Array], config: WordConfig, k: int, seed: int) -> Grouped:
        embedded = embedding(clips, config, seed)
        motifs = fit_motifs(np.concatenate(embedded), k, seed)
        return Grouped([assign(words, motifs) for words in embedded], ground_distances(motifs.centroids))

    return grouping


def by_dtw(clips: list[Float32Array], config: WordConfig, k: int, seed: int) -> Grouped:
    """Medoids in the place of centroids, word DTW in the place of L2.

    Distances are square roots of `word_distances`. They are no metric: `emd_matrix` leaves shared mass where it is,
    which then only comes near to the cheapest transport.
    """
    words = [word_windows(clip, config).copy() for clip in clips]
    stacked = np.concatenate(words)
    medoids = medoids_of(stacked, k, seed)
    groups = np.argmin(word_distances(stacked, medoids), axis=1).astype(np.int32)
    ground = np.sqrt(word_distances(medoids, medoids).astype(np.float64))
    ground = (ground + ground.T) / 2
    np.fill_diagonal(ground, 0.0)
    return Grouped(_split(groups, words), ground)


def medoids_of(words: Float32Array, k: int, seed: int) -> Float32Array:
    """[K, length, D] at most `k` of `words` [n, length, D]: those nearest to the k-means centroids of raw words."""
    flat = words.reshape(len(words), -1)
    centroids = fit_motifs(flat, k, seed).centroids
    nearest = assign(centroids, Motifs(flat, np.ones(len(flat))))
    return np.ascontiguousarray(words[np.unique(nearest)])


def pretrained(name: str) -> Grouping:
    """The network that comes with the package; for a set of CMU the same training without it."""
    from motionlake.deep_motifs.config import PRETRAINED_WORDS
    from motionlake.deep_motifs.words.network import load_network

    from bench.pretrained_words import SETS as CMU
    from bench.pretrained_words import train

    folder = SETS[name].folder
    network = (
        train(tuple(each for each in CMU if each != folder)) if folder in CMU else load_network(PRETRAINED_WORDS.file)
    )
    return by_l2(lambda clips, config, seed: [network.embed(word_windows(clip, config)) for clip in clips])


def _split(stacked: NDArray[Any], clips: list[Float32Array]) -> list[NDArray[Any]]:
    return np.split(stacked, np.cumsum([len(words) for words in clips])[:-1])


def rows() -> dict[str, Row]:
    """Every row by name, in the order of the table; "pretrained" has its grouping made for each set."""
    default, rotations = WordConfig(), WordConfig.deep_motifs()
    positions = replace(default, length=rotations.length, stride=rotations.stride, smoothing=0.0)
    own, principal = by_l2(learned), by_l2(shallow)
    main, network, kind = "words", "network, seed 0", "rotations and positions, seed 0"
    conv = partial(learned, architecture="conv", steps=CONV_STEPS)
    made = {
        "raw": Row(main, by_l2(raw), seeds=SEEDS, sets=ALL),
        "DTW": Row(main, by_dtw, seeds=SEEDS, sets=ALL),
        "shallow": Row(main, principal, seeds=SEEDS, sets=ALL),
        "learned (default)": Row(main, own, seeds=SEEDS, sets=ALL),
        "learned, without moves": Row(main, by_l2(partial(learned, architecture="linear")), seeds=SEEDS, sets=ALL),
        "pretrained": Row(main, own, seeds=SEEDS, sets=ALL),
        "conv": Row(network, by_l2(conv)),
        "rotations, 16 every 4, shallow": Row(kind, principal, rotations),
        "rotations, 16 every 4, learned": Row(kind, own, rotations),
        "positions, 16 every 4, shallow": Row(kind, principal, positions),
        "positions, 16 every 4, learned": Row(kind, own, positions),
    }
    for length, stride in ((8, 2), (16, 2), (16, 4), (24, 2), (48, 2)):
        name = f"length {length} every {stride}"
        made[name] = Row("length of words, seed 0", own, replace(default, length=length, stride=stride))
    for k in (50, 150, 200, 400):
        made[f"K {k}"] = Row("motifs, seed 0", own, k=k)
    for length, stride in ((12, 2), (24, 2), (48, 2)):
        longer = replace(default, length=length, stride=stride)
        for said, embedding in (("shallow", shallow), ("moves", moves), ("both", partial(moves, beside=True))):
            made[f"{said} {length}"] = Row("moves in words, seed 0", by_l2(embedding), longer, sets=ALL)
    made["smoothing 0"] = Row("smoothing, seed 0", own, replace(default, smoothing=0.0))
    for whitening in (0.0, 0.5):
        embedding = partial(learned, linear=LinearConfig(whitening=whitening))
        made[f"whitening {whitening:g}"] = Row("linear embedding, seed 0", by_l2(embedding))
    embedding = partial(learned, linear=LinearConfig(neighbours=0))
    made["neighbours 0"] = Row("linear embedding, seed 0", by_l2(embedding))
    return made


# Set, row and seed.
Unit = tuple[str, str, int]
BASE: Final = "learned (default)"


def retrieve(grouped: Grouped, clips: list[LabelledClip]) -> RetrievalScores:
    """Signatures, distances, measures."""
    made, _ = signatures(grouped.clips, len(grouped.ground))
    subjects = [clip.subject for clip in clips]
    distances = emd_matrix(made, grouped.ground)
    return leave_one_out(distances, [clip.label for clip in clips], subjects if len(set(subjects)) > 1 else None)


def score(embedded: list[Float32Array], clips: list[LabelledClip], seed: int) -> RetrievalScores:
    """Measures of embedded words [n, d] of each clip, grouped by k-means."""
    return retrieve(by_l2(lambda clips, config, seed: embedded)([], WordConfig(), K, seed), clips)


@cache
def _clips(name: str) -> list[LabelledClip]:
    return load(name)


@cache
def _pretrained(name: str) -> Grouping:
    return pretrained(name)


def measure(set_name: str, row_name: str, seed: int) -> dict[str, float]:
    """MAP and NN of one row on one set, on one thread."""
    row = rows()[row_name]
    with threadpool_limits(limits=1):
        clips = _clips(set_name)
        grouping = _pretrained(set_name) if row_name == "pretrained" else row.grouping
        scores = retrieve(grouping(features(clips, row.words), row.words, row.k, seed), clips)
    return {"map": scores.map, "nn": scores.nn}


def _measured(unit: Unit) -> dict[str, Found]:
    return {"scores": measure(*unit)}


def _said(unit: Unit) -> str:
    return "{}, {}, seed {}".format(*unit)


Runs = dict[str, dict[str, dict[int, dict[str, float]]]]


def measure_all(names: list[str], processes: int, seeds: int, chosen: list[str], keep: Path | None = None) -> Runs:
    """{row: {set: {seed: measures}}} of each row of `chosen` on those of `names` that it is measured on."""
    made = {name: row for name, row in rows().items() if name in chosen}
    units = [(s, r, seed) for r, row in made.items() for s in names if s in row.sets for seed in row.seeds[:seeds]]
    units.sort(key=lambda unit: -ALL.index(unit[0]))  # the largest set first: no long one is left for the end
    runs: Runs = {name: {s: {} for s in names if s in row.sets} for name, row in made.items()}
    runs = {name: found for name, found in runs.items() if found}
    for (set_name, row_name, seed), found in in_processes(_measured, units, processes, _said, keep):
        runs[row_name][set_name][seed] = found["scores"]
    return runs


def means(runs: Mapping[str, Mapping[int, Mapping[str, float]]]) -> dict[str, dict[str, float]]:
    """{set: measures}, means over the seeds."""
    return {
        name: {key: float(np.mean([run[key] for run in seeds.values()])) for key in ("map", "nn")}
        for name, seeds in runs.items()
    }


def table(runs: Runs, names: list[str]) -> str:
    """MAP and NN, rows by group; groups of seed 0 begin with the default at seed 0."""
    width = max(len(name) for name in runs) + 2
    lines = ["MAP / NN".ljust(width) + "".join(name.rjust(15) for name in names)]
    group = ""
    for name, row in rows().items():
        if name not in runs:
            continue
        if row.group != group:
            group = row.group
            lines.append(f"[{group}]")
            if row.seeds == (0,) and BASE in runs:
                base = {s: {0: seeds[0]} for s, seeds in runs[BASE].items()}
                lines.append(_line("default", means(base), names, width))
        lines.append(_line(name, means(runs[name]), names, width))
    return "\n".join(lines)


def _line(name: str, found: Mapping[str, Mapping[str, float]], names: list[str], width: int) -> str:
    cells = [f"{found[s]['map']:.3f} / {found[s]['nn']:.3f}" if s in found else "" for s in names]
    return name.ljust(width) + "".join(cell.rjust(15) for cell in cells)


def main() -> None:
    parser = argparse.ArgumentParser(description="Ablations of motion words.")
    parser.add_argument("sets", nargs="*", default=list(ALL), metavar="SET", help=f"of {', '.join(ALL)}")
    unit_options(parser, processes=2)
    parser.add_argument("--rows", type=lambda text: text.split(","), help=f"these alone, of: {'; '.join(rows())}")
    given = parser.parse_args()
    chosen = given.rows or list(rows())
    runs = measure_all(given.sets, given.processes, given.seeds, chosen, given.keep)
    print(table(runs, given.sets))
    paths = [p for name in given.sets for p in (recordings() / SETS[name].folder).rglob("*") if p.is_file()]
    result = {
        "rows": {name: {"means": means(found), "seeds": found} for name, found in runs.items()},
        "conv_steps": CONV_STEPS,
        "k": K,
    }
    name = "-".join(["representation", *given.sets[: len(ALL) - 1]])
    print(record(name, result, hash_files(paths, recordings()), kept=given.keep))


if __name__ == "__main__":
    main()
