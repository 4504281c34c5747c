"""How a motion goes on from recorded frames: whether it continues them, jumps, and when it is what was asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.evaluation.synthesis.errors import MM
from motionlake.evaluation.synthesis.motions import Stretch, Usual
from motionlake.evaluation.synthesis.trials import SeededClip, Trial, poses_at

SOON: Final = 1.5  # seconds, within which a change of class is over
CONTINUED: Final = 0.2  # seconds


def seam_jump(before: Float64Array, after: Float64Array) -> float:
    """Metres by which the first frame after a seam lies off the way that the joints were going, mean over the joints.

    Args:
        before: [2, 21, 3] the last two poses before it, a frame apart.
        after: [F, 21, 3] what follows at the same rate.
    """
    return float(np.linalg.norm(after[0] - (2 * before[1] - before[0]), axis=-1).mean())


def reached(motion: Stretch, usual: Usual) -> float | None:
    """Seconds until a second of a motion is usual of real clips of its class, in energy and in travel; None: never.

    0 where its first second is.
    """
    fits = np.flatnonzero(usual.fits(motion))
    return float(fits[0] / motion.fps) if len(fits) else None


def continuing(made: Float64Array, before: Float64Array, after: Float64Array, fps: float) -> dict[str, float]:
    """Metres from what really follows a seed, mean over the joints in the world and the first 200 ms.

    Args:
        made: [F, 21, 3] what a generator has follow.
        before: [2, 21, 3] the last two poses of the seed, a frame apart.
        after: [G, 21, 3] what really follows.
        fps: frames a second.

    Returns:
        Of "made", and beside it of the last pose "held" and of joints that go "on" as they were going.
    """
    count = min(len(made), len(after), max(1, round(CONTINUED * fps)))
    steps = np.arange(1, count + 1)[:, None, None]
    on = before[1] + steps * (before[1] - before[0])
    sides = {"made": made[:count], "held": np.repeat(before[1:], count, axis=0), "on": on}
    return {name: float(np.linalg.norm(each - after[:count], axis=2).mean()) for name, each in sides.items()}


def last_poses(seed: SeededClip) -> Float64Array:
    """[2, 21, 3] the last two poses of a seed, a frame apart at the generator's rate."""
    at = seed.stop - 1 - np.array([seed.motion.fps / seed.fps, 0.0])
    return poses_at(seed.motion.positions, np.maximum(at, 0))


def transitions(trials: Sequence[Trial], made: Sequence[Stretch], usual: Mapping[str, Usual]) -> dict[str, Any] | None:
    """How motions go on from seeds of other classes; None of none.

    Args:
        trials: n.
        made: n, the motions themselves.
        usual: of every class, what its real seconds are like.

    Returns:
        `seconds`: median time until the class is reached, None where most never do; `soon`: share that do within 1.5 s,
        "real" of what really follows in clips of the class; `jump_mm`: at the seam, "real" where recordings go on;
        `continued_mm`: over the first 200 ms, see `continuing`.
    """
    if not trials:
        return None
    real = [real_stretch(trial.real) for trial in trials]
    times, beside = ([reached(one, usual[one.label]) for one in some] for some in (made, real))
    before = [last_poses(trial.seed) for trial in trials]
    jumps = [seam_jump(b, one.positions) for b, one in zip(before, made, strict=True)]
    beside_jumps = [seam_jump(b, trial.seed.after) for b, trial in zip(before, trials, strict=True)]
    errors = [
        continuing(one.positions, b, trial.seed.after, one.fps)
        for one, b, trial in zip(made, before, trials, strict=True)
    ]
    known = sorted(np.inf if time is None else time for time in times)
    median = float(known[len(known) // 2])
    return {
        "seconds": median if np.isfinite(median) else None,
        "soon": {"made": _soon(times), "real": _soon(beside)},
        "jump_mm": {"made": MM * float(np.mean(jumps)), "real": MM * float(np.mean(beside_jumps))},
        "continued_mm": {name: MM * float(np.mean([each[name] for each in errors])) for name in errors[0]},
        "n": len(trials),
    }


def _soon(times: Sequence[float | None]) -> float:
    return float(np.mean([time is not None and time <= SOON for time in times]))


def real_stretch(seeded: SeededClip) -> Stretch:
    """What really follows a seed."""
    motion = seeded.motion
    turned = None if motion.rotations is None else motion.rotations[seeded.stop :]
    return Stretch(
        frozenset({motion.clip}), motion.label, seeded.after, seeded.fps, motion.rest_offsets, motion.ground, turned
    )


def made_stretch(trial: Trial) -> Stretch:
    """A made motion, on a level ground as high as where its seed ends."""
    made, seed = trial.made, trial.seed
    clips = frozenset({seed.motion.clip, trial.real.motion.clip})
    ground = seed.motion.ground.level_at(seed.last_pose[0])
    return Stretch(clips, trial.wanted, made.positions, made.fps, made.rest_offsets, ground, made.rotations)
