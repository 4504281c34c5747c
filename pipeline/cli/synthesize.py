"""motionlake synthesize and inbetween: new motion by a trained generator."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer
from motionlake.cli.common import (
    FrameOrSeconds,
    JsonOption,
    LakeOption,
    MinQualityOption,
    SchedulerOption,
    WorkersOption,
    argument,
    check_folder_of,
    dataset_name,
    frame_or_seconds,
    named_source,
    notice,
    option,
    running,
    tell,
    write_csv,
)
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch, reading
from motionlake.lake.layout import Lake, open_lake
from motionlake.lake.settings import served_config
from motionlake.names import file_name, told_apart

if TYPE_CHECKING:
    from motionlake.jobs.session import Session
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
    """New motion of classes that you name, made by a trained generator.

    The motions become clips of the lake, in a dataset of their own. A generator comes first: motionlake run synth. Each
    motion goes on from the first poses of a recorded clip of the first class (of any clip, where the lake has no
    labels), drawn by --seed. The same command makes the same clips; what is there already is left as it is. The table
    "synthetic" says where every clip comes from.

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
    name, outside = (None, False) if first is None else _start(target, first)
    names, shares = timed_classes(wanted or ())
    request = Request(
        names, seconds, seed, name, outside, split, pace, temperature, min_quality, shares,
        None if path is None else path_text(path), speed, facing_of(facing), loop, continues is not None,
    )  # fmt: skip
    request = replace(request, diverse=diverse)
    check_request(request)
    if style is not None:
        with reading(target) as con:
            request = replace(request, style=style_of(con, target, _source(con, style)))
    if edit is not None or keyframes:
        with reading(target) as con:
            request = _shown_poses(con, target, request, keyframes or [], edit, (start, stop))
    elif stop is not None:
        raise UserError("--to says where the range ends that --edit makes anew: give --edit CLIP")
    if lineage is not None:
        check_folder_of(lineage)
    if count < 1:
        raise UserError(f"--count {count}: ask for one motion at least")
    if bvh is not None:
        _make_folder(bvh)
    with running(target, "synthesize", workers, scheduler) as job:
        made = jobs.synthesize(job, request, dataset, count)
        files = _write_bvh(job, made.clips, bvh) if bvh is not None else 0
        if lineage is not None:
            write_csv(lineage, list(SOURCE), jobs.synthetic_sources(job, request, dataset, count))
    found = {
        "model": made.model, "dataset": dataset, "clips": made.clips, "made": made.made, "there": made.there,
        "seconds": round(made.seconds, 3), "wall_seconds": round(made.wall_seconds, 3), "files": files,
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
        f"{made.made} of {count} motions made{there}: {made.seconds:.1f} s of motion by {made.model} in dataset "
        f"{dataset}{first}, in {made.wall_seconds:.1f} s; make them searchable: motionlake run all --lake {lake}"
    )
    tell(found, line, as_json=as_json)
    if len(made.clips) < count:
        raise typer.Exit(1)


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
            con, target, _source(con, poses), keys, tuple(wanted or ()), spacing=spacing, fps=fps, seed=seed,
            temperature=temperature,
        )  # fmt: skip
    write_bvh(to_source_clip(made.motion), out)
    frames = len(made.motion.positions)
    row = {"file": str(out), "frames": frames, "fps": made.motion.fps, "keys": made.frames, "model": made.model}
    line = f"{out}: {frames} frames, {frames / made.motion.fps:.2f} s, through {len(made.frames)} poses by {made.model}"
    tell(row, line, as_json=as_json)


def _shown_poses(
    con: Connection, lake: Lake, request: Request, keyframes: Sequence[str], edit: str | None,
    edges: tuple[str | None, str | None],
) -> Request:  # fmt: skip
    """The request, with the poses of keyframes, or of the clip that is edited."""
    from motionlake.stages.synthesis_edits import with_edit
    from motionlake.stages.synthesis_keys import marked, with_keyframes

    if edit is None:
        frames = [marked(text) for text in keyframes]
        sources = {name: _source(con, name) for name in dict.fromkeys(str(frame.source) for frame in frames)}
        return with_keyframes(
            con, lake, request, [replace(frame, source=sources[str(frame.source)]) for frame in frames]
        )
    if keyframes:
        raise UserError("a range of a clip is made anew (--edit), or motion through --keyframes: leave one out")
    places = [None if edge is None else _place(edge) for edge in edges]
    numbers = [None if place is None else place.value for place in places]
    first, stop = (place is not None and place.in_seconds for place in places)
    return with_edit(con, lake, request, _source(con, edit), numbers[0], numbers[1], (first, stop))


def _place(text: str) -> FrameOrSeconds:
    try:
        return frame_or_seconds(text)
    except typer.BadParameter as error:
        raise UserError(str(error)) from error


def _source(con: Connection, name: str) -> str | Path:
    """The clip of the lake, or the clip file, that a name means."""
    found = named_source(con, name)
    return found.absolute() if isinstance(found, Path) else found


def _start(lake: Lake, name: str) -> tuple[str, bool]:
    """The clip of the lake, or the clip file, that a name means, and whether it is a file."""
    with reading(lake) as con:
        found = _source(con, name)
    return str(found), isinstance(found, Path)


def _list_classes(lake: Lake, as_json: bool) -> None:
    from motionlake.stages.synthesis import class_names, served_generator

    with reading(lake) as con:
        model = served_generator(con, lake, served_config(lake))
    names = class_names(model)
    tell({"model": model.model, "classes": names}, [{"class": name} for name in names], as_json=as_json)


def _make_folder(folder: Path) -> None:
    """Make the folder; raises `UserError` where nothing can be written to it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--bvh {folder}: is no folder and cannot be made one ({error.strerror})") from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise UserError(f"--bvh {folder}: cannot be written to")


def _write_bvh(job: Session, clips: Sequence[str], folder: Path) -> int:
    """Write every clip on the canonical skeleton; returns how many files that are."""
    from motionlake.formats.write.bvh import write_bvh
    from motionlake.lake.raw import own_rig

    job.progress("bvh", 0, len(clips))
    with reading(job.lake) as con:
        dataset = clips[0].partition("/")[0] if clips else ""
        own = [row["clip"] for row in fetch(con, "clip_names") if row["clip"].startswith(f"{dataset}/")]
        names = told_apart(own, lambda name: file_name(name.partition("/")[2]))
        for done, clip in enumerate(clips, start=1):
            write_bvh(own_rig(con, job.lake, clip), folder / f"{names[clip]}.bvh")
            job.progress("bvh", done, len(clips))
    return len(clips)
