"""motionlake migrate."""

from __future__ import annotations

from typing import Annotated

import typer
from motionlake.cli.common import (
    FolderArgument,
    FolderOption,
    JsonOption,
    named_folder,
    notice,
    print_json,
    stage_progress,
)
from motionlake.lake import migrations
from motionlake.lake.catalog import SCHEMA_VERSION
from motionlake.lake.layout import open_lake


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
    target = open_lake(named_folder(context, folder, lake))
    if dry_run:
        steps = migrations.plan(target)
    else:
        with stage_progress() as progress:
            steps = migrations.migrate(target, progress)
    if as_json:
        print_json({"lake": str(target.root), "version": SCHEMA_VERSION, "steps": [step.as_row() for step in steps]})
        return
    if not steps:
        notice(f"{target.root}: is of version {SCHEMA_VERSION} already; nothing to do")
    for step in steps:
        verb = "would be rewritten" if dry_run else "rewritten"
        print(f"version {step.from_version} to {step.to_version}: {step.does}; {step.files} parts {verb}")
