"""Job "neighbours": index the words if the lake has no fitting index, then search it for every word."""

from __future__ import annotations

import time
from dataclasses import asdict

from jobs.execute import Outcome, StageJob, execute
from jobs.session import Session
from pipeline.lake.catalog import reading, writing
from pipeline.stages import frames, neighbours
from pipeline.stages.models import Model, add_model, next_file

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
    return execute(session.lake, JOB, shards, session.client, session.progress) if shards else Outcome()


def _fit(session: Session) -> Model:
    started = time.perf_counter()
    lake, config = session.lake, session.config
    with reading(lake) as con:
        file = next_file(con, neighbours.INDEX, ".safetensors")
        figures = neighbours.fit(con, lake, config, file)
        data_hash = frames.content_key(con)
    with writing(lake) as con:
        add_model(
            con, neighbours.INDEX, key=neighbours.index_key(config), data_hash=data_hash,
            config={"words": asdict(config.words)}, figures=figures, file=file,
            seconds=time.perf_counter() - started,
        )  # fmt: skip
    with reading(lake) as con:
        index = neighbours.fitting_index(con, config)
    assert index is not None
    return index
