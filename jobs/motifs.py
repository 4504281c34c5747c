"""Job "motifs": cluster the embedded words if the lake has no fitting motifs, then assign every word."""

from __future__ import annotations

import time
from dataclasses import asdict

from jobs.execute import Outcome, StageJob, execute
from jobs.session import Session
from pipeline.lake.catalog import reading, writing
from pipeline.stages import embed, frames, motifs
from pipeline.stages.models import Model, add_model, next_file

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
    return execute(session.lake, JOB, shards, session.client, session.progress) if shards else Outcome()


def _fit(session: Session, network: Model) -> Model:
    started = time.perf_counter()
    lake, config = session.lake, session.config
    with reading(lake) as con:
        file = next_file(con, motifs.MOTIFS, ".parquet")
        figures = motifs.fit(con, lake, config, network, file)
        data_hash = frames.content_key(con)
    with writing(lake) as con:
        add_model(
            con, motifs.MOTIFS, key=motifs.motifs_key(config, network), data_hash=data_hash,
            config=asdict(config.motifs), figures=figures, file=file, seconds=time.perf_counter() - started,
        )  # fmt: skip
    with reading(lake) as con:
        model = motifs.fitting_motifs(con, config, network)
    assert model is not None
    return model
