"""Job "postures": get a posture dictionary if the lake has none that fits, then code every frame."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from motionlake.arrays import Progress
from motionlake.jobs import modelling
from motionlake.jobs.execute import Outcome, StageJob
from motionlake.jobs.session import Session
from motionlake.lake.catalog import reading
from motionlake.lake.models import Model
from motionlake.pesta.config import PRETRAINED_POSTURES
from motionlake.stages import postures

JOB = StageJob(postures.NAME, postures.run, postures.load)
DICTIONARY = modelling.Network(
    kind=postures.DICTIONARY,
    stage=postures.NAME,
    title="dictionary",
    command="postures",
    key=postures.dictionary_key,
    settings=lambda config: asdict(config.postures),
    takes_ready_made=postures.takes_ready_made,
    ready_made=lambda: PRETRAINED_POSTURES.file,
    take_weights=postures.take_weights,
)


def run(session: Session, *, refit: bool = False) -> Outcome:
    """Code what is not coded yet; `refit` trains a dictionary on the lake first."""
    dictionary = modelling.obtain(session, DICTIONARY, train, refit=refit)
    if dictionary is None:
        return Outcome()
    with reading(session.lake) as con:
        shards = postures.plan(con, session.lake, dictionary)
    return session.execute(JOB, shards)


def train(session: Session) -> Model | None:
    """Train the dictionary of the configuration on the lake's postures and make it current; None without clips."""
    lake, config = session.lake, session.config
    with reading(lake) as con:
        features = postures.training_sample(con, lake, config)
    if not features:
        session.notice("postures: there are no frames yet; `motionlake ingest` takes clips in")
        return None

    def fit(file: str, progress: Progress) -> dict[str, Any]:
        return postures.train(lake, features, config, file, progress)

    dictionary = modelling.train(session, DICTIONARY, fit)
    occupied, m = dictionary.figures["occupied"], config.postures.m
    if 2 * occupied < m:
        session.notice(
            f"postures: only {occupied} of {m} symbols are used; a smaller m, or another seed, may serve better"
        )
    return dictionary
