"""motionlake synthesize."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer
from motionlake.cli.closing import close_run
from motionlake.cli.common import (
    JsonOption,
    LakeOption,
    SchedulerOption,
    WorkersOption,
    notice,
    stage_progress,
    tell,
)
from motionlake.errors import UserError
from motionlake.formats import is_clip
from motionlake.jobs import run as jobs
from motionlake.jobs.session import Session, session
from motionlake.lake.catalog import reading
from motionlake.lake.config import load_config
from motionlake.lake.layout import Lake, check_dataset, open_lake
from motionlake.lake.resolve import resolve_clip
from motionlake.stages.synthesis import class_names, served_generator
from motionlake.stages.synthesis_wishes import Request, check_request


def synthesize(
    lake: LakeOption,
    wanted: Annotated[
        list[str] | None,
        typer.Option("--class", "-c", help="Class of the motion; several follow one another.", show_default=False),
    ] = None,
    seconds: Annotated[float, typer.Option(help="Length of each motion.")] = 8.0,
    count: Annotated[int, typer.Option(help="How many motions.")] = 1,
    seed: Annotated[int, typer.Option(help="Another seed, other motions.")] = 0,
    dataset: Annotated[str, typer.Option(help="Dataset of the new clips; it may hold no recorded ones.")] = "synthetic",
    start: Annotated[
        str | None,
        typer.Option("--from", help="Start from this clip or clip file (default: drawn).", show_default=False),
    ] = None,
    split: Annotated[
        str | None, typer.Option(help="Draw clips to start from of this split only.", show_default=False)
    ] = None,
    pace: Annotated[float, typer.Option(help="2 is twice as fast.")] = 1.0,
    temperature: Annotated[
        float, typer.Option(help="Variety: 0 for the likeliest motion, 1 as recordings vary.")
    ] = 1.0,
    bvh: Annotated[Path | None, typer.Option(help="Also write a BVH file of each here.", show_default=False)] = None,
    classes: Annotated[bool, typer.Option("--classes", help="List the classes there are, and make nothing.")] = False,
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    as_json: JsonOption = False,
) -> None:
    """New motion of classes that you name, made by a trained generator.

    The motions become clips of the lake, in a dataset of their own. A generator comes first: motionlake run synth. Each
    motion goes on from the first poses of a recorded clip of the first class (of any clip, where the lake has no
    labels), drawn by --seed. The same command makes the same clips; what is there already is left as it is. The table
    "synthetic" says where every clip comes from.

    Example: motionlake synthesize --class walk --class kick --seconds 8 --count 100 --seed 7 --lake mylake

    Which classes there are: motionlake synthesize --classes --lake mylake
    """
    target = open_lake(lake)
    if classes:
        _list_classes(target, as_json)
        return
    name, outside = (None, False) if start is None else _start(target, start)
    request = Request(tuple(wanted or ()), seconds, seed, name, outside, split, pace, temperature)
    check_request(request)
    if count < 1:
        raise UserError(f"--count {count}: ask for one motion at least")
    check_dataset(dataset)
    if bvh is not None:
        _check_folder(bvh)
    with stage_progress() as progress, session(target, "synthesize", progress, notice, workers, scheduler) as job:
        made = jobs.synthesize(job, request, dataset, count)
        files = _write_bvh(job, made.clips, bvh) if bvh is not None else 0
        close_run(job)
    found = {
        "model": made.model, "dataset": dataset, "clips": made.clips, "made": made.made, "there": made.there,
        "seconds": round(made.seconds, 3), "wall_seconds": round(made.wall_seconds, 3), "files": files,
    }  # fmt: skip
    tell(found, _said(made, dataset, count, lake), as_json=as_json)
    if len(made.clips) < count:
        raise typer.Exit(1)


def _start(lake: Lake, name: str) -> tuple[str, bool]:
    """A clip file, or the clip of the lake that a name means, and whether it is a file."""
    if Path(name).is_file() and is_clip(Path(name)):
        return str(Path(name).absolute()), True
    with reading(lake) as con:
        return resolve_clip(con, name), False


def _list_classes(lake: Lake, as_json: bool) -> None:
    with reading(lake) as con:
        model = served_generator(con, lake, load_config(lake.config_file))
    names = class_names(model)
    tell({"model": model.model, "classes": names}, [{"class": name} for name in names], as_json=as_json)


def _check_folder(folder: Path) -> None:
    """Make the folder; raises `UserError` where nothing can be written to it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--bvh {folder}: is no folder and cannot be made one ({error.strerror})") from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise UserError(f"--bvh {folder}: cannot be written to")


def _write_bvh(job: Session, clips: list[str], folder: Path) -> int:
    """Write every clip on the canonical skeleton; returns how many files that are."""
    from motionlake.formats.bvh_writer import write_bvh
    from motionlake.lake.export import own_rig

    job.progress("bvh", 0, len(clips))
    with reading(job.lake) as con:
        for done, clip in enumerate(clips, start=1):
            write_bvh(own_rig(con, job.lake, clip), folder / f"{clip.partition('/')[2]}.bvh")
            job.progress("bvh", done, len(clips))
    return len(clips)


def _said(made: jobs.Synthesis, dataset: str, count: int, lake: Path) -> str:
    there = f" ({made.there} were there already)" if made.there else ""
    first = f", {made.clips[0]} the first" if made.clips else ""
    return (
        f"{made.made} of {count} motions made{there}: {made.seconds:.1f} s of motion by {made.model} in dataset "
        f"{dataset}{first}, in {made.wall_seconds:.1f} s; make them searchable: motionlake run all --lake {lake}"
    )
