"""motionlake status."""

from __future__ import annotations

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
        models = fetch(con, "status_models")
        failed = fetch(con, "failed_shards")
    nothing = {"shards": 0, "rows": 0, "bytes": 0, "failed": 0}
    # A stage that is made when asked for by name is not due before it was.
    known = {*ALL, *done, *(SYNTH.name for m in models if m["model"].startswith(GENERATOR.name))}
    wanted = {s: due[s] if s in known else None for s in ALL + BY_NAME}
    if ON_REQUEST.name in done:  # made to order, never due
        wanted[ON_REQUEST.name] = None
    stages = [{"stage": s, **nothing, **done.get(s, {}), "due": wanted[s]} for s in wanted]
    if as_json:
        print_json({"datasets": datasets, "stages": stages, "models": models, "failed": failed})
        return
    for title, rows in (("datasets", datasets), ("stages", stages), ("models", models), ("failed shards", failed)):
        if rows:
            print(f"\n{title}")
            print_rows(rows, as_json=False)
