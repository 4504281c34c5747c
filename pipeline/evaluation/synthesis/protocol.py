"""A generator measured on a labelled lake: errors, movement, likeness, copying (section 4.3 of the thesis)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any, Final

from motionlake.arrays import FloatArray, StepProgress
from motionlake.deephums.config import PRETRAINED_DESCRIPTORS
from motionlake.deephums.sequence import clip_sequence
from motionlake.errors import UserError
from motionlake.evaluation.clips import Notice, told
from motionlake.evaluation.synthesis.copying import Aligned, copying
from motionlake.evaluation.synthesis.errors import errors
from motionlake.evaluation.synthesis.likeness import Describe, Likeness
from motionlake.evaluation.synthesis.motions import UNITS as MOTION_UNITS
from motionlake.evaluation.synthesis.motions import Measured, Stretch, beside, usual_of
from motionlake.evaluation.synthesis.transitions import made_stretch, real_stretch, transitions
from motionlake.evaluation.synthesis.trials import (
    RealMotion,
    SeededClip,
    Trial,
    continued,
    from_other_classes,
    real_clips,
    seeded_clips,
)
from motionlake.evaluation.synthesis.variety import Windows, likeness, pose_spread, spread
from motionlake.glogen.generator import EmbeddedMotions
from motionlake.lake.catalog import Connection
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model, current_model
from motionlake.motion.generation import MotionGenerator
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
    generator: MotionGenerator, test: Sequence[RealMotion], training: Sequence[RealMotion], describe: Describe,
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
        milliseconds with n_ms (clips that go on so long), zero_velocity (all of these of the last pose held); the
        measures of `Measured.of`; likeness (made, other_seeds, training: `variety.likeness` against what follows in
        test clips); diversity, multimodality, pose_spread (made, real, ratio); transitions (`transitions`); recognised
        (of motions with other seeds: made, real, ratio; own_seeds; None without other classes); nearest_real
        (`copying`); by_class; n.

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
    sets = _Sets(trials, seeded, known, describe)
    whole = range(len(own)), range(len(own), len(trials))
    found = {
        **errors(likely), **sets.of(*whole),
        "recognised": measure.recognised(whole[1], whole[0]),
        "nearest_real": _copying(trials, seeded, known, training, test, progress),
        "by_class": {},
    }  # fmt: skip
    for name in sorted({trial.wanted for trial in trials}):
        rows = [[i for i in some if trials[i].wanted == name] for some in whole]
        found["by_class"][name] = {
            "n": sum(map(len, rows)),
            **errors([t for t in likely if t.wanted == name]),
            **sets.of(*rows),
            "recognised": measure.recognised(rows[1], rows[0]),
        }
    found["n"] = {
        "test": len(seeded), "training": len(known), "own_seeds": len(own), "other_seeds": len(other),
        "classes": len(found["by_class"]), "test_clips": len(test),
    }  # fmt: skip
    labels = [each.motion.label for each in seeded]
    return SynthesisEvaluation(found, trials, len(own), measure.real, labels, measure.made)


def _copying(
    trials: Sequence[Trial], seeded: Sequence[SeededClip], known: Sequence[SeededClip], training: Sequence[RealMotion],
    test: Sequence[RealMotion], progress: StepProgress,
) -> dict[str, Any]:  # fmt: skip
    followed, followed_known = (
        [Aligned.of(each.after, each.fps, each.motion.clip) for each in some] for some in (seeded, known)
    )
    clips, unseen = ([Aligned.of(m.positions, m.fps, m.clip) for m in some] for some in (training, test))
    made = [Aligned.of(t.made.positions, t.made.fps, t.seed.motion.clip, t.real.motion.clip) for t in trials]
    return copying(made, followed, followed_known, clips, unseen, progress)


class _Sets:
    """Trials, what really follows in test clips and in training clips: each as motions and as descriptors."""

    def __init__(
        self, trials: Sequence[Trial], test: Sequence[SeededClip], training: Sequence[SeededClip], describe: Describe
    ) -> None:
        self._trials, self._test, self._training = trials, test, training
        self._made = [made_stretch(trial) for trial in trials]
        self._real, self._known = ([real_stretch(each) for each in some] for some in (test, training))
        self._usual = usual_of([*self._known, *(one for one in self._real if one.label not in _labels(self._known))])
        self._measured = Measured(self._made, self._real, self._usual)
        self._windows, self._real_windows, self._known_windows = (
            Windows(some, describe) for some in (self._made, self._real, self._known)
        )

    def of(self, own: Sequence[int], other: Sequence[int]) -> dict[str, Any]:
        """Of trials from own seeds and from other classes', by row, and of the real motion of their classes."""
        rows = [*own, *other]
        labels = {self._trials[i].wanted for i in rows}
        real, known = ([i for i, each in enumerate(some) if each.label in labels] for some in (self._real, self._known))
        vectors, trained = self._real_windows.some(real), self._known_windows.some(known)
        made, from_others = self._windows.some(own), self._windows.some(other)
        count = min((len(some) for some in (made, from_others, trained) if len(some) > 1), default=0)
        return {
            **self._measured.of(rows, real),
            "likeness": {
                "made": likeness(vectors, made, count), "other_seeds": likeness(vectors, from_others, count),
                "training": likeness(vectors, trained, count),
            },
            **self._variety(own, real),
            "transitions": transitions([self._trials[i] for i in other], [self._made[i] for i in other], self._usual),
        }  # fmt: skip

    def _variety(self, made: Sequence[int], real: Sequence[int]) -> dict[str, Any]:
        """Of motions that go on in their own class, as many as real ones."""
        sides = ((self._windows, self._made, made), (self._real_windows, self._real, real))
        found: list[tuple[float | None, ...]] = []
        for described, motions, rows in sides:
            kept = [i for i, of in enumerate(described.of.tolist()) if of in set(rows)]
            vectors, of, place = described.vectors[kept], described.of[kept], described.place[kept]
            classes = [motion.label for motion in motions]
            found.append(
                (
                    spread(vectors, of, place),
                    spread(vectors, of, place, classes),
                    pose_spread([motions[i] for i in rows]),
                )
            )
        names = ("diversity", "multimodality", "pose_spread")
        return {name: beside(*pair) for name, pair in zip(names, zip(*found, strict=True), strict=True)}


