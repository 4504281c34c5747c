"""Table 4.2: all frames that follow five sparse poses, to the end of the clip, on utd_mhad.

No method is told how long a clip is: GloGen says itself how long its poses take, and holds the last one; the generator
of the kind of HP-GAN goes on from its own frames.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array
from motionlake.deephums.config import DescriptorsConfig
from motionlake.deephums.network import TrainedDescriptor
from motionlake.deephums.training import TrainingClip, train_descriptor
from motionlake.evaluation.synthesis.likeness import frechet_distance
from motionlake.glogen.config import SEEDS, SPARSE, SynthesisConfig
from motionlake.glogen.generator import TrainedGenerator
from motionlake.glogen.generator_training import fit_generator
from motionlake.glogen.inbetweening import dense_motions
from motionlake.glogen.rollout import predict
from motionlake.glogen.sparse import DURATION, PIECE
from motionlake.motion.resampling import interpolated
from numpy.typing import NDArray

from bench.glogen.baseline import Baseline
from bench.glogen.dense import Asked
from bench.glogen.material import BONES, Material, frames_of, split_material
from bench.glogen.methods import CHOSEN, DEFAULTS, build, fitted
from bench.glogen.motions import DENSE_TASK, Motions
from bench.glogen.sparse import SET, Unit, as_described, settings_of
from bench.units import Found

OURS: Final[Mapping[str, SynthesisConfig]] = {
    "motionlake": SynthesisConfig(),
    "thesis": SynthesisConfig(recipe="glogen"),
}
METHODS: Final = ("hp_gan", "zero_velocity", *OURS)


@dataclass(frozen=True)
class Question:
    """Test clips with five sparse poses given.

    Attributes:
        asked: of each clip what is known.
        targets: [m] classes.
        lengths: [m] whole frames that follow the last given pose.
    """

    asked: list[Asked]
    targets: NDArray[np.int64]
    lengths: list[int]

    def truth(self, *, between: bool) -> list[Float32Array]:
        """Of each clip [length, 60]: one frame after the last given pose, two frames after it, and so on.

        A sparse pose may lie between two frames; methods that read frames begin at the first of these (not `between`).
        """
        found = []
        for one, n in zip(self.asked, self.lengths, strict=True):
            at = np.arange(1.0, n + 1) + (_place(one) if between else one.start)
            found.append(interpolated(frames_of(one.piece.motion).astype(float), at).astype(np.float32))
        return found


def question(chosen: Material) -> Question:
    """Whole clips, those of more than 150 frames in pieces."""
    asked = [Asked.of(piece) for piece in chosen.pieces(SPARSE, PIECE)]
    lengths = [int(len(one.piece.motion) - 1 - _place(one)) for one in asked]
    kept = [i for i, n in enumerate(lengths) if n >= 1]
    targets = np.array([asked[i].piece.target for i in kept], dtype=np.int64)
    return Question([asked[i] for i in kept], targets, [lengths[i] for i in kept])


def measure(unit: Unit) -> dict[str, Found]:
    """{method: scores}: errors of the best guess over all frames, likeness of samples."""
    test = question(split_material(SET, "test"))
    make = _ours if unit.method in OURS else _baseline
    guessed, sampled = make(unit, test)
    truth = test.truth(between=unit.method in OURS)
    apart = np.concatenate([made - true for made, true in zip(guessed, truth, strict=True)]).astype(float)
    return {
        unit.method: {
            "fid": frechet_distance(_described(truth), _described(sampled)),
            "joint_error": float(np.linalg.norm(apart.reshape(len(apart), -1, 3), axis=2).mean()),
            "pose_error": float(np.linalg.norm(apart, axis=1).mean()), "n": len(truth), "frames": len(apart),
        }
    }  # fmt: skip


def _baseline(unit: Unit, test: Question) -> tuple[list[Float32Array], list[Float32Array]]:
    settings = settings_of(unit.epochs, CHOSEN[SET].get(unit.method, DEFAULTS))
    method = fitted(build(DENSE_TASK, unit.method, settings), _training_motions(), unit.seed)
    return _gone_on(method, test, None), _gone_on(method, test, np.random.default_rng(unit.seed))


def _gone_on(method: Baseline, test: Question, rng: np.random.Generator | None) -> list[Float32Array]:
    """What a method makes of the frames it knows, then of its own, until the longest clip ends."""
    known = [one.known for one in test.asked]
    begun = [len(frames) for frames in known]
    for _ in range(-(-max(test.lengths) // DENSE_TASK.horizon)):
        made = method.predict(known, test.targets, rng)
        known = [np.concatenate(pair) for pair in zip(known, made, strict=True)]
    return [frames[first : first + n] for frames, first, n in zip(known, begun, test.lengths, strict=True)]


def _training_motions() -> Motions:
    train = split_material(SET, "train")
    made = [
        piece for piece in train.pieces(SPARSE, PIECE) if len(piece.motion) >= DENSE_TASK.least + DENSE_TASK.horizon
    ]
    frames, targets = [frames_of(piece.motion) for piece in made], [piece.target for piece in made]
    return Motions(frames, np.array(targets, dtype=np.int64), len(train.classes), (), BONES)


def _ours(unit: Unit, test: Question) -> tuple[list[Float32Array], list[Float32Array]]:
    train = split_material(SET, "train")
    config = replace(OURS[unit.method], seed=unit.seed, epochs=unit.epochs)
    generator = fit_generator(train.motions, train.labels, config)
    latent = np.random.default_rng(unit.seed).standard_normal((len(test.asked), max(1, generator.glogen.recipe.latent)))
    guessed, sampled = (_once(generator, test, share * latent) for share in (0.0, 1.0))
    return guessed, sampled


def _once(generator: TrainedGenerator, test: Question, latent: NDArray[np.float64]) -> list[Float32Array]:
    """The 15 poses that follow, once, and the frames between them."""
    given = np.stack([one.piece.sparse.rows[:SEEDS] for one in test.asked])
    assert generator.glogen.of == [list(range(len(generator.classes)))]  # actions come to their end
    rows = np.concatenate([given[:, -1:], predict(generator.glogen.network(0), given, test.targets, latent)], axis=1)
    times = np.concatenate([np.zeros((len(rows), 1)), np.cumsum(np.exp(rows[:, 1:, DURATION]), axis=1)], axis=1)
    made = dense_motions(generator.locgen, list(rows), list(times), max(test.lengths))
    return [frames_of(motion)[:n] for motion, n in zip(made, test.lengths, strict=True)]


@cache
def _judge() -> TrainedDescriptor:
    """A descriptor network trained by class on what follows in the clips of the training split, for no generator."""
    train = split_material(SET, "train")
    asked = question(train)
    labels = [train.classes[target] for target in asked.targets.tolist()]
    clips = [TrainingClip(s, label) for s, label in zip(as_described(asked.truth(between=True)), labels, strict=True)]
    return train_descriptor(clips, DescriptorsConfig(supervision="labels", epochs=40))


def _described(motions: list[Float32Array]) -> Float32Array:
    return _judge().embed(as_described(motions))


def _place(one: Asked) -> float:
    return float(one.piece.sparse.places[SEEDS - 1])
