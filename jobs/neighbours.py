"""Job "neighbours": index the words if the lake has no fitting index, then search it for every word."""

from __future__ import annotations

from dataclasses import asdict

from motionlake.jobs.execute import Outcome, StageJob
from motionlake.jobs.modelling import make
from motionlake.jobs.session import Session
from motionlake.lake.catalog import reading
from motionlake.lake.models import Model
from motionlake.stages import neighbours

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
