"""Clips with pieces of other motions in them (section 8.4, Fig. 8) on hdm05: MAP by the share of replaced pieces.

Pieces of 10 frames at 120 Hz are replaced in canonical positions, before anything is computed; each is moved and
turned about the vertical so that its first frame stands and faces as the one that it replaces: what is singular is the
posture and how it moves, not the place. Every clip is replaced, queries and repository alike. The dictionary is trained
on the set as it was recorded, and frozen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from motionlake.arrays import Int64Array
from motionlake.motion.rotations import turn_on_ground
from motionlake.motion.skeleton import INDEX, facing
from motionlake.pesta.autoencoder import AutoencoderRecipe
from motionlake.pesta.config import AlignmentConfig
from motionlake.pesta.scan import Both

from bench.canonical_sets import LabelledClip, features
from bench.pesta.dictionaries import Unit, fitted, string
from bench.pesta.measuring import STA2, STA3, whole_scores
from bench.pesta.sets import clips_of, labels_of
from bench.pesta.whole import DTW, MAIN, SW, specs
from bench.units import Found

SET: Final = "hdm05"
PIECE: Final = 10  # frames
RATES: Final = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
ALIGNMENTS: Final[dict[str, tuple[AlignmentConfig, Both]]] = {
    "STA w = 3": (STA3, "max"),
    "STA w = 2": (STA2, "max"),
    "STA w = 4": (AlignmentConfig("sta", 4), "max"),
    "DTW": (DTW, "max"),
    "SW": (SW, "max"),
    "SW, gap as dear as a match": (AlignmentConfig("sw", gap=SW.threshold), "max"),
    "STA w = 3, one way": (STA3, "query"),
    "STA w = 2, one way": (STA2, "query"),
    "DTW, one way": (DTW, "query"),
    "SW, one way": (SW, "query"),
}


def units(seeds: Sequence[int], recipe: AutoencoderRecipe | None) -> list[Unit]:
    chosen = {name: spec for name, spec in specs(recipe).items() if name in (MAIN, "k-means of features")}
    return [Unit(name, spec.seeded(seed), seed) for name, spec in chosen.items() for seed in seeds]


def measure(unit: Unit) -> dict[str, Found]:
    """Every alignment at every rate; the seed draws pieces too."""
    made, config = fitted(SET, unit.spec), unit.spec.config
    rows: dict[str, Found] = {}
    for rate in RATES:
        clips = singular_clips(rate, unit.seed)
        features_of = features(clips, config.frames)
        strings = [string(made.encode(each), c, config.fps) for each, c in zip(features_of, clips, strict=True)]
        for name, (alignment, both) in ALIGNMENTS.items():
            found = whole_scores(strings, made.distances, labels_of(SET), alignment, both)
            rows[f"{unit.dictionary} + {name}, rate {rate:g}"] = found | {"symbols": sum(map(len, strings))}
    return rows


def singular_pieces(
    lengths: Sequence[int], labels: Sequence[str], rate: float, seed: int, piece: int = PIECE
) -> list[Int64Array]:
    """Which pieces of clips are replaced, and by what.

    A clip is cut into pieces from its first frame on (what is left over at its end stays); the given share of them,
    drawn at random, is replaced by pieces drawn at random from clips of other labels. With one seed, what a rate
    replaces a higher rate replaces alike.

    Args:
        lengths: [n] frames of each clip.
        labels: [n].
        rate: share of the pieces, from 0 to 1.
        seed: of the draw.
        piece: frames of a piece.

    Returns:
        Of each clip [r, 3]: first frame of a replaced piece, clip and first frame that it is replaced by; in order.

    Raises:
        ValueError: a rate that is no share, or a clip for which no clip of another label is long enough.
    """
    if not 0 <= rate <= 1:
        raise ValueError(f"the rate of replaced pieces is {rate}, not from 0 to 1")
    sizes, names = np.asarray(lengths), np.asarray(labels)
    found = []
    for clip, length in enumerate(lengths):
        rng = np.random.default_rng([seed, clip])
        count = length // piece
        sources = np.flatnonzero((names != names[clip]) & (sizes >= piece))
        if count and not len(sources):
            raise ValueError(f"no clip of another label than {labels[clip]!r} has {piece} frames to take a piece of")
        places = rng.permutation(count) * piece
        taken = rng.choice(sources, count) if count else np.zeros(0, dtype=np.int64)
        starts = rng.integers(0, sizes[taken] - piece + 1) if count else taken
        rows = np.column_stack([places, taken, starts])[: round(rate * count)]
        found.append(rows[np.argsort(rows[:, 0])].astype(np.int64))
    return found


def singular_clips(rate: float, seed: int) -> list[LabelledClip]:
    """The set with pieces replaced."""
    clips = clips_of(SET)
    pieces = singular_pieces([len(clip.positions) for clip in clips], labels_of(SET), rate, seed)
    found = []
    for clip, rows in zip(clips, pieces, strict=True):
        positions, rotations = clip.positions.copy(), clip.rotations.copy()
        for at, source, start in rows.tolist():
            other = clips[source]
            own, taken = slice(at, at + PIECE), slice(start, start + PIECE)
            positions[own] = placed(other.positions[taken], clip.positions[at])
            rotations[own] = other.rotations[taken]
        found.append(replace(clip, positions=positions, rotations=rotations))
    return found


def placed(piece: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """A piece [n, 21, 3] whose first frame has its hips above those of a `frame` [21, 3] and faces as it does."""
    turn = float(facing(frame[None])[0] - facing(piece[:1])[0])
    hips = piece[0, INDEX["hips"]]
    x, z = turn_on_ground(piece[..., 0] - hips[0], piece[..., 2] - hips[2], turn)
    at = frame[INDEX["hips"]]
    return np.stack([x + at[0], piece[..., 1], z + at[2]], axis=-1)


def fall(rows: dict[str, Found]) -> dict[str, dict[str, list[float]]]:
    """{method: {map: by rate, kept: MAP as a share of that at rate 0}}, for curves."""
    found: dict[str, dict[str, list[float]]] = {}
    for name, row in rows.items():
        method, _, rate = name.rpartition(", rate ")
        curve = found.setdefault(method, {"rate": [], "map": [], "kept": []})
        curve["rate"].append(float(rate))
        curve["map"].append(row["mean"]["map"])
        curve["kept"].append(row["mean"]["map"] / curve["map"][0])
    return found


def verdict(curves: dict[str, dict[str, list[float]]], dictionary: str = MAIN) -> str:
    """Which alignment keeps most of its MAP, at each rate above 0."""
    own = {name: curve for name, curve in curves.items() if name.startswith(f"{dictionary} + ")}
    rates = next(iter(own.values()))["rate"]
    lines = []
    for i, rate in list(enumerate(rates))[1:]:
        order = sorted(own, key=lambda name: -own[name]["kept"][i])
        shown = ", ".join(f"{name.partition(' + ')[2]} {own[name]['kept'][i]:.3f}" for name in order[:4])
        lines.append(f"  rate {rate:g} keeps most of its MAP: {shown}")
    return "\n".join(lines)
