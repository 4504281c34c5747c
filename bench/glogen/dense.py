"""Table 4.3: what follows five sparse poses, in real time, of clips of a CMU set that are left out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.evaluation.synthesis.errors import MILLISECONDS
from motionlake.glogen.config import SEEDS, SPARSE, SynthesisConfig
from motionlake.glogen.generator import TrainedGenerator
from motionlake.glogen.inbetweening import dense_motions
from motionlake.glogen.onset import played, with_onset
from motionlake.glogen.onset_examples import state_at
from motionlake.glogen.rollout import Rollout, roll_out
from motionlake.glogen.sparse import PIECE, TrainingPiece, even_motion, ranges
from motionlake.glogen.trajectories import FPS, BodyMotion
from motionlake.motion.resampling import interpolated
from numpy.typing import NDArray

from bench.glogen.folds import generator_without, parted
from bench.glogen.material import BONES, Material, frames_of
from bench.glogen.methods import CHOSEN, DEFAULTS, DENSE, fitted
from bench.glogen.motions import Motions
from bench.glogen.sparse import settings_of
from bench.units import Found

HORIZON: Final = 20  # frames
Errors = dict[str, Any]
OURS: Final[Mapping[str, SynthesisConfig]] = {
    "motionlake": SynthesisConfig(),
    "thesis": SynthesisConfig(recipe="glogen"),
}
UNLED: Final = "motionlake, no lead-in"
METHODS: Final = (*DENSE, *OURS, UNLED)


@dataclass(frozen=True)
class Unit:
    """One method on one fold of a set with one seed."""

    set_name: str
    method: str
    seed: int
    fold: int
    epochs: int = 0
    generators: Path | None = field(default=None, repr=False)

    def __str__(self) -> str:
        return f"{self.set_name} {self.method}, seed {self.seed}, fold {self.fold}"


@dataclass(frozen=True)
class Asked:
    """A piece of a clip that was left out.

    Attributes:
        piece: with its sparse poses.
        known: frames up to the last given pose, [F, 60].
        start: frame of the last given pose, whole: where methods that read frames begin.
    """

    piece: TrainingPiece
    known: Float32Array
    start: int

    @classmethod
    def of(cls, piece: TrainingPiece) -> Asked:
        start = int(piece.sparse.places[SEEDS - 1])
        return cls(piece, frames_of(piece.motion)[: start + 1], start)

    def true(self, place: float) -> NDArray[np.float64]:
        """[8, 60] joints at `MILLISECONDS` after a frame, fractional; NaN beyond the end."""
        at = place + np.array(MILLISECONDS) / 1000 * FPS
        joints = interpolated(frames_of(self.piece.motion).astype(float), np.minimum(at, len(self.piece.motion) - 1))
        joints[at > len(self.piece.motion) - 1 + 1e-6] = np.nan
        return joints


def measure(unit: Unit) -> dict[str, Errors]:
    """{method: errors of every piece of the clips left out}."""
    train, test = parted(unit.set_name, unit.fold)
    asked = [Asked.of(piece) for piece in asked_pieces(test)]
    off = _ours(unit, asked) if unit.method not in DENSE else _baseline(unit, train, asked)  # [pieces, 8, 20, 3]
    joints = np.linalg.norm(off, axis=3).mean(axis=2)
    poses = np.linalg.norm(off.reshape(*off.shape[:2], -1), axis=2)
    return {unit.method: {"joint": joints.tolist(), "pose": poses.tolist(), "clips": len(test.clips)}}


def means(errors: Sequence[Errors]) -> Found:
    """Mean errors at `MILLISECONDS` over all pieces of all folds, of those that go on so long."""
    found: Found = {}
    for kind in ("joint", "pose"):
        each = np.array([piece for fold in errors for piece in fold[kind]], dtype=float)
        found |= {f"{kind}_{ms}": float(v) for ms, v in zip(MILLISECONDS, np.nanmean(each, axis=0), strict=True)}
        found["n"] = int(np.isfinite(each[:, -1]).sum())
    return found | {"clips": sum(fold["clips"] for fold in errors)}


def asked_pieces(test: Material) -> list[TrainingPiece]:
    """The pieces of clips, their sparse poses as far apart in time as those of a piece of 100 frames."""
    parts = [motion.cut(*part) for motion in test.motions for part in ranges(len(motion))]
    return [TrainingPiece(part, even_motion(part), 0) for part in parts]


def _baseline(unit: Unit, train: Material, asked: list[Asked]) -> NDArray[np.float64]:
    settings = settings_of(unit.epochs, CHOSEN[unit.set_name].get(unit.method, DEFAULTS))
    method = fitted(DENSE[unit.method](settings), training_motions(train), unit.seed)
    made = method.predict([one.known for one in asked], np.zeros(len(asked), dtype=np.int64))
    return np.stack([apart(frames, one, one.start) for frames, one in zip(made, asked, strict=True)])


def training_motions(train: Material) -> Motions:
    """Clips as baselines read them: frames of pieces, in groups by clip; of one class, which is left out."""
    found: list[Float32Array] = []
    groups: list[str] = []
    for i, clip in enumerate(train.clips):
        pieces = [piece.motion for piece in train.of([i]).pieces(SPARSE, PIECE)]
        found += [frames_of(piece) for piece in pieces if len(piece) > HORIZON + SEEDS]
        groups += [clip.name] * (len(found) - len(groups))
    return Motions(found, np.zeros(len(found), dtype=np.int64), 0, tuple(groups), BONES)


def _ours(unit: Unit, asked: list[Asked]) -> NDArray[np.float64]:
    config = replace(OURS.get(unit.method, SynthesisConfig()), seed=unit.seed, epochs=unit.epochs)
    generator = generator_without(unit.set_name, unit.fold, config, unit.generators)
    made = continued(generator, [one.piece for one in asked], [0] * len(asked), HORIZON, led=unit.method != UNLED)
    return np.stack(
        [
            apart(frames_of(motion), one, float(one.piece.sparse.places[SEEDS - 1]))
            for motion, one in zip(made, asked, strict=True)
        ]
    )


def continued(
    generator: TrainedGenerator, pieces: list[TrainingPiece], targets: list[int], frames: int, *, led: bool
) -> list[BodyMotion]:
    """What a generator has follow the first sparse poses of pieces, nothing left to chance.

    `led`: led over to from how recorded bodies go on.
    """
    latent = np.zeros((1, max(1, generator.glogen.recipe.latent)))
    courses = roll_out(
        generator.glogen,
        [
            Rollout(p.sparse.rows[:SEEDS], [t], latent, frames / FPS, 1.0, taken=[generator.reach[t]])
            for p, t in zip(pieces, targets, strict=True)
        ],
    )
    rows, times = [np.stack(course.rows) for course in courses], [course.times() for course in courses]
    made = dense_motions(generator.locgen, rows, times, frames)
    if not led:
        return made
    return [with_onset(motion, ahead(generator, p, t)) for motion, p, t in zip(made, pieces, targets, strict=True)]


def ahead(
    generator: TrainedGenerator,
    piece: TrainingPiece,
    target: int,
    by: Callable[[Float64Array, int], Float64Array] | None = None,
) -> Float64Array | None:
    """[20 to 45, 64] rows that the onset predicts after the given poses of a piece; None where no body stood so.

    `by` one of the two that it is the mean of, or by both.
    """
    place = piece.sparse.places[SEEDS - 1 : SEEDS]
    state = state_at(piece.motion, place, generator.cyclic[target])[0]
    rows = generator.onset.ahead(state, target)
    if rows is None or by is None:
        return rows
    return played(state, by(state, target), int(generator.onset.frames[target]))


def apart(made: Float32Array, one: Asked, place: float) -> NDArray[np.float64]:
    """[8, 20, 3] differences of joints of `made` [20, 60], whose first frame is one after `place`."""
    at = np.array(MILLISECONDS) / 1000 * FPS - 1
    joints = interpolated(made.astype(float), at)
    return (joints - one.true(place)).reshape(len(at), -1, 3)
