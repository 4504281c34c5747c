"""motionlake compose and synthesize: new motion."""

from __future__ import annotations

import os
import random
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from motionlake.cli.common import (
    DatasetOption,
    JsonOption,
    LakeOption,
    MinQualityOption,
    SchedulerOption,
    WorkersOption,
    argument,
    check_folder_of,
    dataset_name,
    named_source,
    notice,
    option,
    positive,
    running,
    tell,
    write_csv,
)
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch, reading
from motionlake.lake.layout import Lake, open_lake
from motionlake.lake.resolve import resolve_clip
from motionlake.lake.settings import served_config
from motionlake.names import file_name, json_text, told_apart

if TYPE_CHECKING:
    from motionlake.jobs.session import Session
    from motionlake.retrieval.compose import Composition, LakeGraph

SOURCE: Final = ("clip", "start", "stop", "source", "first", "last", "mirrored")  # columns of --lineage
TRIES: Final = 10  # clips that `--sample` tries to start from


def compose(
    lake: LakeOption,
    out: Annotated[Path, option("--out", "-o", help="BVH file to write.")],
    clip: Annotated[str | None, argument("Clip of the lake to start with.")] = None,
    sample: Annotated[bool, typer.Option("--sample", help="Start with a clip drawn by --seed.")] = False,
    dataset: DatasetOption = None,
    min_quality: MinQualityOption = None,
    seconds: Annotated[float, typer.Option(help="Length of the motion.", callback=positive)] = 60.0,
    seed: Annotated[int, typer.Option(min=0, help="Another seed, another walk.")] = 0,
    constraint: Annotated[
        bool,
        typer.Option("--constraint/--no-constraint", help="Jump only where both clips do alike things."),
    ] = True,
    distance_quantile: Annotated[
        float,
        typer.Option(min=0.0, max=1.0, help="Share of the possible jumps to use, most alike poses first."),
    ] = 0.5,
    context_quantile: Annotated[
        float,
        typer.Option(min=0.0, max=1.0, help="Of these, the share to keep, most alike motion first."),
    ] = 0.25,
    plant: Annotated[
        bool,
        typer.Option("--plant/--no-plant", help="Hold feet that stand in place where clips are blended."),
    ] = True,
    lineage: Annotated[Path | None, option(help="Also write where every frame comes from: .csv or .json.")] = None,
    as_json: JsonOption = False,
) -> None:
    """A new motion cut together from a dataset's clips, as BVH.

    It jumps from clip to clip where their poses and what happens around them are alike (a walk in a motion graph).

    Example: motionlake compose salsa/01 --seconds 60 --seed 1 -o new.bvh --lineage new.csv --lake mylake

    The transitions are made by: motionlake run transitions --dataset dances --lake mylake
    """
    from motionlake.formats.write.bvh import write_bvh
    from motionlake.retrieval.compose import compose as compose_motion
    from motionlake.retrieval.compose import read_graph

    target = open_lake(lake)
    check_folder_of(out)
    if lineage is not None:
        check_folder_of(lineage)
        if lineage.suffix not in (".csv", ".json"):
            raise UserError(f"--lineage {lineage}: use a name that ends in .csv or .json")
    if (clip is None) != sample:
        raise UserError("compose: name one clip to start with, or give --sample")
    with reading(target) as con:
        name = resolve_clip(con, clip) if clip is not None else None
        chosen = fetch(con, "clip", {"clip": name})[0]["dataset"] if name else _dataset(con, dataset)
        quantiles = {"distance_quantile": distance_quantile, "context_quantile": context_quantile}
        graph = read_graph(con, target, chosen, constrained=constraint, min_quality=min_quality, **quantiles)
        made = _first_made(
            lambda first: compose_motion(con, target, graph, first, seconds, seed, plant=plant),
            [name] if name else _sampled(graph, seed),
        )
    write_bvh(made.clip, out)
    rows = [asdict(source) for source in made.sources]
    if lineage is not None:
        _write_lineage(lineage, rows)
    frames, fps = len(made.clip.channels), made.clip.fps
    clips = len({source.clip for source in made.sources})
    notice(f"{out}: {frames} frames, {frames / fps:.1f} s, from {len(rows)} pieces of {clips} clips")
    found = {
        "file": str(out), "frames": frames, "fps": fps, "seconds": frames / fps, "rig": made.rig, "seed": seed,
        "constraint": constraint, "jump": made.jump, "graph": made.summary.as_row(), "lineage": rows,
    }  # fmt: skip
    shown = ("out_start", "out_stop", "clip", "start", "stop", "licence", "distance", "context_distance")
    tell(found, [{k: row[k] for k in shown} for row in rows], as_json=as_json)


