"""Job "symbols": serve the strings of clips, and the dictionary they are over, in one transaction."""

from __future__ import annotations

from motionlake.jobs.execute import Outcome, StageJob
from motionlake.jobs.session import Session
from motionlake.lake.catalog import reading
from motionlake.stages import postures, symbols

JOB = StageJob(symbols.NAME, symbols.run, symbols.load, one_load=True)


def run(session: Session) -> Outcome:
    with reading(session.lake) as con:
        dictionary = postures.fitting_dictionary(con, session.config)
        if dictionary is None:
            session.notice("symbols: there are no coded postures yet; `motionlake run all` makes every stage")
            return Outcome()
        shards = symbols.plan(con, session.lake, session.config, dictionary)
    return session.execute(JOB, shards)
