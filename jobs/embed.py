"""Job "embed": get a word network if the lake has none that fits, then embed every word."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from jobs.execute import Outcome, StageJob, execute
from jobs.session import Session
from pipeline.lake.catalog import reading, writing
from pipeline.stages import embed, frames
from pipeline.stages.models import Model, add_model, next_file
from pipeline.words import shipped

JOB = StageJob(embed.NAME, embed.run, embed.load)


def run(session: Session, *, refit: bool = False) -> Outcome:
    """Embed what is not embedded yet; `refit` trains a network on the lake first."""
    with reading(session.lake) as con:
        network = None if refit else embed.fitting_network(con, session.config)
    if network is None and not refit and shipped.fits(session.config.words, session.config.network):
        session.notice("embed: takes the ready-made word network; `motionlake train words` trains one on this lake")
        network = take(session, shipped.FILE)
    network = network or train(session)
    if network is None:
        return Outcome()
    with reading(session.lake) as con:
        shards = embed.plan(con, session.lake, session.config, network)
    return execute(session.lake, JOB, shards, session.client, session.progress) if shards else Outcome()


def train(session: Session, *, fine_tune: bool = False) -> Model | None:
    """Train the network of the configuration on the lake's words and make it current; None without words.

    Args:
        session: of the lake.
        fine_tune: go on from the current network (else from the ready-made weights) where it fits.
    """
    started = time.perf_counter()
    lake, config = session.lake, session.config
    with reading(lake) as con:
        before = embed.fitting_network(con, config) if fine_tune else None
    if fine_tune and before is None and shipped.fits(config.words, config.network):
        before = take(session, shipped.FILE)
    with reading(lake) as con:
        features = embed.training_sample(con, lake, config)
        file = next_file(con, embed.NETWORK, ".safetensors")
        data_hash = frames.content_key(con)
    if not features:
        session.notice("embed: there are no words yet; `motionlake run all` makes every stage")
        return None

    def progress(step: int, steps: int, loss: float) -> None:
        session.progress("train", step, steps)
        session.notice(f"train: step {step} of {steps}, loss {loss:.4f}")

    figures = embed.train(lake, features, config, file, before.file if before else None, progress)
    if before:
        figures["fine_tuned_from"] = before.model
    return _enter(session, file, data_hash, figures, time.perf_counter() - started)


def take(session: Session, weights: Path) -> Model | None:
    """Make ready-made weights the lake's current network."""
    with reading(session.lake) as con:
        file = next_file(con, embed.NETWORK, ".safetensors")
    figures = embed.take_weights(session.lake, session.config, weights, file)
    data_hash = figures.pop("data_sha256", "")
    return _enter(session, file, data_hash, figures, 0.0)


def _enter(session: Session, file: str, data_hash: str, figures: Mapping[str, Any], seconds: float) -> Model | None:
    config = session.config
    with writing(session.lake) as con:
        add_model(
            con, embed.NETWORK, key=embed.network_key(config), data_hash=data_hash,
            config={"words": asdict(config.words), "network": asdict(config.network)},
            figures=figures, file=file, seconds=seconds,
        )  # fmt: skip
    with reading(session.lake) as con:
        return embed.fitting_network(con, config)