def _labels(motions: Sequence[Stretch]) -> set[str]:
    return {motion.label for motion in motions}


UNITS: Final = {
    "mean_per_joint_error": "mm", "euclidean": "mm", "errors_ms": "mm", "euclidean_ms": "mm",
    "sparse": "body lengths (leg plus torso) of the standard skeleton", **MOTION_UNITS, "usual": "share of seconds",
    "angular_range": "degrees", "never_turned": "joints", "pose_spread": "body lengths",
    "diversity": "distance of descriptors of length one", "multimodality": "distance of descriptors of length one",
    "likeness": "descriptors of length one", "transitions": "seconds, shares, mm", "recognised": "share",
    "nearest_real": "body lengths, Euclidean over 14 joints",
}  # fmt: skip


def evaluate_synthesis(
    con: Connection, lake: Lake, plan: SynthesisPlan = DEFAULT, *, dataset: str | None = None, split: str | None = None,
    repository: str | None = None, column: str = "label", notice: Notice = lambda line: None,
    progress: StepProgress = lambda what, done, total: None,
) -> SynthesisEvaluation:  # fmt: skip
    """Measure the lake's generator on test clips, by the pretrained descriptor network of the package.

    That one is the same for every lake and has seen no generator's classes or motions.

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
        UserError: no generator, no such split or column, or no clip to measure by.
    """
    from motionlake.deephums.network import load_descriptor
    from motionlake.glogen.generator import TrainedGenerator, TrainingMotion, embed_motions

    model = current_model(con, "synthesis")
    if model is None:
        raise UserError(f"{lake.root}: has no generator yet; train one with `motionlake train synthesis --split train`")
    generator = open_generator(lake, model)
    descriptor = load_descriptor(PRETRAINED_DESCRIPTORS.file)
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
        protocol=clips.protocol,
        units=UNITS,
        model=told(model),
        descriptor=PRETRAINED_DESCRIPTORS.about(),
        warning=warning,
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
