"""motionlake status."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Final

from motionlake.cli.common import JsonOption, LakeOption, print_json, print_rows
from motionlake.lake.catalog import fetch
from motionlake.lake.config import load_config
from motionlake.lake.layout import open_lake
from motionlake.stages.dry_run import pending
from motionlake.stages.generator_model import GENERATOR
from motionlake.stages.reader import lake_reader
from motionlake.stages.registry import ALL, BY_NAME, ON_REQUEST
from motionlake.stages.synthesis import SYNTH


def status(lake: LakeOption, as_json: JsonOption = False) -> None:
    """What a lake holds, what is made, what is missing, what was rejected and what failed.

    Example: motionlake status --lake mylake
    """
    target = open_lake(lake)
    with lake_reader(target, load_config(target.config_file)) as at:
        con = at.con
        datasets = fetch(con, "status_datasets")
        done = {row["stage"]: row for row in fetch(con, "status_stages")}
        due = pending(at)
        rows = {row["stage"]: row["rows"] for row in fetch(con, "status_rows")}
        models = fetch(con, "status_models")
        failed = fetch(con, "failed_shards")
    nothing = {"shards": 0, "rows": 0, "bytes": 0, "failed": 0}
    # A stage that is made when asked for by name is not due before it was.
    known = {*ALL, *done, *(SYNTH.name for m in models if m["model"].startswith(GENERATOR.name))}
    wanted = {s: due[s] if s in known else None for s in ALL + BY_NAME}
    if ON_REQUEST.name in done:  # made to order, never due
        wanted[ON_REQUEST.name] = None
    stages = [{"stage": s, **nothing, **done.get(s, {}), "due": wanted[s]} for s in wanted]
    for row in stages:
        row["rows"] = rows.get(row["stage"], row["rows"])
    if as_json:
        print_json({"datasets": datasets, "stages": stages, "models": models, "failed": failed})
        return
    people = [{_COLUMNS.get(name, name): value for name, value in row.items()} for row in stages]
    made = [{**model, "metrics": _brief(json.loads(model["metrics"]))} for model in models]
    tables = {"datasets": datasets, "stages": people, "models": made, "batches that failed": failed}
    for title, found in tables.items():
        if found:
            print(f"\n{title}")
            print_rows(found, as_json=False)
    print(
        "\nA stage works in batches of clips. Batches to do: `motionlake run all` does those of the stages that it "
        "makes;\nblank where a stage is made only when it is asked for by name (`motionlake run NAME`)."
    )


# What a table for people calls the columns of the JSON.
_COLUMNS: Final = {"shards": "batches done", "due": "batches to do"}


def _brief(metrics: Mapping[str, Any]) -> str:
    """The plain numbers and words among the metrics of a model, rounded."""
    plain = {k: v for k, v in metrics.items() if isinstance(v, int | float | str) and not k.endswith("sha256")}
    return ", ".join(
        f"{name.replace('_', ' ')} {value:.4g}" if isinstance(value, float) else f"{name.replace('_', ' ')} {value}"
        for name, value in plain.items()
        if value != "" and len(str(value)) <= 40
    )
