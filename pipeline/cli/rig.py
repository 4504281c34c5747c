"""motionlake rig."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from motionlake.cli.common import JsonOption, tell
from motionlake.errors import ClipError, UserError
from motionlake.formats import read_clips
from motionlake.motion.rigs import identify, load_rigs
from motionlake.motion.starter import starter_map


def rig(
    clip: Annotated[Path | None, typer.Argument(help="A clip file; without one, the known rigs.")] = None,
    lake: Annotated[Path | None, typer.Option("--lake", "-l", help="Also the rig maps of this lake.")] = None,
    starter: Annotated[bool, typer.Option("--starter", help="Print a rig map to edit even for a known rig.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Which rig a clip file has, and a rig map to edit for a rig that is not known.

    A rig map says which of the file's joints are hips, knees and so on; put it into the folder rigs/ of the lake.

    Example: motionlake rig shots/take.bvh > mylake/rigs/studio.toml

    Example: motionlake rig
    """
    rigs = load_rigs(lake / "rigs" if lake else None)
    if clip is None:
        tell([{"rig": r.name, "description": r.description} for r in rigs.values()], as_json=as_json)
        return
    try:
        source = read_clips(clip)[0]
    except ClipError as error:
        raise UserError(f"{clip}: {error}") from error
    try:
        known = None if starter else identify(source.hierarchy.joints, rigs)
    except ClipError:
        known = None
    found = {"rig": known.name if known else None, "joints": list(source.hierarchy.joints)}
    if as_json or known is not None:
        tell(found, f"{known.name}: {known.description}" if known else None, as_json=as_json)
    else:
        print(starter_map(source.hierarchy))
