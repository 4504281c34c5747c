"""Getting a stage its model: the current one, else the pretrained one, else one trained on the lake."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from motionlake.jobs.session import Session
from motionlake.lake.catalog import reading, writing
from motionlake.lake.config import LakeConfig
from motionlake.lake.file_list import sums_of
from motionlake.lake.models import Model, add_model, current_model, next_file
from motionlake.stages.frames import content_key
from motionlake.stages.model_kind import ModelKind, Selection
from motionlake.stages.reader import lake_reader

Kind = ModelKind[Any]


def obtain(session: Session, kind: Kind, *, stage: str, refit: bool = False) -> Model | None:
    """The current model if it fits the configuration, else the pretrained one where the lake takes it, else one that is
    trained. `refit` trains in any case. None where there is nothing to train on."""
    with session.reader() as at:
        model = None if refit else kind.fitting(at)
        pretrained = model is None and not refit and kind.takes_pretrained(at)
    if not pretrained:
        return model or _trained(session, kind, stage)
    session.notice(
        f"{stage}: takes the pretrained {kind.title}; `motionlake train {kind.command}` trains one on this lake"
    )
    return take(session, kind)


def _trained(session: Session, kind: Kind, stage: str) -> Model | None:
    model = train(session, kind)
    if model is None:
        session.notice(f"{stage}: there are no {kind.lacks}")
    return model


def take(session: Session, kind: Kind, weights: Path | None = None) -> Model:
    """Make pretrained weights (default: those of the package) the lake's current model of a kind.

    Raises:
        ValueError: they do not fit the configuration.
    """
    file = weights or (kind.pretrained.file if kind.pretrained else None)
    assert file is not None, f"there is no pretrained {kind.title}"
    config = session.config
    return _make(
        session, kind, config, lambda name: {"data_sha256": ""} | dict(kind.take(session.lake, config, file, name))
    )


def train(
    session: Session,
    kind: Kind,
    where: Selection | None = None,
    *,
    config: LakeConfig | None = None,
) -> Model | None:
    """Train a model on the lake and make it current; None where there is nothing to train on.

    Args:
        session: of the lake.
        kind: of model.
        where: which clips; None: all.
        config: what to train for, where that is not what config.toml says; the model fits config.toml all the same.

    Raises:
        UserError: what was selected is not there, or is too little to train on.
    """
    where, config = where or Selection(), config or session.config
    if where.fine_tune:
        with session.reader() as at:
            fresh = kind.fitting(at) is None and kind.fits(session.config)
        if fresh:
            take(session, kind)
    with lake_reader(session.lake, config) as at:
        data = kind.data(at, where)
    if data is None:
        return None

    first: list[tuple[int, float]] = []

    def progress(step: int, steps: int, loss: float) -> None:
        session.progress("train", step, steps)
        first.append((step, time.monotonic()))
        said = "" if math.isnan(loss) else f", loss {loss:.4f}"
        session.notice(f"train: step {step} of {steps}{said}{_left(*first[0], step, steps)}")

    model = _make(session, kind, config, lambda file: kind.train(session.lake, config, data, file, progress))
    for line in kind.hints(config, model.metrics):
        session.notice(f"{kind.title}: {line}")
    return model


def _left(first: int, since: float, step: int, steps: int) -> str:
    """How long a training still takes, by the steps done since it was first heard of; nothing where none were."""
    if step in (first, steps):
        return ""
    seconds = (time.monotonic() - since) / (step - first) * (steps - step)
    unit, size = next((u, s) for u, s in (("h", 3600), ("min", 60), ("s", 1)) if seconds >= 1.5 * s or s == 1)
    return f", about {seconds / size:.0f} {unit} left"


def _make(session: Session, kind: Kind, config: LakeConfig, fit: Callable[[str], Mapping[str, Any]]) -> Model:
    """Have a model written as a file of the lake, and make it the current version of its kind."""
    started = time.perf_counter()
    with session.reader() as at:
        file = next_file(at.con, kind.name, kind.suffix)
        key, whole = kind.key(at), content_key(at.con)
    assert key is not None
    metrics = fit(file)
    with writing(session.lake) as con:
        add_model(
            con, kind.name, key=key, data_hash=metrics.get("data_sha256", whole), config=kind.settings(config),
            metrics=metrics, file=sums_of(session.lake, file), seconds=time.perf_counter() - started,
        )  # fmt: skip
    with reading(session.lake) as con:
        model = current_model(con, kind.name)
    assert model is not None
    return model
