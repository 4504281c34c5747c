"""Bring stages up to date, take source folders in, and make motion to order."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from motionlake.errors import UserError
from motionlake.jobs.models import obtain
from motionlake.jobs.results import Outcome
from motionlake.jobs.session import Session
from motionlake.lake.catalog import fetch, reading, run_sql, writing
from motionlake.stages import ingest as sources
from motionlake.stages.frames import FRAMES
from motionlake.stages.labels import LabelReport
from motionlake.stages.registry import ALL, STAGES
from motionlake.stages.sources import Root
from motionlake.stages.stage import ShardStage, Stage, live_parts
from motionlake.stages.synthesis import Chosen
from motionlake.stages.synthesis_control import Request
from motionlake.stages.synthesize import SYNTHESIZE, planned, source_rows


@dataclass(frozen=True)
class IngestReport:
    """What taking in a set of roots came to.

    Attributes:
        unchanged: files that were as the lake knows them.
        gone: clips' paths, with their dataset, that have no file any more.
        labels: what the label files said, where they were entered, or why they were not.
        rejects: source files of these roots that stand rejected.
    """

    outcome: Outcome
    unchanged: int
    gone: list[str]
    labels: list[LabelReport]
    rejects: int

    @property
    def sound(self) -> bool:
        """No source file stands rejected, and every label file was read."""
        return not self.rejects and not any(label.fault for label in self.labels)


def run(
    session: Session,
    stages: Sequence[str] = ALL,
    *,
    refit: bool = False,
    retry_failed: bool = False,
    dataset: str | None = None,
) -> IngestReport | None:
    """Bring stages up to date; `refit` makes the models of those stages anew, `dataset` is for transitions."""
    report = None
    begun: dict[str, Begun] | None = None
    for name in stages:
        if name == FRAMES.name:
            report = ingest(session, retry_failed=retry_failed)
            continue
        if begun is None:
            begun = {} if refit or dataset else _run_alongside(session, [STAGES[other] for other in stages])
        known = begun.get(name)
        session.outcomes[name] = update(session, STAGES[name], refit=refit, dataset=dataset, begun=known)
    return report


@dataclass
class Begun:
    """What a stage did together with others: what came of it, and the keys of the shards that it tried."""

    outcome: Outcome
    tried: set[str]


def _run_alongside(session: Session, stages: Sequence[Stage]) -> dict[str, Begun]:
    """Run stages that need the frames alone together, so that each part is read once; by name, those that ran.

    A stage whose model cannot be trained is left for its own turn, which says so: those before it are done by then.
    """
    with session.reader() as at:
        due = [s for s in stages if isinstance(s, ShardStage) and s.alongside(at) and s.due(at)]
        if len(due) < 2 or not live_parts(at):
            return {}
    ready: list[ShardStage] = []
    for stage in due:
        with suppress(UserError):
            if stage.model is None or obtain(session, stage.model, stage=stage.name) is not None:
                ready.append(stage)
    with session.reader() as at:
        planned = [(stage, stage.plan(at)) for stage in ready]
        at_once = [stage.name for stage, shards in planned if shards and stage.at_once(at)]
    outcomes = session.execute_together(planned, at_once=at_once)
    return {stage.name: Begun(outcomes[stage.name], {shard.key for shard in shards}) for stage, shards in planned}


def update(
    session: Session,
    stage: Stage,
    *,
    refit: bool = False,
    dataset: str | None = None,
    begun: Begun | None = None,
) -> Outcome:
    """Bring one stage up to date, for one dataset or all; `begun` is what it did already.

    Raises:
        UserError: no such dataset.
    """
    outcome = begun.outcome if begun else Outcome()
    if dataset is not None:
        with reading(session.lake) as con:
            known = sorted({row["dataset"] for row in fetch(con, "frames_parts")})
        if dataset not in known:
            raise UserError(f"{dataset}: no such dataset in {session.lake.root}; it holds {', '.join(known) or 'none'}")
    if not begun and stage.model is not None and obtain(session, stage.model, stage=stage.name, refit=refit) is None:
        return outcome
    if not isinstance(stage, ShardStage):
        return outcome
    tried = begun.tried if begun else set[str]()
    while True:
        with session.reader() as at:
            lacking = stage.lacking(at)
            if lacking is not None:
                session.notice(f"{stage.name}: there is no {lacking} yet; `motionlake run all` makes every stage")
                return outcome
            planned = [s for s in stage.plan(at) if s.key not in tried and dataset in (None, s.dataset)]
            at_once = bool(planned) and stage.at_once(at)
        if not planned:
            return outcome
        # What a stage loads may make more of it due.
        tried |= {shard.key for shard in planned}
        outcome += session.execute(stage, planned, at_once=at_once)


def ingest(
    session: Session, roots: Sequence[Root] | None = None, *, checksum: bool = False, retry_failed: bool = False
) -> IngestReport:
    """Bring the lake up to date with source folders (default: all it knows)."""
    found, lines = sources.prepare(
        session.lake, session.config, roots, checksum=checksum, retry_failed=retry_failed,
        progress=lambda done, total: session.progress("hash", done, total),
    )  # fmt: skip
    for line in lines:
        session.notice(line)
    outcome = session.outcomes[FRAMES.name] = session.execute(FRAMES, [shard for one in found for shard in one.shards])
    labels, rejects = sources.finish(session.lake, found)
    for label in labels:
        if label.fault:
            session.notice(f"labels stay as they were: {label.fault}")
    gone = [f"{one.root.dataset}/{path}" for one in found for path in one.difference.gone]
    return IngestReport(outcome, sum(one.difference.unchanged for one in found), gone, labels, rejects)


@dataclass(frozen=True)
class Synthesis:
    """What a request came to.

    Attributes:
        generator: what made them, by which recipe, and why this one.
        clips: of the request, in the order of their numbers.
        made: how many were made now; the others were there already, or failed.
        there: how many were there.
        seconds: of motion, of all clips of the request that are in the lake.
        wall_seconds: that making them took.
        alike: of motions that were asked to differ, those that are nearer to one before them than recorded clips are.
        floor: how far recorded clips are from one another, body lengths; None where it was not asked.
    """

    generator: Chosen
    clips: list[str]
    made: int
    there: int
    seconds: float
    wall_seconds: float
    alike: list[str] = field(default_factory=list)
    floor: float | None = None


def synthesize(session: Session, request: Request, dataset: str, count: int) -> Synthesis:
    """Make motions 1 to `count` of a request, as clips of a dataset; those that are there are left as they are.

    Raises:
        UserError: as `planned`.
    """
    started = time.perf_counter()
    with session.reader() as at:
        plan = planned(at, request, dataset, count)
    session.notice(f"synthesize: {' and '.join(dict.fromkeys(request.classes))} {plan.generator.said}")
    # Shards of another request that was cut short are not planned any more.
    keys = [shard.key for shard in plan.shards]
    with reading(session.lake) as con:
        left = fetch(con, "unfinished_of_stage", {"stage": SYNTHESIZE.name})
    if any(row["key"] not in keys for row in left):
        with writing(session.lake) as con:
            run_sql(con, "forget_unfinished", {"stage": SYNTHESIZE.name, "keys": keys})
    # One shard alone is made in this process, which has the generator in memory already.
    outcome = session.execute(SYNTHESIZE, plan.shards, here=len(plan.shards) == 1 and session.scheduler is None)
    session.outcomes[SYNTHESIZE.name] = outcome
    with reading(session.lake) as con:
        lengths = fetch(con, "seconds_of_clips", {"clips": plan.clips})
    return Synthesis(
        plan.generator,
        [row["clip"] for row in lengths],
        outcome.clips,
        plan.there,
        sum(row["seconds"] for row in lengths),
        time.perf_counter() - started,
        plan.alike,
        plan.floor,
    )


def synthetic_sources(session: Session, request: Request, dataset: str, count: int) -> list[tuple[Any, ...]]:
    """Of motions 1 to `count` of a request, the recorded frames that they were made from (`source_rows`)."""
    with session.reader() as at:
        return source_rows(at, request, dataset, count)
