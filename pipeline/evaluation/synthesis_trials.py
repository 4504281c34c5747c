"""Motions made to be measured: each goes on from a real clip, and has a real one beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from motionlake.arrays import Float64Array, StepProgress
from motionlake.errors import UserError
from motionlake.evaluation.synthesis_clips import RealMotion
from motionlake.glogen.requests import GeneratedMotion, MotionRequest, SeedClip
from motionlake.motion.resampling import TOLERANCE, beside

AT_ONCE: Final = 64  # motions that a generator makes in one go
LEAST: Final = 0.3  # seconds of a real clip after the seed


class Generator(Protocol):
    """What makes motion; `motionlake.glogen.generator.TrainedGenerator` is one, and so is any baseline."""

    @property
    def classes(self) -> list[str]: ...

    def generate(self, requests: Sequence[MotionRequest]) -> list[GeneratedMotion]: ...


@dataclass(frozen=True)
class Begun:
    """A real clip whose first poses a generator takes as its seed.

    Attributes:
        motion: the clip.
        stop: the frame after the seed.
        after: [F, 21, 3] what really follows, at `fps`: frame k is (k + 1) / fps after the seed's last frame.
        fps: the generator's.
        chance: the request's seed: it says which part of a long clip is the seed.
    """

    motion: RealMotion
    stop: int
    after: Float64Array
    fps: float
    chance: int

    @property
    def last_pose(self) -> Float64Array:
        """[21, 3] the seed's."""
        return np.asarray(self.motion.positions[self.stop - 1])

    @property
    def seconds(self) -> float:
        return len(self.after) / self.fps


@dataclass(frozen=True)
class Trial:
    """A made motion.

    Attributes:
        wanted: its class.
        made: itself.
        seed: the clip that it goes on from.
        real: the clip of the wanted class that it is compared with; where that is the seed, what really follows.
    """

    wanted: str
    made: GeneratedMotion
    seed: Begun
    real: Begun


def begun(
    generator: Generator, motions: Sequence[RealMotion], seed: int, what: str, progress: StepProgress
) -> list[Begun]:
    """The motions that are long enough to go on from, each with what follows its seed.

    Raises:
        UserError: none is.
    """
    requests = [_request(motion, motion.label, 1e-3, seed + i, 0.0) for i, motion in enumerate(motions)]
    found: list[Begun] = []
    refused = "no clips"
    for start in range(0, len(requests), AT_ONCE):
        made, reason = _those_possible(generator, requests[start : start + AT_ONCE])
        refused = reason or refused
        for i, one in enumerate(made, start):
            if one is not None:
                after = following(motions[i], one.seed_stop, one.fps)
                if len(after) >= LEAST * one.fps:
                    found.append(Begun(motions[i], one.seed_stop, after, one.fps, requests[i].seed))
        progress(what, min(start + AT_ONCE, len(requests)), len(requests))
    if not found:
        raise UserError(f"none of {len(motions)} clips is long enough to go on from and compare with ({refused})")
    return found


def following(motion: RealMotion, stop: int, fps: float) -> Float64Array:
    """[F, 21, 3] a clip at `fps` after frame `stop` - 1, linearly interpolated."""
    step, frames = motion.fps / fps, motion.positions
    at = stop - 1 + step * np.arange(1, int(np.floor((len(frames) - stop) / step + TOLERANCE)) + 1)
    before, after, share = beside(at, len(frames), TOLERANCE)
    share = np.clip(share, 0, 1)[:, None, None]
    return np.asarray((1 - share) * frames[before] + share * frames[after])


def continued(
    generator: Generator, begins: Sequence[Begun], *, temperature: float, seconds: float | None, what: str,
    progress: StepProgress,
) -> list[Trial]:  # fmt: skip
    """Each clip gone on from in its own class, for `seconds`, or as long as it really goes on."""
    requests = [
        _request(each.motion, each.motion.label, seconds or each.seconds, each.chance, temperature) for each in begins
    ]
    return _trials(generator, requests, [(each, each) for each in begins], what, progress)


def from_other_classes(
    generator: Generator, begins: Sequence[Begun], count: int, *, seconds: float | None, seed: int, what: str,
    progress: StepProgress,
) -> list[Trial]:  # fmt: skip
    """`count` motions of each class that has real clips, each from a clip of another class.

    They are compared in turn with real clips of the class, taken evenly. Each is made as long as that goes on (or
    `seconds`) and starts from a clip of the same dataset, drawn at random. Without other classes there are none.
    """
    random = np.random.default_rng(seed)
    pairs = []
    for name in sorted({each.motion.label for each in begins}):
        real = [each for each in begins if each.motion.label == name]
        others = [each for each in begins if each.motion.label != name]
        for i in range(count if others else 0):
            beside = real[i % len(real) if count > len(real) else i * len(real) // count]
            near = [each for each in others if each.motion.dataset == beside.motion.dataset] or others
            pairs.append((near[int(random.integers(len(near)))], beside))
    requests = [
        _request(start.motion, real.motion.label, seconds or real.seconds, seed + i, 1.0)
        for i, (start, real) in enumerate(pairs)
    ]
    return _trials(generator, requests, pairs, what, progress)


def _trials(
    generator: Generator,
    requests: Sequence[MotionRequest],
    pairs: Sequence[tuple[Begun, Begun]],
    what: str,
    progress: StepProgress,
) -> list[Trial]:
    found: list[Trial] = []
    for first in range(0, len(requests), AT_ONCE):
        made = generator.generate(requests[first : first + AT_ONCE])
        for one, (start, real) in zip(made, pairs[first : first + AT_ONCE], strict=True):
            found.append(Trial(real.motion.label, one, start, real))
        progress(what, len(found), len(requests))
    return found


def _request(start: RealMotion, label: str, seconds: float, seed: int, temperature: float) -> MotionRequest:
    given = SeedClip(start.clip, start.positions, start.fps, start.rest_offsets)
    return MotionRequest((label,), seconds, seed, given, temperature=temperature)


def _those_possible(
    generator: Generator, requests: Sequence[MotionRequest]
) -> tuple[list[GeneratedMotion | None], str]:
    """What each request gives, None where it cannot be met, and why the last of these could not."""
    try:
        return list(generator.generate(requests)), ""
    except ValueError as error:
        if len(requests) == 1:
            return [None], str(error)
    half = len(requests) // 2
    (first, why), (second, other) = (_those_possible(generator, some) for some in (requests[:half], requests[half:]))
    return [*first, *second], other or why
