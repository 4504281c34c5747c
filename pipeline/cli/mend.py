"""motionlake verify, repair, backup and restore: is a lake as it was written, and how it becomes so again."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from motionlake.cli._output import notice, tell
from motionlake.cli._progress import stage_progress
from motionlake.cli._running import running
from motionlake.cli.common import JsonOption, LakeOption, WorkersOption, argument, option
from motionlake.errors import UserError
from motionlake.lake.layout import Lake, lake_folder


def verify(
    lake: LakeOption,
    deep: Annotated[
        bool, typer.Option("--deep", help="Read and compare every byte, not only names and sizes.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Compare a lake with what was written: one row a fault; exit status 1 where there is one, else 0.

    Example: motionlake verify --lake mylake

    Example: motionlake verify --deep --json --lake mylake
    """
    from motionlake.lake.verify import verify as faults_of

    target = lake_folder(lake)
    with stage_progress() as progress:
        found = faults_of(target, deep=deep, progress=progress)
    rows = [fault.as_row() for fault in found]
    sound = "every byte is as it was written" if deep else "no file is missing or touched (--deep compares every byte)"
    tell(rows, rows or f"{target.root}: {sound}", as_json=as_json)
    if found:
        notice(f"{target.root}: {len(found)} fault{'s' * (len(found) > 1)}; {target.mending}")
        raise typer.Exit(1)


def repair(
    lake: LakeOption,
    workers: WorkersOption = None,
    as_json: JsonOption = False,
) -> None:
    """Make damaged or missing files of a lake again, as they were.

    They come from source files, from what lies upstream, or from copies in the lake; a lost catalog with the labels
    that people gave. Settings that changed since the last run get their former text (`motionlake run all` instead takes
    the new one). Exit status 1 where something could not be mended.

    Example: motionlake repair --lake mylake
    """
    from motionlake.jobs.repair import repair_files
    from motionlake.lake.lock import locked
    from motionlake.lake.mend import mend_catalog, mend_checkpoints, mend_settings

    target = lake_folder(lake)
    with locked(target, "repair"):
        found = [*mend_catalog(target), *mend_settings(target), *mend_checkpoints(target)]
    with running(target, "repair", workers, damaged=True) as session:
        found += repair_files(session)
    rows = [asdict(one) for one in found]
    tell(rows, rows or f"{target.root}: nothing to mend; every byte is as it was written", as_json=as_json)
    left = [one for one in found if not one.mended]
    if left:
        notice(f"{target.root}: {len(left)} of {len(found)} files could not be mended")
        raise typer.Exit(1)


def backup(
    lake: LakeOption,
    out: Annotated[Path, option("--out", "-o", help="Archive to write, such as mylake.zip.")],
    clips: Annotated[
        bool, typer.Option("--clips", help="Also the motion of all clips, not only of those whose source is gone.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Copy into one archive what could not be made again.

    That is labels and other tables, settings, trained models, and clips without a source.

    Example: motionlake backup -o mylake.zip --lake mylake
    """
    from motionlake.lake.backup import write_backup

    with running(lake_folder(lake), "backup") as session:
        written = write_backup(session.lake, out, clips=clips)
    tell(asdict(written), f"{out}: {written.files} files, {written.bytes / 1e6:.1f} MB", as_json=as_json)


def restore(
    archive: Annotated[Path, argument("Archive that `motionlake backup` wrote.")],
    lake: LakeOption,
    workers: WorkersOption = None,
    as_json: JsonOption = False,
) -> None:
    """Make a lake from a backup; what that does not hold is made again from the sources.

    Example: motionlake restore mylake.zip --lake again
    """
    from motionlake.lake.backup import read_backup
    from motionlake.lake.lock import locked

    target = Lake(lake.absolute())
    if target.catalog.exists():
        raise UserError(f"{lake}: there is a lake here already; name a folder without one")
    target.root.mkdir(parents=True, exist_ok=True)
    with locked(target, "restore"):
        read_backup(archive, target)
    repair(lake, workers, as_json)
