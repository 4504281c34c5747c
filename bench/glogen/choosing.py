"""The search that every network has alike: settings by their error on motions to train on that are held out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from bench.glogen.baseline import Settings
from bench.glogen.methods import DEFAULTS, UNTRAINED, build
from bench.glogen.motions import Motions, Task, hold_out, joint_error, windows_of

Tries = tuple[tuple[int, int, bool | None], ...]
# Units of a recurrent layer, steps of training at least (40 epochs at least too), whether steps from the last pose are
# put out (None: as published).
SPARSE_TRIED: Final[Tries] = ((256, 0, None), (256, 1000, None), (512, 0, None), (256, 1000, True))
DENSE_TRIED: Final[Tries] = ((128, 0, None), (256, 0, None), (128, 0, True))


@dataclass(frozen=True)
class Tried:
    """Settings and the mean per-joint error that they reach on what is held out."""

    settings: Settings
    error: float


def candidates(tries: Tries, settings: Settings = DEFAULTS) -> list[Settings]:
    """What is tried of every network, all else as in `settings`."""
    return [
        replace(settings, hidden=width, residual=residual, budget=replace(settings.budget, steps=steps))
        for width, steps, residual in tries
    ]


def choose(
    task: Task,
    name: str,
    data: Motions,
    tried: Sequence[Settings],
    seed: int = 0,
    groups: Sequence[str | None] = (None,),
) -> list[Tried]:
    """Settings by their error, the least first (of equals the one that comes first).

    Args:
        task: of the method.
        name: of the method; one without training has nothing to choose and is tried once.
        data: motions to train on, with groups.
        tried: settings to choose from.
        seed: of the fits and of the windows that are asked.
        groups: what is held out, in turn (None: the last by name); the error is the mean over them.
    """
    splits = [hold_out(data, group) for group in groups]
    found = []
    for settings in tried[:1] if name in UNTRAINED else tried:
        errors = [_error(task, name, known, held, settings, seed) for known, held in splits]
        found.append(Tried(settings, float(np.mean(errors))))
    return sorted(found, key=lambda each: each.error)


def _error(task: Task, name: str, known: Motions, held: Motions, settings: Settings, seed: int) -> float:
    method = build(task, name, settings)
    method.fit(known, seed)
    asked = windows_of(held, task, np.random.default_rng(seed))
    found = method.predict(asked.poses[:, : task.past], asked.classes)
    return joint_error(found, asked.poses[:, task.past :])
