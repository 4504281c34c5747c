"""Job "embed": train the word network if the lake has none that fits, then embed every word."""

from __future__ import annotations

import time
from dataclasses import asdict

from jobs.execute import Outcome, StageJob, execute
from jobs.session import Session
from pipeline.lake.catalog import reading, writing
from pipeline.stages import embed, frames
from pipeline.stages.models import Model, add_model, next_file

JOB = StageJob(embed.NAME, embed.run, embed.load)


def run(session: Session, *, refit: bool = False) -> Outcome:
    with reading(session.lake) as con:
        network = None if refit else embed.fitting_network(con, session.config)
    network = network or _train(session)
    if network is None:
        return Outcome()
    with reading(session.lake) as con:
        shards = embed.plan(con, session.lake, session.config, network)
    return execute(session.lake, JOB, shards, session.client, session.progress) if shards else Outcome()


def _train(session: Session) -> Model | None:
    started = time.perf_counter()
    lake, config = session.lake, session.config
    with reading(lake) as con:
        features = embed.training_sample(con, lake, config)
        file = next_file(con, embed.NETWORK, ".safetensors")
        data_hash = frames.content_key(con)
    if not features:
        session.notice("embed: there are no words yet; `motionlake run all` makes every stage")
        return None
    figures = embed.train(
        lake, features, config, file, lambda step, steps, loss: session.progress("train", step, steps)
    )
    with writing(lake) as con:
        add_model(
            con, embed.NETWORK, key=embed.network_key(config), data_hash=data_hash,
            config={"words": asdict(config.words), "network": asdict(config.network)},
            figures=figures, file=file, seconds=time.perf_counter() - started,
        )  # fmt: skip
    with reading(lake) as con:
        return embed.fitting_network(con, config)
