"""The search that every network has alike: settings by their error on motions to train on that are held out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import numpy as np

from bench.glogen.baseline import Settings
from bench.glogen.methods import UNTRAINED, build
from bench.glogen.motions import Motions, Task, hold_out, joint_error, windows_of

HIDDEN: Final = (128, 256, 512)
RATES: Final = (1e-3, 2e-3, 4e-3)
RESIDUAL: Final = (None, True)


@dataclass(frozen=True)
class Tried:
    """Settings and the mean per-joint error that they reach on what is held out."""

    settings: Settings
    error: float


def candidates(
    settings: Settings,
    hidden: Sequence[int] = HIDDEN,
    rates: Sequence[float] = RATES,
    residual: Sequence[bool | None] = RESIDUAL,
) -> list[Settings]:
    """Every combination of widths, peak learning rates and outputs (as published, or steps from the last pose)."""
    return [
        replace(settings, hidden=width, residual=steps, budget=replace(settings.budget, learning_rate=rate))
        for width, rate, steps in product(hidden, rates, residual)
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
