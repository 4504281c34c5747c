"""A class made from every clip left out beside its recordings: travel, energy, feet, likeness, copies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.evaluation.synthesis.motions import Stretch, described
from motionlake.matching.course import GIVEN
from motionlake.motion.features import body_length
from motionlake.motion.generation import FPS, GeneratedMotion, MotionGenerator
from motionlake.motion.skeleton import body_poses

from bench.canonical_sets import LabelledClip
from bench.classes import GOING
from bench.made.generators import generator, go_on
from bench.made.splits import FOLDS, SPLITS, folds, made_from, real, rigid
from bench.made.windows import SHARES, SPACES, copies, intervals, likeness
from bench.units import Found

SEEDS: Final = (0, 1, 2)
POSES: Final = 400  # of all motions, for diversity
MEANS: Final = ("travel_speed", "energy", "jerk", "jerk_peak", "skate_ratio", "slide_speed", "sunk")
WORST: Final = ("penetration", "airborne", "height", "bone_length_drift")
RATIOS: Final = ("travel_speed", "energy", "diversity", "skate_ratio", "jerk", "jerk_peak")
STARTS: Final = ("from_unseen", "from_known")  # clips that motions go on from


@dataclass(frozen=True)
class Unit:
    """One recipe on one split."""

    split: str
    recipe: str
    seeds: tuple[int, ...] = SEEDS
    folds: tuple[int, ...] = tuple(range(FOLDS))
    epochs: int = 0
    generators: Path | None = field(default=None, repr=False)

    def __str__(self) -> str:
        return f"{self.split}, {self.recipe}"


@dataclass
class Motions:
    """Of a class and a seed: what was made of all folds, and what it stands beside."""

    made: dict[int, list[Stretch]] = field(default_factory=dict)  # by fold
    real: list[Stretch] = field(default_factory=list)
    raw: list[GeneratedMotion] = field(default_factory=list)

    @property
    def all_made(self) -> list[Stretch]:
        return [motion for fold in self.made.values() for motion in fold]


def measure(unit: Unit) -> dict[str, Found]:
    """{class: numbers of the split}."""
    seeds = [_of_seed(unit, seed) for seed in unit.seeds]
    return {label: _figures(unit, label, [each[label] for each in seeds]) for label in SPLITS[unit.split].classes}


def _of_seed(unit: Unit, seed: int) -> dict[str, Motions]:
    found = {label: Motions() for label in SPLITS[unit.split].classes}
    for fold, _, test in folds(unit.split, unit.folds):
        maker = generator(unit.recipe, unit.split, fold, unit.epochs, unit.generators)
        for label, own in found.items():
            clips, raw = go_on(maker, [clip for clip in test if clip.label == label], 1000 * seed)
            own.raw += raw
            own.made[fold] = [made_from(one, clip) for one, clip in zip(raw, clips, strict=True)]
            own.real += beside(clips, raw)
    return found


def beside(clips: Sequence[LabelledClip], raw: Sequence[GeneratedMotion]) -> list[Stretch]:
    """Of a class that goes on whole clips, of an action what really follows the given frames."""
    return [real(c, 0 if c.label in GOING else m.seed_stop) for c, m in zip(clips, raw, strict=True)]


def since(clip: LabelledClip) -> int:
    """The frame of a clip after those that are given; 0 where it goes on and on, so that no window is like another."""
    return 0 if clip.label in GOING else min(round(GIVEN / FPS * clip.fps), len(clip.positions) - 2)


def from_known(maker: MotionGenerator, known: Sequence[LabelledClip], label: str) -> list[Stretch]:
    """What goes on from the known clips: nothing of unseen ones is in it, not even the given frames."""
    starts, raw = go_on(maker, [clip for clip in known if clip.label == label][:: 1 if label in GOING else 2], 500)
    return [made_from(one, clip) for one, clip in zip(raw, starts, strict=True)]


def alike(unseen: list[Stretch], learned: list[Stretch], made: list[Stretch], again: list[Stretch]) -> dict[str, Any]:
    """Likeness of what goes on from unseen clips and of what goes on from known ones, and copies."""
    starts = {"from_unseen": made, "from_known": again}
    return {
        **{start: spaces(unseen, learned, some) for start, some in starts.items()},
        "copies": copies(unseen, learned, made),
    }


def spaces(unseen: list[Stretch], learned: list[Stretch], made: list[Stretch]) -> dict[str, Any]:
    """Likeness by space."""
    return {name: likeness(unseen, learned, made, space) for name, space in SPACES.items()}


def measures(motions: Sequence[Stretch]) -> dict[str, float]:
    """Means and, of `WORST`, the greatest, of motions."""
    each = [described(motion) for motion in motions]

    def values(name: str) -> list[float]:
        return [value for one in each if (value := one[name]) is not None]

    return {
        "motions": float(len(motions)),
        **{name: float(np.mean(values(name))) for name in MEANS},
        **{name: float(max(values(name))) for name in WORST},
        "diversity": diversity(motions),
    }


def diversity(motions: Sequence[Stretch]) -> float:
    """Mean distance of joints, body lengths, between poses of different motions, seen from the body."""
    rng, found, of = np.random.default_rng(0), [], []
    for i, motion in enumerate(motions):
        at = rng.integers(len(motion.positions), size=max(1, POSES // len(motions)))
        found.append(body_poses(motion.positions[at]) / body_length(motion.positions))
        of += [i] * len(at)
    joints, owner = np.concatenate(found), np.array(of)
    apart = np.linalg.norm(joints[:, None] - joints[None], axis=-1).mean(axis=-1)
    return float(apart[owner[:, None] != owner[None]].mean())


def _figures(unit: Unit, label: str, seeds: Sequence[Motions]) -> Found:
    rows = [measures(each.all_made) for each in seeds]
    made, other = mean(rows), mean([measures(each.real) for each in seeds])
    kept = mean([measures([rigid(motion) for motion in each.real]) for each in seeds])
    likenesses, beside_rigid, reached, known_rows = [], [], [], []
    for fold, known, test in folds(unit.split, unit.folds):
        maker = generator(unit.recipe, unit.split, fold, unit.epochs, unit.generators)
        learned, unseen = ([real(c, since(c)) for c in some if c.label == label] for some in (known, test))
        known_rows.append(measures(learned))
        of_all_seeds = [motion for each in seeds for motion in each.made[fold]]
        again = from_known(maker, known, label)
        likenesses.append(alike(unseen, learned, of_all_seeds, again))
        unseen_rigid, known_rigid = ([rigid(motion) for motion in some] for some in (unseen, learned))
        sides = zip(STARTS, (of_all_seeds, again), strict=True)
        beside_rigid.append({start: spaces(unseen_rigid, known_rigid, some) for start, some in sides})
        reached.append(spaces(unseen, learned, known_rigid))
    known_mean = mean(known_rows)
    return {
        "made": made, "real": other, "known": known_mean, "by_seed": rows,
        "ratio": {name: made[name] / other[name] for name in RATIOS if other[name]},
        "known_ratio": {name: known_mean[name] / other[name] for name in RATIOS if other[name]},
        "likeness": {start: shares([one[start] for one in likenesses]) for start in STARTS},
        "rigid": {
            "real": kept, "ratio": {name: made[name] / kept[name] for name in RATIOS if kept[name]},
            "likeness": {start: shares([one[start] for one in beside_rigid]) for start in STARTS},
            "reached": shares(reached),
        },
        "copies": mean([one["copies"] for one in likenesses if one["copies"]]),
        "runs": runs([one for each in seeds for one in each.raw]),
    }  # fmt: skip


def mean(rows: Sequence[dict[str, float]]) -> dict[str, float]:
    return {name: float(np.mean([row[name] for row in rows])) for name in rows[0]} if rows else {}


def shares(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """By space coverage and density of what was made and of known motions, the one over the other, how sure that is."""
    found = {}
    for space in rows[0]:
        whole = [row[space] for row in rows if row[space]]
        if not whole:
            continue
        sides = {side: mean([row[side] for row in whole]) for side in ("made", "known")}
        found[space] = {
            **sides,
            "share": {name: sides["made"][name] / max(sides["known"][name], 1e-9) for name in SHARES},
            "interval": intervals([row["balls"] for row in whole]),
            "n": mean([row["n"] for row in whole]),
        }
    return found


def runs(motions: Sequence[GeneratedMotion]) -> dict[str, float]:
    """How long the runs of recorded frames are that motions were made of, seconds; none where a network made them."""
    long = [(source.stop - source.start) / one.fps for one in motions for source in one.sources]
    if not long:
        return {}
    return {
        "median": float(np.median(long)), "q95": float(np.quantile(long, 0.95)), "most": float(max(long)),
        "joins_a_second": (len(long) - len(motions)) / sum(len(m.positions) / m.fps for m in motions),
    }  # fmt: skip
