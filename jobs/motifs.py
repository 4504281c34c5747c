"""Job "motifs": cluster the embedded words if the lake has no fitting motifs, then assign every word."""

from __future__ import annotations

from dataclasses import asdict

from motionlake.jobs.execute import Outcome, StageJob
from motionlake.jobs.modelling import make
from motionlake.jobs.session import Session
from motionlake.lake.catalog import reading
from motionlake.lake.models import Model
from motionlake.stages import embed, motifs

JOB = StageJob(motifs.NAME, motifs.run, motifs.load)


def run(session: Session, *, refit: bool = False) -> Outcome:
    with reading(session.lake) as con:
        network = embed.fitting_network(con, session.config)
        fitted = motifs.fitting_motifs(con, session.config, network) if network and not refit else None
    if network is None:
        session.notice("motifs: there are no embeddings yet; `motionlake run all` makes every stage")
        return Outcome()
    model = fitted or _fit(session, network)
    with reading(session.lake) as con:
        shards = motifs.plan(con, session.lake, session.config, network, model)
    return session.execute(JOB, shards)


def _fit(session: Session, network: Model) -> Model:
    lake, config = session.lake, session.config

    def fit(file: str) -> dict[str, float]:
        with reading(lake) as con:
            return motifs.fit(con, lake, config, network, file)

    key = motifs.motifs_key(config, network)
    return make(session, motifs.MOTIFS, key, asdict(config.motifs), fit, suffix=".parquet")
