"""motionlake export."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from motionlake.cli.common import JsonOption, LakeOption, print_json
from motionlake.errors import UserError
from motionlake.formats.bvh_writer import write_bvh
from motionlake.lake.catalog import reading
from motionlake.lake.export import canonical_rig, own_rig
from motionlake.lake.layout import open_lake
from motionlake.lake.resolve import resolve_clip


def add_to(app: typer.Typer) -> None:
    app.command()(export)


def export(
    clip: Annotated[str, typer.Argument(help="A clip of the lake.", show_default=False)],
    lake: LakeOption,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="BVH file to write (default: CLIP.bvh here).")] = None,
    rig: Annotated[str, typer.Option(help="own: the clip's own rig; canonical: retargeted.")] = "own",
    start: Annotated[int, typer.Option("--from", min=0, help="First frame.")] = 0,
    stop: Annotated[int | None, typer.Option("--to", help="Frame after the last.", show_default=False)] = None,
    as_json: JsonOption = False,
) -> None:
    """Write a clip, or a range of its frames, as BVH.

    Example: motionlake export walk_01 --lake mylake --rig canonical --from 0 --to 240 -o walk.bvh
    """
    if rig not in ("own", "canonical"):
        raise UserError(f"--rig {rig}: use own or canonical")
    target = open_lake(lake)
    with reading(target) as con:
        name = resolve_clip(con, clip)
        source = (own_rig if rig == "own" else canonical_rig)(con, target, name)
    count = len(source.channels)
    last = count if stop is None else stop
    if not start < last <= count:
        raise UserError(f"--from {start} --to {last}: {name} has frames 0 to {count}")
    file = out or Path(Path(name.partition("#")[0]).name).with_suffix(".bvh")
    if not file.parent.is_dir():
        raise UserError(f"{file.parent}: no such folder")
    write_bvh(source, file, start, last)
    if as_json:
        print_json({"clip": name, "file": str(file), "frames": last - start, "fps": source.fps})
    else:
        print(f"{file}: {last - start} frames of {name}")
