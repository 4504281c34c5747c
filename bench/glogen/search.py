"""The search that every baseline network has alike: settings by their error on a subject or clip that is held out.

Of utd_mhad a subject of the training split, of the other sets a clip of those that are left when the first is left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from bench.glogen import dense, sparse
from bench.glogen.baseline import Settings
from bench.glogen.choosing import DENSE_TRIED, SPARSE_TRIED, candidates, choose
from bench.glogen.folds import SETS as FOLDED
from bench.glogen.material import material
from bench.glogen.methods import DENSE, NETWORKS, RESIDUAL
from bench.glogen.motions import DENSE_TASK, SPARSE_TASK, Motions, Task
from bench.glogen.sparse import settings_of
from bench.units import Found

SETS: Final = (sparse.SET, *FOLDED)


@dataclass(frozen=True)
class Unit:
    """One network with one candidate's settings on one set."""

    set_name: str
    method: str
    candidate: int
    epochs: int = 0
    seed: int = 0

    @property
    def settings(self) -> Settings:
        return settings_of(self.epochs, tried_on(self.set_name)[self.candidate])

    def __str__(self) -> str:
        return f"{self.set_name} {row_of(self)}"


def tried_on(set_name: str) -> list[Settings]:
    """The settings that networks have on a set."""
    return candidates(SPARSE_TRIED if set_name == sparse.SET else DENSE_TRIED)


def units(sets: list[str], methods: list[str], epochs: int) -> list[Unit]:
    """All that is tried on sets, of methods that a set is measured by."""
    return [
        Unit(name, method, i, epochs)
        for name in sets
        for method in NETWORKS
        if (name == sparse.SET or method in DENSE) and (not methods or method in methods)
        for i, settings in enumerate(tried_on(name))
        if not (settings.residual and method in RESIDUAL)
    ]


def row_of(unit: Unit) -> str:
    """What is tried, in words."""
    settings = unit.settings
    budget = f"{settings.budget.steps} steps" if settings.budget.steps else f"{settings.budget.epochs} epochs"
    return f"{unit.method}, {settings.hidden} units, {budget}{', steps from the last pose' * bool(settings.residual)}"


def measure(unit: Unit) -> dict[str, Found]:
    """{what is tried: mean per-joint error on what is held out}."""
    task, data = _asked(unit.set_name)
    (tried,) = choose(task, unit.method, data, [unit.settings], unit.seed)
    return {row_of(unit): {"joint_error": tried.error}}


def _asked(set_name: str) -> tuple[Task, Motions]:
    if set_name == sparse.SET:
        return SPARSE_TASK, sparse.training_motions()
    whole = material(set_name)
    return DENSE_TASK, dense.training_motions(whole.of(list(range(1, len(whole.clips)))))
