"""motionlake export."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from motionlake.cli.common import JsonOption, LakeOption, StartOption, StopOption, asked_for, tell
from motionlake.errors import UserError
from motionlake.formats.bvh_writer import write_bvh
from motionlake.lake.catalog import reading
from motionlake.lake.export import canonical_rig, own_rig
from motionlake.lake.frames import frame_range
from motionlake.lake.layout import open_lake
from motionlake.lake.resolve import resolve_clip


def export(
    clip: Annotated[str, typer.Argument(help="A clip of the lake.", show_default=False)],
    lake: LakeOption,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="BVH file to write (default: CLIP.bvh here).")] = None,
    rig: Annotated[str, typer.Option(help="own: the clip's own rig; canonical: retargeted.")] = "own",
    start: StartOption = None,
    stop: StopOption = None,
    as_json: JsonOption = False,
) -> None:
    """Write a clip, or a range of it, as BVH.

    Example: motionlake export walk_01 --lake mylake --rig canonical --from 0s --to 4s -o walk.bvh
    """
    if rig not in ("own", "canonical"):
        raise UserError(f"--rig {rig}: use own or canonical")
    target = open_lake(lake)
    with reading(target) as con:
        name = resolve_clip(con, clip)
        source = (own_rig if rig == "own" else canonical_rig)(con, target, name)
        asked = asked_for(con, target, name, start, stop)
    first, last = frame_range(name, asked.start, asked.stop, len(source.channels))
    file = out or Path(Path(name.partition("#")[0]).name).with_suffix(".bvh")
    if not file.parent.is_dir():
        raise UserError(f"{file.parent}: no such folder")
    write_bvh(source, file, first, last)
    frames = last - first
    found = {"clip": name, "file": str(file), "frames": frames, "fps": source.fps}
    tell(found, f"{file}: {frames} frames of {name}", as_json=as_json)
