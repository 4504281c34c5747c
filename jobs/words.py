"""Job "words": features and word ranges of every frames part that lacks them."""

from __future__ import annotations

from motionlake.jobs.execute import Outcome, StageJob
from motionlake.jobs.session import Session
from motionlake.lake.catalog import reading
from motionlake.stages import words

JOB = StageJob(words.NAME, words.run, words.load)


def run(session: Session) -> Outcome:
    with reading(session.lake) as con:
        shards = words.plan(con, session.config.words)
    return session.execute(JOB, shards)
