"""A page of pairs, one motion recorded and one made, in an order drawn by a seed; the key is in a file of its own.

Both motions of a pair are of one class, as long as one another, and go on from the same given frames of a clip that was
left out; the made one by motion matching.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.generation import FPS, MotionRequest
from motionlake.pictures.clip_images import film_strip, motion_gif
from motionlake.pictures.html import document
from motionlake.pictures.player_material import PlayerClip

from bench.canonical_sets import LabelledClip
from bench.classes import CLASSES, GOING
from bench.made.generators import matching
from bench.made.splits import folds, made_from, real
from bench.matching_clips import seed_of

LONGEST: Final = 4.0  # seconds of a pair
SHORTEST: Final = 0.6
STYLE: Final = "body{font:14px sans-serif;margin:2em}section{margin:2em 0}img{max-width:100%}"


@dataclass(frozen=True)
class Pair:
    """Motions A and B, and which of them is made.

    Attributes:
        label: class of both.
        clip: that both go on from.
        motions: [F, 21, 3] of either.
        made: "A" or "B".
    """

    label: str
    clip: str
    motions: tuple[Float64Array, Float64Array]
    made: str


def pairs(count: int, seed: int) -> list[Pair]:
    """Pairs of classes in turn, of clips drawn by a seed, each clip once where there are so many."""
    rng, found = np.random.default_rng(seed), []
    labels = list(CLASSES)
    clips = {label: _left_out(label, rng) for label in labels}
    for i in range(count):
        left = clips[labels[i % len(labels)]]
        for k, drawn in enumerate(left):
            pair = _pair(*drawn, 1000 * seed + i, bool(rng.integers(2)))
            if pair is not None:
                found.append(pair)
                left.append(left.pop(k))
                break
    order = rng.permutation(len(found))
    return [found[k] for k in order]


def _left_out(label: str, rng: np.random.Generator) -> list[tuple[LabelledClip, str, int]]:
    split = label if label in GOING else "actions, other subjects"
    own = [(clip, split, fold) for fold, _, test in folds(split) for clip in test if clip.label == label]
    return [own[k] for k in rng.permutation(len(own))]


def _pair(clip: LabelledClip, split: str, fold: int, seed: int, swapped: bool) -> Pair | None:
    maker = matching(split, fold)
    try:
        (made,) = maker.generate([MotionRequest((clip.label,), LONGEST, seed, seed_of(clip))])
    except ValueError:  # too short a clip
        return None
    own = real(clip, made.seed_stop).positions[: round(LONGEST * FPS)]
    if len(own) < SHORTEST * FPS:
        return None
    (made,) = maker.generate([MotionRequest((clip.label,), len(own) / FPS, seed, seed_of(clip))])
    other = made_from(made, clip).positions[: len(own)]
    both = (other, own) if swapped else (own, other)
    return Pair(clip.label, clip.name, both, "A" if swapped else "B")


def write(found: Sequence[Pair], folder: Path, clips: bool = True) -> tuple[Path, Path]:
    """A strip of every pair (`pair-01.png`), moving pictures where `clips`, the page and, beside it, the key."""
    import matplotlib.pyplot as plt

    folder.mkdir(parents=True, exist_ok=True)
    sections = []
    for number, pair in enumerate(found, 1):
        name = f"pair-{number:02d}"
        shown = [
            PlayerClip(f"{name} {side}, {pair.label}", motion, FPS, len(motion))
            for side, motion in zip("AB", pair.motions, strict=True)
        ]
        figure = film_strip(shown)
        figure.savefig(folder / f"{name}.png", dpi=100)
        plt.close(figure)
        moving = ""
        if clips:
            (folder / f"{name}.gif").write_bytes(motion_gif(shown))
            moving = f'<img src="{name}.gif">'
        sections.append(f'<section id="{name}"><h2>{name}</h2><img src="{name}.png">{moving}</section>')
    page, key = folder / "pairs.html", folder / "key.json"
    page.write_text(document("Which is made?", STYLE, sections), encoding="utf-8")
    told = [{"pair": i, "class": p.label, "clip": p.clip, "made": p.made} for i, p in enumerate(found, 1)]
    key.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    return page, key


def judged(key: Path, guesses: Path) -> dict[str, float]:
    """How often guesses (a CSV with the columns pair and made, which is A or B) are right.

    Returns:
        `right` of `pairs`; `share`; `chance`: how likely so many or more are where nothing can be told (binomial).
    """
    import csv

    from scipy.stats import binom

    truth = {row["pair"]: row["made"] for row in json.loads(key.read_text(encoding="utf-8"))}
    with guesses.open(newline="", encoding="utf-8") as handle:
        said = {int(row["pair"]): row["made"].strip().upper() for row in csv.DictReader(handle)}
    if set(said) != set(truth):
        raise ValueError(f"{guesses} has guesses for {len(said)} pairs, the key has {len(truth)}")
    right = sum(said[pair] == made for pair, made in truth.items())
    chance = float(binom.sf(right - 1, len(truth), 0.5))
    return {"right": right, "pairs": len(truth), "share": right / len(truth), "chance": chance}