def _dataset(con: Connection, wanted: str | None) -> str:
    """The dataset to draw from: the one that is named, or the only one."""
    found = [str(row["dataset"]) for row in fetch(con, "status_datasets")]
    held = f"the lake holds {', '.join(found) or 'none'}"
    if wanted is not None and wanted not in found:
        raise UserError(f"{wanted}: no such dataset; {held}")
    if wanted is None and len(found) != 1:
        raise UserError(f"--sample: say from which dataset with --dataset; {held}")
    return wanted or found[0]


def _sampled(graph: LakeGraph, seed: int) -> list[str]:
    """Some clips of the largest component in an order that the seed makes."""
    from motionlake.deep_motifs.motion_graph.graph import starts

    found = starts(graph.graph)
    if not found:
        raise UserError(
            "no clip has transitions that lead back to it; take more of them with --no-constraint or higher quantiles"
        )
    order = random.Random(seed).sample(found, min(len(found), TRIES))
    return [graph.graph.clips[clip].clip for clip in order]


def _first_made(make: Callable[[str], Composition], clips: Sequence[str]) -> Composition:
    """The motion from the first of some clips that one can be made from."""
    from motionlake.deep_motifs.motion_graph.graph import NoWalkError

    for clip in clips[:-1]:
        try:
            return make(clip)
        except NoWalkError as error:
            notice(str(error))
    return make(clips[-1])


def _write_lineage(file: Path, rows: Sequence[dict[str, Any]]) -> None:
    if file.suffix == ".json":
        file.write_text(json_text(rows) + "\n", encoding="utf-8")
    else:
        write_csv(file, list(rows[0]), [list(row.values()) for row in rows])


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
    seed: Annotated[int, typer.Option(help="Another seed, other motions.")] = 0,
    dataset: Annotated[
        str, typer.Option(help="Dataset of the new clips; it may hold no recorded ones.", callback=dataset_name)
    ] = "synthetic",
    start: Annotated[str | None, option("--from", help="Start from this clip or clip file (default: drawn).")] = None,
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

    Which classes there are: motionlake synthesize --classes --lake mylake
    """
    from motionlake.jobs import run as jobs
    from motionlake.stages.synthesis_control import Request, check_request
    from motionlake.stages.synthesis_options import begun, facing_of, path_text, timed_classes

    target = open_lake(lake)
    if classes:
        _list_classes(target, as_json)
        return
    first = begun(start, continues)
    name, outside = (None, False) if first is None else _start(target, first)
    names, shares = timed_classes(wanted or ())
    request = Request(
        names, seconds, seed, name, outside, split, pace, temperature, min_quality, shares,
        None if path is None else path_text(path), speed, facing_of(facing), loop, continues is not None,
    )  # fmt: skip
    check_request(request)
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
    there = f" ({made.there} were there already)" if made.there else ""
    first = f", {made.clips[0]} the first" if made.clips else ""
    line = (
        f"{made.made} of {count} motions made{there}: {made.seconds:.1f} s of motion by {made.model} in dataset "
        f"{dataset}{first}, in {made.wall_seconds:.1f} s; make them searchable: motionlake run all --lake {lake}"
    )
    tell(found, line, as_json=as_json)
    if len(made.clips) < count:
        raise typer.Exit(1)


def _start(lake: Lake, name: str) -> tuple[str, bool]:
    """The clip of the lake, or the clip file, that a name means, and whether it is a file."""
    with reading(lake) as con:
        found = named_source(con, name)
    return (str(found.absolute()), True) if isinstance(found, Path) else (found, False)


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
