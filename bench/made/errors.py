"""What follows the given poses, in real time, by every method: 80 to 640 ms after the last of them.

All are asked at the same moments of the same clips (`bench.glogen.dense`), and learn from the clips of the other folds.
"seq2seq, all channels" reads what motion matching and the networks read: joints, height, velocity and turning of the
hips, each clip mirrored too, and has as many steps as the networks (a thousand). "seq2seq, as the onset" is trained as
the network of the onset is: clips at its paces, mirrored but where a class is done with one side, as many steps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.glogen.config import SEEDS as GIVEN
from motionlake.glogen.config import onset_recipe
from motionlake.glogen.onset_examples import one_sided, played_at
from motionlake.glogen.onset_network import PACES
from motionlake.glogen.sparse import HEIGHT as JOINTS
from motionlake.glogen.sparse import TrainingPiece, even_motion, ranges
from motionlake.glogen.trajectories import FPS, BodyMotion, body_motion, mirrored
from motionlake.motion.generation import SHORTEST, Control, MotionRequest, SeedClip
from motionlake.motion.resampling import resample

from bench.canonical_sets import LabelledClip
from bench.classes import GOING
from bench.glogen.baseline import Settings
from bench.glogen.dense import HORIZON, Asked, ahead, apart, continued
from bench.glogen.material import BONES, Material, frames_of
from bench.glogen.methods import CHOSEN, DEFAULTS, DENSE, fitted
from bench.glogen.motions import Motions
from bench.glogen.sparse import settings_of
from bench.made.generators import matching, networks
from bench.made.splits import SPLITS, parted
from bench.matching_clips import offsets_of

LONG: Final = replace(DEFAULTS.budget, steps=1000)
ALL_CHANNELS, ALIKE = "seq2seq, all channels", "seq2seq, as the onset"
LED: Final = "networks, led in"
ONSET: Final = ("onset", "onset, kernels alone", "onset, network alone")
BY_NETWORKS: Final = ("networks", LED, *ONSET)
METHODS: Final = ("zero_velocity", "nearest_real", "seq2seq", ALL_CHANNELS, ALIKE, *BY_NETWORKS, "matching")
Errors = dict[str, Any]


@dataclass(frozen=True)
class Unit:
    """One method on one fold of a split; the fold is the seed of what is trained."""

    split: str
    method: str
    fold: int
    epochs: int = 0
    generators: Path | None = field(default=None, repr=False)

    def __str__(self) -> str:
        return f"{self.split}, {self.method}, fold {self.fold}"


@dataclass(frozen=True)
class Moment:
    """Where a clip is asked to be gone on from: a piece of it, and the frame of the clip at 30 a second."""

    clip: LabelledClip
    asked: Asked
    frame: int


def measure(unit: Unit) -> dict[str, Errors]:
    """{method: errors of every moment of the clips left out}."""
    moments = moments_of(unit.split, unit.fold)
    off = _methods(unit)(unit, moments)
    joints = np.linalg.norm(off, axis=3).mean(axis=2)
    poses = np.linalg.norm(off.reshape(*off.shape[:2], -1), axis=2)
    clips = len(parted(unit.split, unit.fold)[1])
    return {unit.method: {"joint": joints.tolist(), "pose": poses.tolist(), "clips": clips}}


def _methods(unit: Unit) -> Callable[[Unit, Sequence[Moment]], Float64Array]:
    if unit.method in BY_NETWORKS:
        return _by_networks
    return _by_matching if unit.method == "matching" else _by_baseline


@cache
def moments_of(split: str, fold: int) -> list[Moment]:
    found = []
    for clip in parted(split, fold)[1]:
        motion = _read(clip)
        for start, stop in ranges(len(motion)):
            part = motion.cut(start, stop)
            asked = Asked.of(TrainingPiece(part, even_motion(part), SPLITS[split].classes.index(clip.label)))
            found.append(Moment(clip, asked, start + asked.start))
    return found


@cache
def _known(split: str, fold: int) -> Material:
    clips = parted(split, fold)[0]
    return Material(clips, [_read(clip) for clip in clips], list(SPLITS[split].classes))


def _read(clip: LabelledClip) -> BodyMotion:
    return body_motion(clip.positions.astype(float), clip.fps)


def _targets(moments: Sequence[Moment]) -> list[int]:
    return [moment.asked.piece.target for moment in moments]


def _by_baseline(unit: Unit, moments: Sequence[Moment]) -> Float64Array:
    whole, known = unit.method in (ALL_CHANNELS, ALIKE), _known(unit.split, unit.fold)
    method = "seq2seq" if whole else unit.method
    settings = CHOSEN.get(unit.split, {}).get(method, DEFAULTS)
    if unit.method == ALIKE:
        recipe = onset_recipe(unit.epochs)
        steps = recipe.epochs_of(len(known.classes)) * recipe.epoch
        learned, settings = as_the_onset(known), Settings(budget=replace(DEFAULTS.budget, epochs=1, steps=steps))
    else:
        learned, settings = training_motions(known, whole), Settings(budget=LONG) if whole else settings
    trained = fitted(DENSE[method](settings_of(unit.epochs, settings)), learned, unit.fold)
    pasts = [_frames(m.asked.piece.motion, whole)[: m.asked.start + 1] for m in moments]
    made = trained.predict(pasts, np.array(_targets(moments), dtype=np.int64))[..., :JOINTS]
    return np.stack([apart(frames, m.asked, m.asked.start) for frames, m in zip(made, moments, strict=True)])


def training_motions(known: Material, whole: bool) -> Motions:
    """Clips as baselines read them: frames of pieces; where `whole`, the root's motion too, and each mirrored."""
    each = [
        (one, target)
        for motion, target in zip(known.motions, known.targets, strict=True)
        for one in ((motion, mirrored(motion)) if whole else (motion,))
    ]
    return _pieces(each, len(known.classes), whole)


