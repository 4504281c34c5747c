"""motionlake init."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from motionlake.cli.common import JsonOption, notice, print_json
from motionlake.errors import UserError
from motionlake.lake.catalog import create_catalog
from motionlake.lake.config import default_toml
from motionlake.lake.layout import Lake


def init(
    context: typer.Context,
    folder: Annotated[Path | None, typer.Argument(help="Folder of the new lake.", show_default=False)] = None,
    lake: Annotated[
        Path | None,
        typer.Option("--lake", "-l", envvar="MOTIONLAKE_LAKE", help="The same, as elsewhere.", show_default=False),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Create an empty lake, the folder that holds clips and all that is computed of them.

    Example: motionlake init mylake
    """
    if folder and lake and folder != lake and str(context.get_parameter_source("lake")).endswith("COMMANDLINE"):
        raise UserError(f"init: {folder} and --lake {lake} are two folders; name one")
    chosen = folder or lake
    if chosen is None:
        raise UserError("init: name the folder of the new lake, as in `motionlake init mylake`")
    target = Lake(chosen.absolute())
    create_catalog(target)
    if not target.config_file.exists():
        target.config_file.write_text(default_toml(), encoding="utf-8")
    notice(f"an empty lake in {chosen}; next: motionlake ingest FOLDER --lake {chosen}")
    if as_json:
        print_json({"lake": str(target.root)})
