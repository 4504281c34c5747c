"""motionlake init, migrate and status: a lake itself, and what it holds."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from motionlake.cli._output import notice, tell
from motionlake.cli._progress import stage_progress
from motionlake.cli.common import JsonOption, LakeOption, argument, lake_folder_of, option
from motionlake.errors import UserError
from motionlake.lake import layout
from motionlake.lake.catalog import SCHEMA_VERSION, check_no_lake, create_catalog, fetch, has_macros
from motionlake.lake.config import default_toml, load_config
from motionlake.lake.integrity import faults_of_now
from motionlake.lake.lock import locked
from motionlake.lake.parts import replacing
from motionlake.stopping import held

# For commands on a lake alone, which name its folder as the argument or as elsewhere.
FolderArgument = Annotated[Path | None, argument("Folder of the lake.", readable=False)]
FolderOption = Annotated[
    Path | None,
    option("--lake", "-l", envvar="MOTIONLAKE_LAKE", help="The same, as elsewhere.", readable=False),
]
# What a table for people calls the columns of the JSON.
COLUMNS: Final = {"shards": "batches done", "due": "batches to do"}


def init(
    context: typer.Context, folder: FolderArgument = None, lake: FolderOption = None, as_json: JsonOption = False
) -> None:
    """Create an empty lake, the folder that holds clips and all that is computed of them.

    Example: motionlake init mylake
    """
    chosen = _named_folder(context, folder, lake)
    target = layout.Lake(chosen.absolute())
    check_no_lake(target)
    with locked(target, "init"), held():
        check_no_lake(target)
        if not target.config_file.exists():
            with replacing(target.config_file) as temporary:
                temporary.write_text(default_toml(), encoding="utf-8")
        create_catalog(target)
    notice(f"an empty lake in {chosen}; next: motionlake ingest FOLDER --lake {chosen}")
    if as_json:
        tell({"lake": str(target.root)}, as_json=True)


def migrate(
    context: typer.Context,
    folder: FolderArgument = None,
    lake: FolderOption = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would be done, and change nothing.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Bring a lake that an earlier motionlake wrote up to date; clips and all made of them stay.

    Example: motionlake migrate mylake --dry-run

    Example: motionlake migrate mylake
    """
    from motionlake.lake import migrations

    target = layout.open_lake(_named_folder(context, folder, lake))
    if dry_run:
        steps = migrations.plan(target)
    else:
        with stage_progress() as progress:
            steps = migrations.migrate(target, progress)
    if as_json:
        rows = [step.as_row() for step in steps]
        tell({"lake": str(target.root), "version": SCHEMA_VERSION, "steps": rows}, as_json=True)
        return
    if not steps:
        notice(f"{target.root}: is of version {SCHEMA_VERSION} already; nothing to do")
    for step in steps:
        verb = "would be rewritten" if dry_run else "rewritten"
        print(f"version {step.from_version} to {step.to_version}: {step.does}; {step.files} parts {verb}")


def status(
    lake: LakeOption,
    as_json: JsonOption = False,
    as_metrics: Annotated[
        bool, typer.Option("--open-metrics", help="As OpenMetrics text, which Prometheus collects from a file.")
    ] = False,
) -> None:
    """What a lake holds, what is made, what is missing, what was rejected and what failed.

    Example: motionlake status --lake mylake

    Example: motionlake status --open-metrics --lake mylake > motionlake.prom
    """
    from motionlake.stages.generator_model import GENERATOR
    from motionlake.stages.reader import lake_reader
    from motionlake.stages.registry import ALL, BY_NAME, EVERY, ON_REQUEST
    from motionlake.stages.synthesis import SYNTH

    if as_json and as_metrics:
        raise UserError("status: --json and --open-metrics are two forms of one answer; name one")
    target = layout.open_lake(lake)
    with lake_reader(target, load_config(target.config_file)) as at:
        due: dict[str, int | None] = {stage.name: stage.due(at) for stage in EVERY}
        datasets, models, failed = (fetch(at.con, q) for q in ("status_datasets", "status_models", "failed_shards"))
        done = {row["stage"]: row for row in fetch(at.con, "status_stages")}
        rows = {row["stage"]: row["rows"] for row in fetch(at.con, "status_rows")}
        if as_metrics and not has_macros(at.con):
            raise UserError(
                f"{target.root}: an earlier motionlake wrote it; `motionlake run all` adds what metrics need"
            )
        metrics = fetch(at.con, "status_metrics") if as_metrics else []
        damaged = [{"file": f.file, "fault": wrong} for f, wrong in faults_of_now(target)]
    # A stage that is made when asked for by name is not due before it was.
    known = {*ALL, *done, *(SYNTH.name for m in models if m["model"].startswith(GENERATOR.name))}
    wanted = {s: due[s] if s in known else None for s in ALL + BY_NAME}
    if ON_REQUEST.name in done:  # made to order, never due
        wanted[ON_REQUEST.name] = None
    if as_metrics:
        from motionlake.cli._open_metrics import open_metrics

        print(open_metrics(datasets, metrics, wanted, len(damaged)), end="")
        return
    nothing = {"shards": 0, "rows": 0, "bytes": 0, "failed": 0}
    stages = [{"stage": s, **nothing, **done.get(s, {}), "due": wanted[s]} for s in wanted]
    for row in stages:
        row["rows"] = rows.get(row["stage"], row["rows"])
    if as_json:
        parts = {"datasets": datasets, "stages": stages, "models": models, "failed": failed, "damaged": damaged}
        tell(parts, as_json=True)
        return
    people = [{COLUMNS.get(name, name): value for name, value in row.items()} for row in stages]
    made = [{**model, "metrics": _brief(json.loads(model["metrics"]))} for model in models]
    tables = {"datasets": datasets, "stages": people, "models": made, "batches that failed": failed}
    tables["damaged files; `motionlake repair` mends them"] = damaged
    for title, found in tables.items():
        if found:
            print(f"\n{title}")
            tell(found, as_json=False)
    print(
        "\nA stage works in batches of clips. Batches to do: `motionlake run all` does those of the stages that it "
        "makes;\nblank where a stage is made only when it is asked for by name (`motionlake run NAME`)."
    )


def _named_folder(context: typer.Context, folder: Path | None, lake: Path | None) -> Path:
    """The folder that a command names one way or the other. Raises `UserError` where it names none or two."""
    if folder and lake and folder != lake and str(context.get_parameter_source("lake")).endswith("COMMANDLINE"):
        raise UserError(f"{context.info_name}: {folder} and --lake {lake} are two folders; name one")
    chosen = folder or lake
    if chosen is None:
        raise UserError(
            f"{context.info_name}: name the folder of the lake, as in `motionlake {context.info_name} mylake`"
        )
    return lake_folder_of(chosen)


def _brief(metrics: Mapping[str, Any]) -> str:
    """The plain numbers and words among the metrics of a model, rounded."""
    plain = {k: v for k, v in metrics.items() if isinstance(v, int | float | str) and not k.endswith("sha256")}
    return ", ".join(
        f"{name.replace('_', ' ')} {value:.4g}" if isinstance(value, float) else f"{name.replace('_', ' ')} {value}"
        for name, value in plain.items()
        if value != "" and len(str(value)) <= 40
    )
