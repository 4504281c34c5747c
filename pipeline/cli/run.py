"""motionlake run."""

from __future__ import annotations

from typing import Annotated

import typer
from motionlake.cli.closing import close_run
from motionlake.cli.common import (
    JsonOption,
    LakeOption,
    SchedulerOption,
    WorkersOption,
    notice,
    stage_progress,
    tell,
)
from motionlake.errors import UserError
from motionlake.jobs.run import run as run_stages
from motionlake.jobs.session import session
from motionlake.lake.config import load_config
from motionlake.lake.layout import Lake, open_lake
from motionlake.stages.dry_run import dry_run
from motionlake.stages.reader import lake_reader
from motionlake.stages.registry import ALL, BY_NAME
from motionlake.stages.sources import known_roots


def run(
    lake: LakeOption,
    stage: Annotated[str, typer.Argument(help=f"all, or one of {', '.join(ALL + BY_NAME)}.")] = "all",
    refit: Annotated[bool, typer.Option("--refit", help="Fit the models of the stage anew.")] = False,
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Take up what failed before.")] = False,
    dataset: Annotated[str | None, typer.Option(help="Transitions of this dataset only.", show_default=False)] = None,
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    as_json: JsonOption = False,
) -> None:
    """Bring a lake up to date: only what is missing is computed.

    Example: motionlake run all --lake mylake

    Fit motifs to all that is in the lake now: motionlake run motifs --refit --lake mylake

    Transitions for motion graphs, which "all" leaves out: motionlake run transitions --dataset dances --lake mylake

    A generator of new motion: motionlake run synth --lake mylake
    """
    if stage != "all" and stage not in ALL + BY_NAME:
        raise UserError(f"{stage}: no such stage; use all, or one of {', '.join(ALL + BY_NAME)}")
    if dataset is not None and stage != "transitions":
        raise UserError(f"--dataset {dataset}: only transitions are made for one dataset; leave it out")
    target = open_lake(lake)
    stages = ALL if stage == "all" else (stage,)
    _announce(target, stages, refit)
    with stage_progress() as progress, session(target, f"run {stage}", progress, notice, workers, scheduler) as job:
        report = run_stages(job, stages, refit=refit, retry_failed=retry_failed, dataset=dataset)
        close_run(job)
    rows = [
        {"stage": name, "shards": o.ok, "failed": o.failed, "rows": o.rows, "bytes": o.bytes}
        for name, o in job.outcomes.items()
    ]
    tell(rows, as_json=as_json)
    if any(o.failed for o in job.outcomes.values()) or (report and report.rejects):
        raise typer.Exit(1)


def _announce(lake: Lake, stages: tuple[str, ...], refit: bool) -> None:
    with lake_reader(lake, load_config(lake.config_file)) as at:
        if not known_roots(at.con):
            notice(f"{lake.root}: holds no clips yet; take some in with `motionlake ingest FOLDER --lake {lake.root}`")
            return
        for line in dry_run(at, stages, refit=refit):
            notice(line)
