"""Job "descriptors": get a descriptor network if the lake has none that fits, then describe every clip."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

from motionlake.arrays import Progress
from motionlake.deephums.config import PRETRAINED_DESCRIPTORS
from motionlake.jobs import modelling
from motionlake.jobs.execute import Outcome, StageJob
from motionlake.jobs.session import Session
from motionlake.lake.catalog import reading
from motionlake.lake.models import Model
from motionlake.stages import descriptors

NETWORK = modelling.Network(
    kind=descriptors.NETWORK,
    stage=descriptors.NAME,
    title="descriptor network",
    command="descriptor",
    key=descriptors.network_key,
    settings=lambda config: asdict(config.descriptors),
    takes_ready_made=descriptors.takes_ready_made,
    ready_made=lambda: PRETRAINED_DESCRIPTORS.file,
    take_weights=descriptors.take_weights,
)


def run(session: Session, *, refit: bool = False) -> Outcome:
    """Describe what is not described yet; `refit` trains a network on the lake first."""
    network = modelling.obtain(session, NETWORK, train, refit=refit)
    if network is None:
        return Outcome()
    with reading(session.lake) as con:
        shards = descriptors.plan(con, session.lake, network)
        served = descriptors.served_network(con)
    # The descriptors of a new network enter together: the old ones serve until all are there.
    replaces = served is not None and served.model != network.model
    job = StageJob(descriptors.NAME, descriptors.run, descriptors.load, one_load=replaces)
    return session.execute(job, shards)


def train(
    session: Session, split: str | None = None, dataset: str | None = None, supervision: str | None = None
) -> Model | None:
    """Train a network on clips of the lake and make it current; None without clips.

    Args:
        session: of the lake.
        split: train on the clips of this split; None: on every clip.
        dataset: on those of this dataset; None: of all.
        supervision: "labels", "none" or "auto"; None: as config.toml says.

    Raises:
        UserError: there are no such clips, or they lack the labels asked for.
    """
    from motionlake.stages import descriptor_training

    lake, config = session.lake, session.config.descriptors
    config = config if supervision is None else replace(config, supervision=supervision)
    with reading(lake) as con:
        material = descriptor_training.training_set(con, lake, config, split, dataset)
    if material is None:
        session.notice("descriptors: there are no frames yet; `motionlake ingest` takes clips in")
        return None

    def fit(file: str, progress: Progress) -> dict[str, Any]:
        return descriptor_training.train(lake, material, config, file, progress)

    return modelling.train(session, NETWORK, fit, asdict(config))
