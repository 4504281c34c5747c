"""Job "words": features and word ranges of every frames part that lacks them."""

from __future__ import annotations

from jobs.execute import Outcome, StageJob
from jobs.session import Session
from pipeline.lake.catalog import reading
from pipeline.stages import words

JOB = StageJob(words.NAME, words.run, words.load)


def run(session: Session) -> Outcome:
    with reading(session.lake) as con:
        shards = words.plan(con, session.config.words)
    return session.execute(JOB, shards)
