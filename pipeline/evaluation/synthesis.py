"""A generator measured on a labelled lake: errors, movement, likeness, copying (section 4.3 of the thesis)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any, Final

from motionlake.arrays import FloatArray, StepProgress
from motionlake.deephums.sequence import clip_sequence
from motionlake.errors import UserError
from motionlake.evaluation.clips import Notice, told
from motionlake.evaluation.synthesis_likeness import Aligned, Describe, Likeness, copying, frechet_distance
from motionlake.evaluation.synthesis_metrics import Movement, energy, errors, movement
from motionlake.evaluation.synthesis_trials import (
    Generator,
    RealMotion,
    Trial,
    continued,
    following,
    from_other_classes,
    real_clips,
    seeded_clips,
)
from motionlake.glogen.generator import EmbeddedMotions
from motionlake.lake.catalog import Connection
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model, current_model
from motionlake.stages.descriptors import DESCRIPTORS
from motionlake.stages.synthesis import open_generator


@dataclass(frozen=True)
class SynthesisPlan:
    """What is made to be measured.

    Attributes:
        count: motions of each class that start from clips of other classes.
        seed: the first of the motions' seeds.
        seconds: of motions; None: as long as the real clips beside them go on. Errors are always taken as long.
        piece: seconds; longer clips are cut into pieces as long, each a clip to go on from.
    """

    count: int = 10
    seed: int = 0
    seconds: float | None = None
    piece: float = 10.0


DEFAULT: Final = SynthesisPlan()


@dataclass(frozen=True)
class SynthesisEvaluation:
    """What was measured, and what pictures of it need.

    Attributes:
        found: what `evaluate_synthesis` tells of.
        trials: made motions, those of own seeds before those of other classes' seeds.
        own: how many go on from a clip of their own class.
        real: [r, d] descriptors of what really follows in test clips, their classes [r] in `real_classes`.
        made: [m, d] descriptors of the trials.
        embedded: test clips as the generator itself reads them; None where it tells nothing of that.
    """

    found: dict[str, Any]
    trials: list[Trial]
    own: int
    real: FloatArray
    real_classes: list[str]
    made: FloatArray
    embedded: EmbeddedMotions | None = None


def measure_generator(
    generator: Generator, test: Sequence[RealMotion], training: Sequence[RealMotion], describe: Describe,
    plan: SynthesisPlan = DEFAULT, progress: StepProgress = lambda what, done, total: None,
) -> SynthesisEvaluation:  # fmt: skip
    """Measure anything that generates.

    Test clips are gone on from in their own class, at temperature 0 for errors and at 1 for all else; and `plan.count`
    motions of each class are made from clips of other classes. Real motion is always what follows a seed, never a whole
    clip: that is all that a made motion could be. Nothing is compared with a clip that it starts from or stands beside.

    Args:
        generator: makes motion.
        test: clips of its classes to go on from, and to compare with.
        training: clips of its classes to learn classes from, and that might be copied.
        describe: descriptors that know nothing of the generator.
        plan: what is made.
        progress: hears what is done, and how much of it.

    Returns:
        mean_per_joint_error, euclidean, sparse (the same over 15 sparse poses), errors_ms and euclidean_ms by
        milliseconds with n_ms (clips that go on so long), zero_velocity (all of these of the last pose held);
        fid (motions that go on in their own class, against what follows), fid_other_seeds, fid_real (training clips
        against test clips), None of fewer than two; foot_sliding, energy, travel_speed (made, real, ratio; see
        `movement`), bone_length_drift; recognised (of motions with other seeds: made, real, ratio; own_seeds; None
        without other classes); nearest_real (`copying`); by_class; n.

    Raises:
        UserError: no clip is long enough to go on from.
    """
    pieces = [list(chain.from_iterable(motion.pieces(plan.piece) for motion in some)) for some in (test, training)]
    seeded = seeded_clips(generator, pieces[0], plan.seed, "test seeds", progress)
    known = seeded_clips(generator, pieces[1], plan.seed, "training seeds", progress)
    likely = continued(generator, seeded, temperature=0.0, seconds=None, what="likely", progress=progress)
    own = continued(generator, seeded, temperature=1.0, seconds=plan.seconds, what="own seeds", progress=progress)
    other = from_other_classes(
        generator, seeded, plan.count, seconds=plan.seconds, seed=plan.seed + len(pieces[0]), what="other seeds",
        progress=progress,
    )  # fmt: skip
    trials = [*own, *other]
    measure = Likeness(trials, seeded, known, describe)
    moves = _Moves(trials, [*test, *training])
    found = {
        **errors(likely),
        "fid": _fid(measure.real, measure.made[: len(own)]),
        "fid_other_seeds": _fid(measure.real, measure.made[len(own) :]),
        "fid_real": _fid(measure.real, measure.gallery),
        **moves.of(range(len(trials))),
        "recognised": measure.recognised(range(len(own), len(trials)), range(len(own))),
        "nearest_real": copying(
            [Aligned.of(t.made.positions, t.made.fps, t.seed.motion.clip, t.real.motion.clip) for t in trials],
            [Aligned.of(each.after, each.fps, each.motion.clip) for each in seeded],
            [Aligned.of(each.after, each.fps, each.motion.clip) for each in known],
            [Aligned.of(m.positions, m.fps, m.clip) for m in training], progress,
        ),
        "by_class": {},
    }  # fmt: skip
    for name in sorted({trial.wanted for trial in trials}):
        rows = [i for i, trial in enumerate(trials) if trial.wanted == name]
        found["by_class"][name] = {
            "n": len(rows),
            **errors([t for t in likely if t.wanted == name]),
            **moves.of(rows),
            "recognised": measure.recognised([i for i in rows if i >= len(own)], [i for i in rows if i < len(own)]),
        }
    found["n"] = {
        "test": len(seeded), "training": len(known), "own_seeds": len(own), "other_seeds": len(other),
        "classes": len(found["by_class"]), "test_clips": len(test),
    }  # fmt: skip
    labels = [each.motion.label for each in seeded]
    return SynthesisEvaluation(found, trials, len(own), measure.real, labels, measure.made)


def _fid(real: FloatArray, made: FloatArray) -> float | None:
    return frechet_distance(real, made) if min(len(real), len(made)) > 1 else None


class _Moves:
    """How the trials and the real clips beside them move."""

    def __init__(self, trials: Sequence[Trial], clips: Sequence[RealMotion]) -> None:
        self._classes = [trial.wanted for trial in trials]
        self._made = [Movement.of(t.made.positions, t.made.fps, t.made.rest_offsets) for t in trials]
        beside = {
            real: Movement.of(real.after, real.fps, real.motion.rest_offsets) for real in {t.real for t in trials}
        }
        self._real = [beside[trial.real] for trial in trials]
        fps = trials[0].made.fps
        long = [clip for clip in clips if len(clip.positions) > 3 * clip.fps / fps]
        self._ranges = {
            name: [energy(following(clip, 1, fps), fps) for clip in long if clip.label == name]
            for name in set(self._classes)
        }

    def of(self, rows: Sequence[int]) -> dict[str, Any]:
        made, real = ([side[i] for i in rows] for side in (self._made, self._real))
        return movement(made, real, [self._classes[i] for i in rows], self._ranges)


UNITS: Final = {
    "mean_per_joint_error": "mm", "euclidean": "mm", "errors_ms": "mm", "euclidean_ms": "mm",
    "sparse": "body lengths (leg plus torso) of the standard skeleton", "foot_sliding": "m/s",
    "contact": "share of frames", "bone_length_drift": "%", "energy": "m²/s²", "travel_speed": "m/s",
    "recognised": "share", "nearest_real": "body lengths, Euclidean over 14 joints", "fid": "descriptors of length one",
}  # fmt: skip


def evaluate_synthesis(
    con: Connection, lake: Lake, plan: SynthesisPlan = DEFAULT, *, dataset: str | None = None, split: str | None = None,
    repository: str | None = None, column: str = "label", notice: Notice = lambda line: None,
    progress: StepProgress = lambda what, done, total: None,
) -> SynthesisEvaluation:  # fmt: skip
    """Measure the lake's generator on test clips, by the descriptor network that the lake serves.

    Args:
        con, lake: the lake.
        plan: what is made.
        dataset: its clips only.
        split, repository: values of the column split, of the clips to go on from and compare with, and of those that
            classes are learned from and that might be copied; "test" and "train" where they are not given. Where no
            clip is of these and none is asked for, every clip is both, and nothing is compared with its own clip.
        column: what says the class of clips.
        notice: hears what is to be doubted.
        progress: hears what is done, and how much of it.

    Returns:
        What `measure_generator` tells; protocol, model and descriptor (name, what each was trained on), units; warning:
        None unless the generator was trained on clips that it is measured by.

    Raises:
        UserError: no generator, no descriptors, no such split or column, or no clip to measure by.
    """
    from motionlake.deephums.network import load_descriptor
    from motionlake.glogen.generator import TrainedGenerator, TrainingMotion, embed_motions

    model = current_model(con, "synthesis")
    if model is None:
        raise UserError(f"{lake.root}: has no generator yet; train one with `motionlake train synthesis --split train`")
    network = DESCRIPTORS.served(con)
    if network is None:
        raise UserError(f"{lake.root}: has no descriptors yet; make them with `motionlake run descriptors`")
    generator = open_generator(lake, model)
    descriptor = load_descriptor(sound(lake, network.file))
    clips = real_clips(
        con, lake, generator.classes, dataset=dataset, split=split, repository=repository, column=column
    )  # fmt: skip
    notice(f"{clips.protocol}: {len(clips.test)} clips to go on from, {len(clips.training)} known")
    measured = measure_generator(
        generator, clips.test, clips.training, lambda motions: descriptor.embed([clip_sequence(*m) for m in motions]),
        plan, progress,
    )  # fmt: skip
    warning = _warning(model, clips.test, clips.split)
    if warning:
        notice(f"warning: {warning}")
    measured.found["n"]["other_classes_left_out"] = clips.strangers
    measured.found.update(
        protocol=clips.protocol, units=UNITS, model=told(model), descriptor=told(network), warning=warning
    )
    if not isinstance(generator, TrainedGenerator):  # plays recorded frames: there is no layer that reads motions
        return measured
    read = [TrainingMotion(clip.positions, clip.fps, clip.label) for clip in clips.test]
    return replace(measured, embedded=embed_motions(generator, read))


def _warning(model: Model, test: Sequence[RealMotion], split: str | None) -> str | None:
    """Which test clips the generator has been trained on, as far as its metrics tell."""
    trained, dataset = model.metrics.get("split"), model.metrics.get("dataset")
    if trained is not None and trained != split:
        return None
    seen = [clip for clip in test if dataset in (None, clip.dataset)]
    if not seen:
        return None
    where = (f"split {trained}" if trained else "every clip") + (f" of {dataset}" if dataset else "")
    counts = Counter(clip.dataset for clip in seen)
    return (
        f"{len(seen)} of {len(test)} clips to measure by are such that {model.model} was trained on ({where}: "
        f"{', '.join(f'{n} of {name}' for name, n in sorted(counts.items()))}): the measures flatter; "
        "`motionlake train synthesis --split train` keeps them apart"
    )
