"""Job "submotions": get a second network if the lake has none that fits, then read the windows of every clip."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from motionlake.arrays import Progress
from motionlake.deephums.config import PRETRAINED_SUBMOTION
from motionlake.jobs import modelling
from motionlake.jobs.execute import Outcome, StageJob
from motionlake.jobs.session import Session
from motionlake.lake.catalog import reading
from motionlake.lake.models import Model
from motionlake.stages import submotions

NETWORK = modelling.Network(
    kind=submotions.NETWORK,
    stage=submotions.NAME,
    title="sub-motion network",
    command="submotion",
    key=submotions.network_key,
    settings=lambda config: asdict(config.submotion),
    takes_ready_made=submotions.takes_ready_made,
    ready_made=lambda: PRETRAINED_SUBMOTION.file,
    take_weights=submotions.take_weights,
)


def run(session: Session, *, refit: bool = False) -> Outcome:
    """Read what is not read yet; `refit` trains a network on the lake first."""
    network = modelling.obtain(session, NETWORK, train, refit=refit)
    if network is None:
        return Outcome()
    with reading(session.lake) as con:
        shards = submotions.plan(con, session.lake, network)
        served = submotions.served_network(con)
    # The windows of a new network enter together: the old ones serve until all are there.
    replaces = served is not None and served.model != network.model
    job = StageJob(submotions.NAME, submotions.run, submotions.load, one_load=replaces)
    return session.execute(job, shards)


def train(session: Session, split: str | None = None, dataset: str | None = None) -> Model | None:
    """Train a network on clips of the lake, those of a split or of a dataset, and make it current; None without clips.

    Raises:
        UserError: there are no such clips, or recipe "deephums" has no descriptors to go by.
    """
    from motionlake.stages import submotion_training

    lake, config = session.lake, session.config.submotion
    with reading(lake) as con:
        material = submotion_training.submotion_set(con, lake, config, split, dataset)
        if material is None:
            session.notice("submotions: there are no frames yet; `motionlake ingest` takes clips in")
            return None
        first = submotion_training.first_network(con, lake, config)

    def fit(file: str, progress: Progress) -> dict[str, Any]:
        return submotion_training.train(lake, material, config, first, file, progress)

    return modelling.train(session, NETWORK, fit)
