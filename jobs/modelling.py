"""What the jobs that fit models share: get a stage its model, and make what was fitted the current version."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from motionlake.arrays import Progress
from motionlake.jobs.session import Session
from motionlake.lake.catalog import Connection, reading, writing
from motionlake.lake.config import LakeConfig
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model, add_model, current_model, fitting_model, next_file
from motionlake.stages import frames


@dataclass(frozen=True)
class Network:
    """One kind of model that a lake takes ready-made or trains.

    Attributes:
        kind: as `models` calls it.
        stage: that needs it.
        title: for people.
        command: of `motionlake train`.
        key: of a configuration; a model fits those that have its key.
        settings: what `models` keeps of a configuration.
        takes_ready_made: whether a lake without a fitting model starts with the ready-made one.
        ready_made: its file.
        take_weights: copies a ready-made file into the lake under a name; returns the figures of its training.
    """

    kind: str
    stage: str
    title: str
    command: str
    key: Callable[[LakeConfig], str]
    settings: Callable[[LakeConfig], Mapping[str, Any]]
    takes_ready_made: Callable[[Connection, LakeConfig], bool]
    ready_made: Callable[[], Path]
    take_weights: Callable[[Lake, LakeConfig, Path, str], dict[str, Any]]


def obtain(
    session: Session, network: Network, train: Callable[[Session], Model | None], *, refit: bool = False
) -> Model | None:
    """The model of a stage: the current one if it fits, else the ready-made one, else one trained by `train`.

    `refit` trains in any case. None where there is nothing to train on.
    """
    with reading(session.lake) as con:
        model = None if refit else fitting_model(con, network.kind, network.key(session.config))
        ready_made = model is None and not refit and network.takes_ready_made(con, session.config)
    if ready_made:
        session.notice(
            f"{network.stage}: takes the ready-made {network.title}; `motionlake train {network.command}` "
            "trains one on this lake"
        )
        return take(session, network, network.ready_made())
    return model or train(session)


def take(session: Session, network: Network, weights: Path) -> Model:
    """Make ready-made weights the lake's current ones."""
    config = session.config

    def fit(file: str) -> dict[str, Any]:
        return {"data_sha256": ""} | network.take_weights(session.lake, config, weights, file)

    return make(session, network.kind, network.key(config), network.settings(config), fit)


def train(
    session: Session,
    network: Network,
    fit: Callable[[str, Progress], Mapping[str, Any]],
    settings: Mapping[str, Any] | None = None,
) -> Model:
    """Train a model and make it current.

    Args:
        session: of the lake.
        network: its kind.
        fit: trains, saves as the given file and returns the figures; the second argument reports progress.
        settings: what it is trained for, where that is not what config.toml says.
    """

    def progress(step: int, steps: int, loss: float) -> None:
        session.progress("train", step, steps)
        session.notice(f"train: step {step} of {steps}, loss {loss:.4f}")

    kept = network.settings(session.config) if settings is None else settings
    return make(session, network.kind, network.key(session.config), kept, lambda file: fit(file, progress))


def make(
    session: Session,
    kind: str,
    key: str,
    settings: Mapping[str, Any],
    fit: Callable[[str], Mapping[str, Any]],
    suffix: str = ".safetensors",
) -> Model:
    """Fit a model and make it the current version of its kind.

    Args:
        session: of the lake.
        kind: of model.
        key: of the configuration it fits.
        settings: what `models` keeps of the configuration.
        fit: fits, saves as the given file and returns the figures; `data_sha256` among them says what it was fitted
            to, by default the whole lake.
        suffix: of the file.
    """
    started = time.perf_counter()
    lake = session.lake
    with reading(lake) as con:
        file = next_file(con, kind, suffix)
        whole = frames.content_key(con)
    figures = fit(file)
    with writing(lake) as con:
        add_model(
            con, kind, key=key, data_hash=figures.get("data_sha256", whole), config=settings, figures=figures,
            file=file, seconds=time.perf_counter() - started,
        )  # fmt: skip
    with reading(lake) as con:
        model = current_model(con, kind)
    assert model is not None
    return model