def as_the_onset(known: Material) -> Motions:
    """Clips as the network of the onset learns from them: at its paces, mirrored but for classes done with one side."""
    of_class = [
        [m for m, t in zip(known.motions, known.targets, strict=True) if t == c] for c in range(len(known.classes))
    ]
    sided = [one_sided(own, name in GOING) for own, name in zip(of_class, known.classes, strict=True)]
    each = [
        (played_at(one, pace), target)
        for motion, target in zip(known.motions, known.targets, strict=True)
        for one in ((motion,) if sided[target] else (motion, mirrored(motion)))
        for pace in PACES
    ]
    return _pieces(each, len(known.classes), True)


def _pieces(motions: Sequence[tuple[BodyMotion, int]], classes: int, whole: bool) -> Motions:
    found: list[Float32Array] = []
    targets: list[int] = []
    for motion, target in motions:
        for start, stop in ranges(len(motion)):
            if stop - start > HORIZON + GIVEN:
                found.append(_frames(motion.cut(start, stop), whole))
                targets.append(target)
    count = classes if classes > 1 else 0
    return Motions(found, np.array(targets if count else [0] * len(found), dtype=np.int64), count, (), BONES)


def _frames(motion: BodyMotion, whole: bool) -> Float32Array:
    return motion.rows.astype(np.float32) if whole else frames_of(motion)


def _by_networks(unit: Unit, moments: Sequence[Moment]) -> Float64Array:
    maker = networks(unit.split, unit.fold, unit.epochs, unit.generators)
    pieces, targets = [moment.asked.piece for moment in moments], _targets(moments)
    places = [float(piece.sparse.places[GIVEN - 1]) for piece in pieces]
    if unit.method in ONSET:
        by = {ONSET[1]: maker.onset.by_kernel, ONSET[2]: maker.onset.by_network}.get(unit.method)
        rows = [ahead(maker, piece, target, by) for piece, target in zip(pieces, targets, strict=True)]
        still = [np.repeat(moment.asked.known[-1:], HORIZON, axis=0) for moment in moments]
        made = [own if row is None else row[:HORIZON, :JOINTS] for own, row in zip(still, rows, strict=True)]
    else:
        motions = continued(maker, pieces, targets, HORIZON, led=unit.method == LED)
        made = [frames_of(motion) for motion in motions]
    return np.stack(
        [apart(np.asarray(m, np.float32), moment.asked, place)
         for m, moment, place in zip(made, moments, places, strict=True)]
    )  # fmt: skip


def _by_matching(unit: Unit, moments: Sequence[Moment]) -> Float64Array:
    """The likeliest motion of motion matching, read as recordings are; where few frames are given the first is held."""
    maker = matching(unit.split, unit.fold)
    starts = [_given(moment) for moment in moments]
    made = maker.generate(
        [
            MotionRequest(
                (moment.clip.label,), HORIZON / FPS, unit.fold, start, temperature=0.0, control=Control(from_end=True)
            )
            for moment, start in zip(moments, starts, strict=True)
        ]
    )
    found = []
    for moment, start, one in zip(moments, starts, made, strict=True):
        both = np.concatenate([start.positions, one.positions])
        frames = frames_of(body_motion(both, FPS))[len(start.positions) :]
        found.append(apart(frames, moment.asked, moment.asked.start))
    return np.stack(found)


def _given(moment: Moment) -> SeedClip:
    """The clip up to the moment, 30 frames a second."""
    clip = moment.clip
    joints = resample(clip.positions.astype(float), clip.fps, FPS)[: moment.frame + 1]
    turned = resample(clip.rotations.astype(float), clip.fps, FPS, spherical=True)[: moment.frame + 1]
    before = max(0, SHORTEST - len(joints))
    joints, turned = (np.concatenate([np.repeat(each[:1], before, axis=0), each]) for each in (joints, turned))
    return SeedClip(clip.name, joints, FPS, offsets_of(clip), turned)
