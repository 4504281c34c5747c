"""motionlake init."""

from __future__ import annotations

import typer
from motionlake.cli.common import FolderArgument, FolderOption, JsonOption, named_folder, notice, tell
from motionlake.lake.catalog import create_catalog
from motionlake.lake.config import default_toml
from motionlake.lake.layout import Lake


def init(
    context: typer.Context, folder: FolderArgument = None, lake: FolderOption = None, as_json: JsonOption = False
) -> None:
    """Create an empty lake, the folder that holds clips and all that is computed of them.

    Example: motionlake init mylake
    """
    chosen = named_folder(context, folder, lake)
    target = Lake(chosen.absolute())
    create_catalog(target)
    if not target.config_file.exists():
        target.config_file.write_text(default_toml(), encoding="utf-8")
    notice(f"an empty lake in {chosen}; next: motionlake ingest FOLDER --lake {chosen}")
    if as_json:
        tell({"lake": str(target.root)}, as_json=True)
