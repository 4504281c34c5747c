"""Job "postures": get a posture dictionary if the lake has none that fits, then code every frame."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from jobs.execute import Outcome, StageJob, execute
from jobs.session import Session
from pipeline.lake.catalog import reading, writing
from pipeline.postures import shipped
from pipeline.stages import frames, postures
from pipeline.stages.models import Model, add_model, next_file

JOB = StageJob(postures.NAME, postures.run, postures.load)


def run(session: Session, *, refit: bool = False) -> Outcome:
    """Code what is not coded yet; `refit` trains a dictionary on the lake first."""
    with reading(session.lake) as con:
        dictionary = None if refit else postures.fitting_dictionary(con, session.config)
        ready_made = dictionary is None and not refit and postures.takes_ready_made(con, session.config)
    if ready_made:
        session.notice("postures: takes the ready-made dictionary; `motionlake train postures` trains one on this lake")
        dictionary = take(session, shipped.FILE)
    dictionary = dictionary or train(session)
    if dictionary is None:
        return Outcome()
    with reading(session.lake) as con:
        shards = postures.plan(con, session.lake, dictionary)
    return execute(session.lake, JOB, shards, session.client, session.progress) if shards else Outcome()


def train(session: Session) -> Model | None:
    """Train the dictionary of the configuration on the lake's postures and make it current; None without clips."""
    started = time.perf_counter()
    lake, config = session.lake, session.config
    with reading(lake) as con:
        features = postures.training_sample(con, lake, config)
        file = next_file(con, postures.DICTIONARY, ".safetensors")
        data_hash = frames.content_key(con)
    if not features:
        session.notice("postures: there are no frames yet; `motionlake ingest` takes clips in")
        return None

    def progress(step: int, steps: int, loss: float) -> None:
        session.progress("train", step, steps)
        session.notice(f"train: step {step} of {steps}, loss {loss:.4f}")

    figures = postures.train(lake, features, config, file, progress)
    occupied, m = figures["occupied"], config.postures.m
    if 2 * occupied < m:
        session.notice(
            f"postures: only {occupied} of {m} symbols are used; a smaller m, or another seed, may serve better"
        )
    return _enter(session, file, data_hash, figures, time.perf_counter() - started)


def take(session: Session, weights: Path) -> Model | None:
    """Make a ready-made dictionary the lake's current one."""
    with reading(session.lake) as con:
        file = next_file(con, postures.DICTIONARY, ".safetensors")
    figures = postures.take_weights(session.lake, weights, file)
    return _enter(session, file, figures.pop("data_sha256", ""), figures, 0.0)


def _enter(session: Session, file: str, data_hash: str, figures: Mapping[str, Any], seconds: float) -> Model | None:
    config = session.config
    with writing(session.lake) as con:
        add_model(
            con, postures.DICTIONARY, key=postures.dictionary_key(config), data_hash=data_hash,
            config=asdict(config.postures), figures=figures, file=file, seconds=seconds,
        )  # fmt: skip
    with reading(session.lake) as con:
        return postures.fitting_dictionary(con, config)
