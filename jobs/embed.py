"""Job "embed": get a word network if the lake has none that fits, then embed every word."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from motionlake.arrays import Progress
from motionlake.deep_motifs.config import PRETRAINED_WORDS
from motionlake.jobs import modelling
from motionlake.jobs.execute import Outcome, StageJob
from motionlake.jobs.session import Session
from motionlake.lake.catalog import reading
from motionlake.lake.models import Model
from motionlake.stages import embed

JOB = StageJob(embed.NAME, embed.run, embed.load)
NETWORK = modelling.Network(
    kind=embed.NETWORK,
    stage=embed.NAME,
    title="word network",
    command="words",
    key=embed.network_key,
    settings=lambda config: {"words": asdict(config.words), "network": asdict(config.network)},
    takes_ready_made=lambda _con, config: PRETRAINED_WORDS.fits(config.words, config.network),
    ready_made=lambda: PRETRAINED_WORDS.file,
    take_weights=embed.take_weights,
)


def run(session: Session, *, refit: bool = False) -> Outcome:
    """Embed what is not embedded yet; `refit` trains a network on the lake first."""
    network = modelling.obtain(session, NETWORK, train, refit=refit)
    if network is None:
        return Outcome()
    with reading(session.lake) as con:
        shards = embed.plan(con, session.lake, session.config, network)
    return session.execute(JOB, shards)


def train(session: Session, *, fine_tune: bool = False) -> Model | None:
    """Train the network of the configuration on the lake's words and make it current; None without words.

    Args:
        session: of the lake.
        fine_tune: go on from the current network (else from the ready-made weights) where it fits.
    """
    lake, config = session.lake, session.config
    before = _start(session) if fine_tune else None
    with reading(lake) as con:
        features = embed.training_sample(con, lake, config)
    if not features:
        session.notice("embed: there are no words yet; `motionlake run all` makes every stage")
        return None

    def fit(file: str, progress: Progress) -> dict[str, Any]:
        figures = embed.train(lake, features, config, file, before.file if before else None, progress)
        return figures | ({"fine_tuned_from": before.model} if before else {})

    return modelling.train(session, NETWORK, fit)


def _start(session: Session) -> Model | None:
    with reading(session.lake) as con:
        before = embed.fitting_network(con, session.config)
    if before is None and PRETRAINED_WORDS.fits(session.config.words, session.config.network):
        return take(session, PRETRAINED_WORDS.file)
    return before


def take(session: Session, weights: Path) -> Model:
    """Make ready-made weights the lake's current network."""
    return modelling.take(session, NETWORK, weights)
