"""The methods by name, for both tasks, and one method's predictions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array
from numpy.typing import NDArray

from bench.glogen.attention import AttentionSeq2Seq
from bench.glogen.baseline import Baseline, Network, Settings, Shape, Trained
from bench.glogen.hp_gan import HpGan
from bench.glogen.motions import DENSE_TASK, SPARSE_TASK, Motions, Pasts, Task
from bench.glogen.next_pose import AutoConditioned, ScheduledSampling
from bench.glogen.seq2seq import Seq2Seq
from bench.glogen.untrained import NearestReal, ZeroVelocity
from bench.glogen.variational import VaeSeq2Seq

DEFAULTS: Final = Settings()
NETWORKS: Final[Mapping[str, Callable[[Shape], Network]]] = MappingProxyType(
    {
        "seq2seq": Seq2Seq,
        "vae_seq2seq": VaeSeq2Seq,
        "attention_seq2seq": AttentionSeq2Seq,
        "aclstm": AutoConditioned,
        "scheduled_sampling": ScheduledSampling,
        "hp_gan": HpGan,
    }
)
# Put out steps from the last pose as published.
RESIDUAL: Final = ("seq2seq", "vae_seq2seq", "attention_seq2seq", "hp_gan")
_WIDE: Final = Settings(hidden=512)
_LONG: Final = replace(Settings(), budget=replace(Settings().budget, steps=1000))
_STEPS: Final = Settings(hidden=128, residual=True)
_NARROW: Final = Settings(hidden=128)
# Settings that the search chose (`python -m bench.glogen search`), by set and network; others have `DEFAULTS`.
CHOSEN: Final[Mapping[str, Mapping[str, Settings]]] = MappingProxyType(
    {
        "utd_mhad": {
            "seq2seq": _WIDE, "vae_seq2seq": _LONG, "attention_seq2seq": _WIDE, "aclstm": _LONG,
            "scheduled_sampling": _WIDE, "hp_gan": _LONG,
        },
        "indian": {"aclstm": _STEPS, "scheduled_sampling": _NARROW},
        "martial": {"aclstm": _STEPS},
        "walk": {"aclstm": _STEPS, "scheduled_sampling": _STEPS},
    }
)  # fmt: skip
UNTRAINED: Final[Mapping[str, Callable[[Task], Baseline]]] = MappingProxyType(
    {"zero_velocity": ZeroVelocity, "nearest_real": NearestReal}
)


def build(task: Task, name: str, settings: Settings = DEFAULTS) -> Baseline:
    """A method, not yet fitted; `UNTRAINED` ones look at no settings.

    Raises:
        KeyError: no such method.
    """
    return UNTRAINED[name](task) if name in UNTRAINED else Trained(NETWORKS[name], task, settings)


SPARSE: Final[Mapping[str, Callable[..., Baseline]]] = MappingProxyType(
    {name: partial(build, SPARSE_TASK, name) for name in (*NETWORKS, *UNTRAINED)}
)
"""Methods of the sparse task: `SPARSE[name](settings)`."""
DENSE: Final[Mapping[str, Callable[..., Baseline]]] = MappingProxyType(
    {name: partial(build, DENSE_TASK, name) for name in ("seq2seq", "aclstm", "scheduled_sampling", *UNTRAINED)}
)
"""Methods of the dense task: `DENSE[name](settings)`."""


def measure_sparse(
    train: Motions,
    test: Motions,
    method: str,
    seed: int,
    settings: Settings = DEFAULTS,
    rng: np.random.Generator | None = None,
) -> Float32Array:
    """[m, 15, D] that a method of `SPARSE`, fitted on `train`, predicts after the first 5 poses of `test` [m, 20, D].

    Args:
        train, test: motions at 20 sparse poses.
        method: its name.
        seed: of its training.
        settings: of its training.
        rng: to have samples instead of best guesses.
    """
    seeds = [motion[: SPARSE_TASK.past] for motion in test.poses]
    return fitted(SPARSE[method](settings), train, seed).predict(seeds, test.classes, rng)


def measure_dense(
    train: Motions,
    pasts: Pasts,
    classes: NDArray[np.int64],
    method: str,
    seed: int,
    settings: Settings = DEFAULTS,
) -> Float32Array:
    """[m, 20, D] frames at 30 fps that a method of `DENSE`, fitted on `train`, predicts after pasts [m, p, D]."""
    return fitted(DENSE[method](settings), train, seed).predict(pasts, classes)


def fitted(method: Baseline, train: Motions, seed: int) -> Baseline:
    """The method itself, fitted."""
    method.fit(train, seed)
    return method
