"""motionlake status."""

from __future__ import annotations

from motionlake.cli.common import JsonOption, LakeOption, print_json, print_rows
from motionlake.jobs.run import BY_NAME, STAGES
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.config import load_config
from motionlake.lake.layout import open_lake
from motionlake.stages import synthesis, synthesize
from motionlake.stages.outlook import pending


def status(lake: LakeOption, as_json: JsonOption = False) -> None:
    """What a lake holds, what is made, what is missing, what was rejected and what failed.

    Example: motionlake status --lake mylake
    """
    target = open_lake(lake)
    config = load_config(target.config_file)
    with reading(target) as con:
        datasets = fetch(con, "status_datasets")
        done = {row["stage"]: row for row in fetch(con, "status_stages")}
        due = pending(con, target, config)
        models = fetch(con, "status_models")
        failed = fetch(con, "failed_shards")
    nothing = {"shards": 0, "rows": 0, "bytes": 0, "failed": 0}
    # A stage that is made when asked for by name is not due before it was.
    known = {*STAGES, *done, *(synthesis.NAME for m in models if m["model"].startswith(synthesis.GENERATOR))}
    wanted = {s: due[s] if s in known else None for s in STAGES + BY_NAME}
    if synthesize.NAME in done:  # made to order, never due
        wanted[synthesize.NAME] = None
    stages = [{"stage": s, **nothing, **done.get(s, {}), "due": wanted[s]} for s in wanted]
    if as_json:
        print_json({"datasets": datasets, "stages": stages, "models": models, "failed": failed})
        return
    for title, rows in (("datasets", datasets), ("stages", stages), ("models", models), ("failed shards", failed)):
        if rows:
            print(f"\n{title}")
            print_rows(rows, as_json=False)
