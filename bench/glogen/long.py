"""Ten seconds of motion from clips that were left out: does it freeze or run away, slide, travel as real clips do."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from motionlake.evaluation.synthesis.motions import Stretch, Usual, described
from motionlake.glogen.trajectories import FPS, resampled
from motionlake.motion.generation import GeneratedMotion, MotionRequest, SeedClip
from motionlake.motion.ground import ground_of

from bench.canonical_sets import LabelledClip
from bench.glogen.folds import Measures, Unit, folds, generator_of, parted
from bench.glogen.material import Material, material

SECONDS: Final = 10.0
ROWS: Final = ("made", "clips")


def measure(unit: Unit) -> dict[str, Measures]:
    """{"made", "clips"}: of every motion that starts from a clip left out, and of these clips."""
    whole = material(unit.set_name)
    train, test = parted(unit.set_name, unit.fold)
    generator = generator_of(unit)
    made = generator.generate([_wish(test, i, unit.seed * 1000 + n) for i, n in enumerate(folds(whole)[unit.fold])])
    usual = Usual.of([recorded_stretch(clip) for clip in train.clips])
    stretches = [made_stretch(one, clip) for one, clip in zip(made, test.clips, strict=True)]
    return {"made": _described(stretches, usual), "clips": _described([*map(recorded_stretch, test.clips)], usual)}


def _wish(test: Material, i: int, seed: int) -> MotionRequest:
    clip = test.clips[i]
    assert clip.rest_offsets is not None
    return MotionRequest((clip.label,), SECONDS, seed, SeedClip(clip.name, clip.positions, clip.fps, clip.rest_offsets))


def made_stretch(made: GeneratedMotion, clip: LabelledClip) -> Stretch:
    """A motion that goes on from a clip in its class, on a level ground as high as where the seed ends."""
    ground = ground_of(clip.positions).level_at(clip.positions[made.seed_stop - 1, 0])
    return Stretch(
        frozenset({clip.name}), clip.label, made.positions, made.fps, made.rest_offsets, ground, made.rotations
    )


def recorded_stretch(clip: LabelledClip) -> Stretch:
    """A whole clip, at the rate of made motion."""
    assert clip.rest_offsets is not None
    rows = resampled(clip.positions.reshape(len(clip.positions), -1), clip.fps, FPS)
    return Stretch(
        frozenset({clip.name}), clip.label, rows.reshape(len(rows), -1, 3), FPS, clip.rest_offsets,
        ground_of(clip.positions), clip.rotations,
    )  # fmt: skip


def _described(motions: Sequence[Stretch], usual: Usual) -> Measures:
    each = [described(motion) for motion in motions]
    found = {name: [value for one in each if (value := one[name]) is not None] for name in each[0]}
    return found | {"usual": [float(usual.fits(motion).mean()) for motion in motions]}
