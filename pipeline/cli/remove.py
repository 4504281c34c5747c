"""motionlake remove."""

from __future__ import annotations

from typing import Annotated

import typer
from motionlake.cli.common import JsonOption, LakeOption, notice, stage_progress, tell
from motionlake.errors import UserError
from motionlake.jobs.session import session
from motionlake.lake.catalog import reading
from motionlake.lake.layout import check_dataset, open_lake
from motionlake.stages.removal import Removal, gone_sources, remove_dataset, remove_sources, sources_of


def remove(
    lake: LakeOption,
    clips: Annotated[list[str] | None, typer.Argument(help="Clips, by name.", show_default=False)] = None,
    dataset: Annotated[str | None, typer.Option(help="Remove a whole dataset.", show_default=False)] = None,
    gone: Annotated[bool, typer.Option("--gone", help="Remove every clip whose source file is gone.")] = False,
    for_good: Annotated[
        bool, typer.Option("--for-good", help="Do not take these files in again (undo: ingest --take-back).")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Take clips out of a lake, with all that was computed of them.

    Source files are not touched. A removed clip comes back when its folder is ingested again, unless it is removed
    --for-good; `motionlake ingest FOLDER --take-back` takes it in again all the same.

    Example: motionlake remove walk_01 --lake mylake

    Example: motionlake remove --gone --lake mylake
    """
    if not clips and dataset is None and not gone:
        raise UserError("remove: name clips, or give --dataset NAME or --gone")
    target = open_lake(lake)
    with stage_progress() as progress, session(target, "remove", progress, notice):
        removed = Removal(0, 0)
        if dataset is not None:
            removed += remove_dataset(target, check_dataset(dataset))
        with reading(target) as con:
            sources = sources_of(con, clips or []) + (gone_sources(con) if gone else [])
        removed += remove_sources(target, sources, for_good=for_good)
    found = {"clips": removed.clips, "files": removed.files}
    if removed.files and not for_good and dataset is None:
        notice("remove: the next `motionlake ingest` of their folder takes them in again; --for-good keeps them out")
    tell(found, f"{removed.clips} clips removed ({removed.files} source files forgotten)", as_json=as_json)
