"""The closing lines of commands that write."""

from __future__ import annotations

import sys
from datetime import datetime

from motionlake.cli.common import notice
from motionlake.jobs.session import Session
from motionlake.lake.catalog import fetch, reading, run_sql, writing
from motionlake.lake.layout import Lake

SHOWN = 5


def close_run(job: Session) -> None:
    """Record a run that did something."""
    outcomes = job.outcomes.values()
    totals = {
        "ok": sum(o.ok for o in outcomes),
        "failed": sum(o.failed for o in outcomes),
        "rejected": sum(o.rejected for o in outcomes),
    }
    for name, outcome in job.outcomes.items():
        if outcome.failed:
            notice(f"{name}: {outcome.failed} shards failed: {outcome.reason}; --retry-failed tries again")
    if any(totals.values()):
        with writing(job.lake) as con:
            run_sql(
                con, "add_run",
                {**totals, "command": " ".join(sys.argv[1:]), "started": job.started, "finished": datetime.now()},
            )  # fmt: skip


def say_rejects(lake: Lake, datasets: list[str]) -> None:
    """Name the first rejected files and where the rest are listed."""
    with reading(lake) as con:
        rows = [{**r, "dataset": d} for d in datasets for r in fetch(con, "rejects_of", {"dataset": d})]
    for row in rows[:SHOWN]:
        line = f", line {row['line']}" if row["line"] else ""
        notice(f"rejected {row['dataset']}/{row['path']}{line}: {row['reason']}")
    if len(rows) > SHOWN:
        notice(f"… and {len(rows) - SHOWN} more: motionlake sql 'FROM rejects' --lake {lake.root}")
