"""What the measures of synthesis say of made motion, of real motion, and of controls made of it (`controls`)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, Final

from motionlake.deephums.config import PRETRAINED_DESCRIPTORS
from motionlake.deephums.network import TrainedDescriptor, load_descriptor
from motionlake.deephums.sequence import clip_sequence
from motionlake.evaluation.synthesis import SynthesisPlan, measure_generator
from motionlake.evaluation.synthesis.likeness import Describe
from motionlake.evaluation.synthesis.motions import Stretch, usual_of
from motionlake.evaluation.synthesis.transitions import made_stretch, real_stretch
from motionlake.evaluation.synthesis.trials import RealMotion, continued, seeded_clips
from motionlake.glogen.config import PRETRAINED_GENERATOR, SynthesisConfig
from motionlake.glogen.generator import TrainedGenerator, load_generator
from motionlake.glogen.generator_training import fit_generator

from bench.canonical_sets import LabelledClip
from bench.glogen.controls import CONTROLS, figures, flat
from bench.glogen.folds import Unit
from bench.glogen.material import material
from bench.glogen.sets import clips_of
from bench.units import Found

MADE: Final = "made"
ROWS: Final = (*CONTROLS, MADE)
SCORES: Final = (
    "travel_speed", "energy", "usual", "jerk", "skate_ratio", "penetration", "airborne", "diversity", "pose_spread",
    "likeness.fid", "likeness.density", "likeness.coverage", "nearest_real.z", "angular_range.left_wrist",
)  # fmt: skip
COUNT: Final = 20  # motions of each class from clips of the other one
EVERY: Final = 4  # of the clips that the pretrained generator is asked to go on from


def measure(unit: Unit) -> dict[str, Found]:
    """{row: numbers}: every second clip is to be gone on from, and the generator knows the others."""
    whole = material(unit.set_name)
    known = whole.of(list(range(0, len(whole.clips), 2)))
    generator = fit_generator(known.motions, known.labels, SynthesisConfig(seed=unit.seed, epochs=unit.epochs))
    seeded = seeded_clips(generator, pieces(whole.clips[1::2]), unit.seed, "test", _quiet)
    learned = [real_stretch(one) for one in seeded_clips(generator, pieces(known.clips), unit.seed, "known", _quiet)]
    trials = continued(generator, seeded, temperature=1.0, seconds=None, what="made", progress=_quiet)
    return rows([real_stretch(one) for one in seeded], learned, [made_stretch(trial) for trial in trials])


def rows(real: Sequence[Stretch], known: Sequence[Stretch], made: Sequence[Stretch] = ()) -> dict[str, Found]:
    """The numbers of every control, and of made motions where there are any."""
    usual = usual_of(known)
    sides = {name: control(real, known) for name, control in CONTROLS.items()}
    if made:
        sides[MADE] = list(made)
    return {name: flat(figures(some, real, known, usual, describer())) for name, some in sides.items()}


def pieces(clips: Sequence[LabelledClip]) -> list[RealMotion]:
    """Of clips, ten seconds each."""
    found = []
    for clip in clips:
        assert clip.rest_offsets is not None
        whole = RealMotion(
            clip.name, "", clip.label, clip.positions.astype(float), clip.fps, clip.rest_offsets, clip.rotations
        )  # fmt: skip
        found += list(whole.pieces(SynthesisPlan().piece))
    return found


def pretrained() -> dict[str, Any]:
    """`measure_generator` of the generator of the package: walks and runs, and from one to the other.

    It has seen the clips.
    """
    generator: TrainedGenerator = load_generator(PRETRAINED_GENERATOR.file)
    test, known = [], []
    for name in ("walk", "run"):
        own = pieces(clips_of(name))
        test += own[::EVERY]
        known += [motion for i, motion in enumerate(own) if i % EVERY]
    return measure_generator(generator, test, known, describer(), SynthesisPlan(count=COUNT)).found


@cache
def package_descriptor() -> TrainedDescriptor:
    return load_descriptor(PRETRAINED_DESCRIPTORS.file)


def describer() -> Describe:
    """Descriptors of the network of the package."""
    return lambda motions: package_descriptor().embed([clip_sequence(*motion) for motion in motions])


def _quiet(what: str, done: int, total: int) -> None: ...
