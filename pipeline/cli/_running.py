"""Commands that write: they hold the lake, show their progress, and what they did is recorded."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from motionlake.cli._output import notice
from motionlake.cli._progress import stage_progress
from motionlake.names import typed

if TYPE_CHECKING:
    from motionlake.jobs.session import Session
    from motionlake.lake.layout import Lake


@contextmanager
def running(
    lake: Lake,
    command: str,
    workers: int | None = None,
    scheduler: str | None = None,
    *,
    create: bool = False,
    damaged: bool = False,
) -> Iterator[Session]:
    """Hold the lake for a command that writes, with progress on stderr, and record a run that did something.

    `create` makes a lake where there is none; `damaged`: also where files of the lake are missing or damaged.
    """
    from motionlake.jobs.session import session

    with (
        stage_progress() as progress,
        session(lake, command, progress, notice, workers, scheduler, create=create, damaged=damaged) as job,
    ):
        yield job
        _record_run(job)


def _record_run(job: Session) -> None:
    from datetime import datetime

    from motionlake.lake.catalog import run_sql, writing

    for name, outcome in job.outcomes.items():
        if outcome.failed:
            notice(f"{name}: {outcome.failed} shards failed: {outcome.reason}; --retry-failed tries again")
    totals = {k: sum(getattr(o, k) for o in job.outcomes.values()) for k in ("ok", "failed", "rejected")}
    if any(totals.values()):
        words = typed(" ".join(sys.argv[1:]))
        with writing(job.lake) as con:
            run_sql(
                con, "add_run",
                {**totals, "command": words, "started": job.started, "finished": datetime.now()},
            )  # fmt: skip
