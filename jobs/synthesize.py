"""Job "synthesize": the motions of a request become clips of the lake."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

from motionlake.jobs.execute import StageJob
from motionlake.jobs.session import Session
from motionlake.lake.catalog import fetch, reading, run_sql, writing
from motionlake.lake.models import Model
from motionlake.stages import synthesize
from motionlake.stages.shard import Shard
from motionlake.stages.synthesis import check_classes, open_generator, served_generator
from motionlake.stages.synthesis_wishes import Request, Start, check_request, find_starts, make, motions_of

JOB = StageJob(synthesize.NAME, synthesize.run, synthesize.load)
TRIAL = 1.0  # seconds of a first motion, by which it shows whether there is anything to start from


@dataclass(frozen=True)
class Synthesis:
    """What a request came to.

    Attributes:
        model: the generator.
        clips: of the request, in the order of their numbers.
        made: how many were made now; the others were there already, or failed.
        there: how many were there.
        seconds: of motion, of all clips of the request that are in the lake.
        wall_seconds: that making them took.
    """

    model: str
    clips: list[str]
    made: int
    there: int
    seconds: float
    wall_seconds: float


def run(session: Session, request: Request, dataset: str, count: int) -> Synthesis:
    """Make motions 1 to `count` of a request, as clips of a dataset; those that are there are left as they are.

    Raises:
        UserError: there is no generator, it does not know a class, a number is no good, there is nothing to start from,
            or the dataset holds recorded clips.
    """
    started = time.perf_counter()
    lake, config = session.lake, session.config
    check_request(request)
    with reading(lake) as con:
        model = served_generator(con, lake, config)
        check_classes(model, request.classes)
        synthesize.check_own_dataset(con, dataset)
        starts = find_starts(con, lake, request)
        planned = synthesize.plan(con, lake, config, model, request, starts, dataset, count)
    if planned.shards:
        _try(session, model, request, starts)
    _forget_unfinished(session, planned.shards)
    # One shard alone is made in this process, which has the generator in memory already.
    outcome = session.execute(JOB, planned.shards, here=len(planned.shards) == 1 and session.scheduler is None)
    session.outcomes[synthesize.NAME] = outcome
    with reading(lake) as con:
        lengths = fetch(con, "seconds_of_clips", {"clips": planned.clips})
    return Synthesis(
        model.model,
        [row["clip"] for row in lengths],
        outcome.clips,
        planned.there,
        sum(row["seconds"] for row in lengths),
        time.perf_counter() - started,
    )


def _try(session: Session, model: Model, request: Request, starts: list[Start]) -> None:
    """Make the beginning of the first motion: what is wrong with every motion is said before any work is handed out."""
    short = replace(request, seconds=min(request.seconds, TRIAL))
    make(open_generator(session.lake, model), session.lake, short, starts, motions_of(request, starts, [1]))


def _forget_unfinished(session: Session, shards: list[Shard]) -> None:
    """Shards of another request that was cut short are not planned any more."""
    keys = [shard.key for shard in shards]
    with reading(session.lake) as con:
        left = fetch(con, "unfinished_of_stage", {"stage": synthesize.NAME})
    if any(row["key"] not in keys for row in left):
        with writing(session.lake) as con:
            run_sql(con, "forget_unfinished", {"stage": synthesize.NAME, "keys": keys})
