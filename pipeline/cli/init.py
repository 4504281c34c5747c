"""motionlake init."""

from __future__ import annotations

import typer
from motionlake.cli.common import JsonOption, LakeArgument, notice, print_json
from motionlake.lake.catalog import create_catalog
from motionlake.lake.config import default_toml
from motionlake.lake.layout import Lake


def add_to(app: typer.Typer) -> None:
    app.command()(init)


def init(lake: LakeArgument, as_json: JsonOption = False) -> None:
    """Create an empty lake.

    Example: motionlake init mylake
    """
    target = Lake(lake.absolute())
    create_catalog(target)
    if not target.config_file.exists():
        target.config_file.write_text(default_toml(), encoding="utf-8")
    notice(f"an empty lake in {lake}; next: motionlake ingest FOLDER --lake {lake}")
    if as_json:
        print_json({"lake": str(target.root)})
