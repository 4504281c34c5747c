"""motionlake inbetween: a dense motion through the poses of a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from motionlake.cli._motion_requests import source_of
from motionlake.cli._output import check_folder_of, tell
from motionlake.cli.common import JsonOption, LakeOption, argument, option
from motionlake.errors import UserError
from motionlake.lake.catalog import reading
from motionlake.lake.layout import open_lake


def inbetween(
    lake: LakeOption,
    poses: Annotated[str, argument("Clip file (such as BVH) or clip of the lake that holds the poses.")],
    out: Annotated[Path, option("--out", "-o", help="BVH file to write.")],
    keys: Annotated[
        str,
        option("--keys", help="Its frames that are keys: 0,24,60, all, or a CSV file of frame and seconds."),
    ] = "all",
    spacing: Annotated[
        float | None, option("--spacing", help="Seconds from key to key (default: as far as their frames are apart).")
    ] = None,
    wanted: Annotated[
        list[str] | None, option("--class", "-c", help="Move as this class does; again for others (default: any).")
    ] = None,
    fps: Annotated[float | None, option("--fps", help="Frames a second of the motion (default: 30).")] = None,
    seed: Annotated[int, typer.Option(help="Another seed, other motion between the poses.")] = 0,
    temperature: Annotated[float, typer.Option(help="Variety: 0 for the likeliest motion.")] = 0.0,
    as_json: JsonOption = False,
) -> None:
    """Motion between your own poses: marked frames of a file become a dense BVH.

    It passes through them, and in between moves as the lake's generator does (motionlake run synth gets one). The BVH
    has the canonical skeleton with the body's own bones; nothing is added to the lake.

    Example: motionlake inbetween blocking.bvh --keys 0,24,60 --class walk --out dense.bvh --lake mylake

    A file whose every frame is a pose, half a second apart: motionlake inbetween poses.bvh --keys all --spacing 0.5
    --out dense.bvh --lake mylake

    Keys and times from a table: motionlake inbetween blocking.bvh --keys keys.csv --out dense.bvh --lake mylake
    """
    from motionlake.formats.write.bvh import write_bvh
    from motionlake.motion.canonicalise import to_source_clip
    from motionlake.stages.synthesis_inbetween import inbetween as fill_in

    target = open_lake(lake)
    check_folder_of(out)
    if out.suffix.lower() != ".bvh":
        raise UserError(f"--out {out}: its name must end in .bvh")
    with reading(target) as con:
        made = fill_in(
            con, target, source_of(con, poses), keys, tuple(wanted or ()), spacing=spacing, fps=fps, seed=seed,
            temperature=temperature,
        )  # fmt: skip
    write_bvh(to_source_clip(made.motion), out)
    frames = len(made.motion.positions)
    row = {"file": str(out), "frames": frames, "fps": made.motion.fps, "keys": made.frames, "model": made.model}
    line = f"{out}: {frames} frames, {frames / made.motion.fps:.2f} s, through {len(made.frames)} poses by {made.model}"
    tell(row, line, as_json=as_json)
