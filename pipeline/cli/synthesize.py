"""motionlake synthesize: new motion of known classes, as clips of the lake."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from motionlake.cli._motion_files import make_folder, write_bvh_files
from motionlake.cli._motion_requests import shown_poses, source_of, start_of
from motionlake.cli._output import check_folder_of, notice, tell, write_csv
from motionlake.cli._running import running
from motionlake.cli.common import (
    JsonOption,
    LakeOption,
    MinQualityOption,
    SchedulerOption,
    WorkersOption,
    dataset_name,
    option,
)
from motionlake.errors import UserError
from motionlake.lake.catalog import reading
from motionlake.lake.layout import Lake, open_lake
from motionlake.lake.settings import served_config

if TYPE_CHECKING:
    from motionlake.jobs.run import Synthesis
    from motionlake.stages.synthesis_control import Request

SOURCE: Final = ("clip", "start", "stop", "source", "first", "last", "mirrored")  # columns of --lineage


def synthesize(
    lake: LakeOption,
    wanted: Annotated[
        list[str] | None,
        option("--class", "-c", help="Class of the motion; several follow one another (walk:3 for 3 seconds)."),
    ] = None,
    seconds: Annotated[
        float | None, option(help="Length of each motion (default: as classes or path say, else 8).")
    ] = None,
    count: Annotated[int, typer.Option(help="How many motions.")] = 1,
    diverse: Annotated[
        bool,
        typer.Option("--diverse", help="None nearer to another than recorded clips of the class are to one another."),
    ] = False,
    seed: Annotated[int, typer.Option(help="Another seed, other motions.")] = 0,
    dataset: Annotated[
        str, typer.Option(help="Dataset of the new clips; it may hold no recorded ones.", callback=dataset_name)
    ] = "synthetic",
    start: Annotated[
        str | None,
        option("--from", help="Start from this clip or clip file (default: drawn); with --edit, a frame or seconds."),
    ] = None,
    stop: Annotated[
        str | None, option("--to", help="With --edit: the first frame that is kept again, as in 240, or 2s.")
    ] = None,
    split: Annotated[str | None, option("--split", help="Draw clips to start from of this split only.")] = None,
    min_quality: MinQualityOption = None,
    pace: Annotated[float, typer.Option(help="2 is twice as fast.")] = 1.0,
    temperature: Annotated[
        float, typer.Option(help="Variety: 0 for the likeliest motion, 1 as recordings vary.")
    ] = 1.0,
    path: Annotated[
        str | None,
        option(
            "--path", help="Way on the ground: circle, eight:2 (radius 2 m), a CSV file of x, z, or points 0,0;0,3;2,5."
        ),
    ] = None,
    speed: Annotated[float | None, option("--speed", help="Metres a second (default: as recorded).")] = None,
    facing: Annotated[
        str | None, option("--facing", help="path, or degrees to the left that the body keeps facing (default: path).")
    ] = None,
    loop: Annotated[bool, typer.Option("--loop", help="The end meets the beginning.")] = False,
    continues: Annotated[str | None, option("--continue", help="Go on from the end of this clip or clip file.")] = None,
    style: Annotated[
        str | None,
        option("--style-from", help="Prefer recorded frames that look like this clip or clip file."),
    ] = None,
    keyframes: Annotated[
        list[str] | None,
        option("--keyframes", help="Pass through this frame, CLIP@FRAME, or CLIP@FRAME=SECONDS; again for the next."),
    ] = None,
    edit: Annotated[
        str | None, option("--edit", help="Make frames --from to --to of this clip anew, and keep the rest.")
    ] = None,
    lineage: Annotated[Path | None, option(help="Also write where every frame comes from: .csv.")] = None,
    bvh: Annotated[Path | None, option(help="Also write a BVH file of each here.")] = None,
    classes: Annotated[bool, typer.Option("--classes", help="List the classes there are, and make nothing.")] = False,
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    as_json: JsonOption = False,
) -> None:
    """New motion of classes that you name: recorded frames joined anew, or made by networks.

    The motions become clips of the lake, in a dataset of their own. First: motionlake run synth. Where recordings of
    the lake are labelled with the classes, motion matching plays these; where not, networks make it. A line says which,
    and why. Each motion goes on from the first poses of a recorded clip of the first class, drawn by --seed. The same
    command makes the same clips; what is there already is left as it is. The table "synthetic" says where every clip
    comes from.

    Example: motionlake synthesize --class walk --class kick --seconds 8 --count 100 --seed 7 --lake mylake

    Along a path: motionlake synthesize --class walk --path eight --speed 1.2 --lake mylake

    By time: motionlake synthesize --class walk:3 --class run:2 --continue walk_01 --lineage from.csv --lake mylake

    A loop: motionlake synthesize --class walk --path circle:2 --facing path --loop --lake mylake

    Twenty that differ: motionlake synthesize --class walk --count 20 --diverse --lake mylake

    In the manner of a clip: motionlake synthesize --class walk --style-from old_man_01 --lake mylake

    Through poses: motionlake synthesize --keyframes walk_01@10 --keyframes walk_01@3s --keyframes run_02@40=4.5 --lake
    mylake

    A range of a clip anew: motionlake synthesize --edit walk_01 --from 2s --to 3.5s --class kick --lake mylake

    Which classes there are: motionlake synthesize --classes --lake mylake
    """
    from motionlake.jobs import run as jobs
    from motionlake.stages.synthesis_control import Request, check_request
    from motionlake.stages.synthesis_keys import style_of
    from motionlake.stages.synthesis_options import begun, facing_of, path_text, timed_classes

    target = open_lake(lake)
    if classes:
        _list_classes(target, as_json)
        return
    first = begun(start if edit is None else None, continues)
    name, outside = (None, False) if first is None else start_of(target, first)
    names, shares = timed_classes(wanted or ())
    request = Request(
        names, seconds, seed, name, outside, split, pace, temperature, min_quality, shares,
        None if path is None else path_text(path), speed, facing_of(facing), loop, continues is not None,
    )  # fmt: skip
    request = replace(request, diverse=diverse)
    check_request(request)
    if style is not None:
        with reading(target) as con:
            request = replace(request, style=style_of(con, target, source_of(con, style)))
    if edit is not None or keyframes:
        with reading(target) as con:
            request = shown_poses(con, target, request, keyframes or [], edit, (start, stop))
    elif stop is not None:
        raise UserError("--to says where the range ends that --edit makes anew: give --edit CLIP")
    if lineage is not None:
        check_folder_of(lineage)
    if count < 1:
        raise UserError(f"--count {count}: ask for one motion at least")
    if bvh is not None:
        make_folder(bvh)
    with running(target, "synthesize", workers, scheduler) as job:
        made = jobs.synthesize(job, request, dataset, count)
        files = write_bvh_files(job, made.clips, bvh) if bvh is not None else 0
        if lineage is not None:
            write_csv(lineage, list(SOURCE), jobs.synthetic_sources(job, request, dataset, count))
    _tell_made(made, request, dataset, count, files, lake, as_json)
    if len(made.clips) < count:
        raise typer.Exit(1)


def _tell_made(
    made: Synthesis, request: Request, dataset: str, count: int, files: int, lake: Path, as_json: bool
) -> None:
    by = made.generator
    found: dict[str, Any] = {
        "model": by.model.model, "recipe": by.recipe, "why": by.why, "dataset": dataset, "clips": made.clips,
        "made": made.made, "there": made.there, "seconds": round(made.seconds, 3),
        "wall_seconds": round(made.wall_seconds, 3), "files": files,
    }  # fmt: skip
    if made.floor is not None:
        found |= {"floor": round(made.floor, 4), "alike": made.alike}
    if made.alike:
        more = f" and {len(made.alike) - 3} more" if len(made.alike) > 3 else ""
        notice(
            f"{len(made.alike)} of {count} motions are nearer to another than recorded clips of {request.classes[0]} "
            f"({made.floor:.3f} body lengths), whatever seed was tried: {', '.join(made.alike[:3])}{more}"
        )
    there = f" ({made.there} were there already)" if made.there else ""
    first = f", {made.clips[0]} the first" if made.clips else ""
    line = (
        f"{made.made} of {count} motions made{there}: {made.seconds:.1f} s of motion by {by.model.model} in dataset "
        f"{dataset}{first}, in {made.wall_seconds:.1f} s; make them searchable: motionlake run all --lake {lake}"
    )
    tell(found, line, as_json=as_json)


def _list_classes(lake: Lake, as_json: bool) -> None:
    from motionlake.stages.generator_model import recipe_of
    from motionlake.stages.synthesis import makers, served_generator

    with reading(lake) as con:
        config = served_config(lake)
        model, by = served_generator(con, lake, config), makers(con, lake, config)
    rows = [{"class": name, "recipe": recipe_of(one), "model": one.model} for name, one in by.items()]
    tell({"model": model.model, "classes": list(by), "by": rows} if as_json else rows, as_json=as_json)
