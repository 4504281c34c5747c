"""Job "neighbours": index the words if the lake has no fitting index, then search it for every word."""

from __future__ import annotations

from dataclasses import asdict

from jobs.execute import Outcome, StageJob
from jobs.modelling import make
from jobs.session import Session
from pipeline.lake.catalog import reading
from pipeline.stages import neighbours
from pipeline.stages.models import Model

JOB = StageJob(neighbours.NAME, neighbours.run, neighbours.load)


def run(session: Session, *, refit: bool = False) -> Outcome:
    with reading(session.lake) as con:
        missing = neighbours.missing_words(con, session.config)
        fitted = None if refit else neighbours.fitting_index(con, session.config)
    if missing:
        session.notice(f"neighbours: {missing} parts have no words yet; `motionlake run words` makes them")
        return Outcome()
    index = fitted or _fit(session)
    with reading(session.lake) as con:
        shards = neighbours.plan(con, session.config, index)
    return session.execute(JOB, shards)


def _fit(session: Session) -> Model:
    lake, config = session.lake, session.config

    def fit(file: str) -> dict[str, object]:
        with reading(lake) as con:
            return neighbours.fit(con, lake, config, file)

    return make(session, neighbours.INDEX, neighbours.index_key(config), {"words": asdict(config.words)}, fit)
