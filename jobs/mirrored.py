"""Job "mirrored": mirrored signatures of every part whose signatures are served."""

from __future__ import annotations

from motionlake.jobs.execute import Outcome, StageJob
from motionlake.jobs.session import Session
from motionlake.lake.catalog import reading
from motionlake.stages import embed, mirrored, motifs

JOB = StageJob(mirrored.NAME, mirrored.run, mirrored.load)


def run(session: Session) -> Outcome:
    with reading(session.lake) as con:
        network = embed.fitting_network(con, session.config)
        model = motifs.fitting_motifs(con, session.config, network) if network else None
        if network is None or model is None:
            session.notice("mirrored: there are no motifs yet; `motionlake run all` makes every stage")
            return Outcome()
        shards = mirrored.plan(con, session.lake, session.config, network, model)
    return session.execute(JOB, shards)
