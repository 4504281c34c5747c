"""motionlake export: clips as files, one or many, on any rig."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer
from motionlake.cli._output import check_folder_of, notice, tell
from motionlake.cli._progress import stage_progress
from motionlake.cli.common import (
    DatasetOption,
    FrameOrSeconds,
    JsonOption,
    LakeOption,
    MinQualityOption,
    StartOption,
    StopOption,
    argument,
    option,
    positive,
    range_query,
)
from motionlake.errors import ClipError, UserError
from motionlake.lake.catalog import Connection, reading
from motionlake.lake.layout import Lake, open_lake
from motionlake.lake.resolve import resolve_clip

if TYPE_CHECKING:
    from motionlake.formats.write.registry import SetWriter, Writer
    from motionlake.retrieval.export import ClipExporter
    from motionlake.retrieval.selection import ClipRange

MOST_NAMED: Final = 10  # failures that are told one by one


def export(
    lake: LakeOption,
    clips: Annotated[list[str] | None, argument("Clips of the lake.")] = None,
    where: Annotated[
        str | None, option("--where", help="Clips of which this is true: a condition in SQL over the table clips.")
    ] = None,
    query: Annotated[
        str | None, option("--sql", help="A query, or a .sql file, that answers clip and, if wanted, start and stop.")
    ] = None,
    listed: Annotated[
        Path | None,
        option("--list", help="A CSV or JSON file of clips with start and stop, if wanted: what search --json prints."),
    ] = None,
    dataset: DatasetOption = None,
    min_quality: MinQualityOption = None,
    form: Annotated[
        str, typer.Option("--format", help="bvh, csv, c3d, lerobot, and others that docs/export.md lists.")
    ] = "bvh",
    rig: Annotated[
        str | None,
        option("--rig", help="own (default), canonical, a skeleton by name, or a clip file of your character."),
    ] = None,
    fps: Annotated[
        float | None,
        option("--fps", help="Frames a second (default: the clip's own, or the format's).", callback=positive),
    ] = None,
    tpose: Annotated[bool, typer.Option("--tpose", help="Put a frame of T-pose before the motion.")] = False,
    out: Annotated[
        Path | None,
        option("--out", "-o", help="The folder; of one clip the file to write (default: CLIP.bvh here)."),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Write over files that are in the folder.")] = False,
    start: StartOption = None,
    stop: StopOption = None,
    as_json: JsonOption = False,
) -> None:
    """Write clips, or ranges of them, as files of many formats, on their own rig or on your character.

    A folder gets manifest.json, which says of every file what it is and what was done to it, and croissant.json, by
    which programs load it as a data set. Where clips could not be written the others are, and the exit status is 1.

    Example: motionlake export walk_01 --lake mylake --rig canonical --from 0s --to 4s -o walk.bvh

    All kicks on your own character, at 30 frames a second: motionlake export --where "label = 'kick'" --rig hero.bvh
    --fps 30 --tpose --out kicks --lake mylake

    What `motionlake search walk_01 --json > found.json` found: motionlake export --list found.json --format csv
    --out found --lake mylake
    """
    from motionlake.retrieval.export import ClipExporter, Treatment, target_of
    from motionlake.retrieval.selection import good_ranges

    target = open_lake(lake)
    writer = _writer(form)
    if writer.rig and rig not in (None, writer.rig):
        raise UserError(f"--rig {rig}: files of {form} always have the rig {writer.rig}")
    many = [name for name, given in (("--where", where), ("--sql", query), ("--dataset", dataset)) if given is not None]
    single = _single(clips or [], many, listed, writer, out)
    if single and min_quality is not None:
        raise UserError("--min-quality: is for many clips; one that is named is written as it is")
    if not single and (start is not None or stop is not None):
        raise UserError("--from and --to are of one clip; a list (--list) has start and stop for every clip")
    rate = fps if fps is not None else getattr(writer, "fps", None)
    treatment = Treatment(target_of(target, writer.rig or rig or "own"), rate, tpose, as_is=writer.rig)
    with reading(target) as con:
        exporter = ClipExporter(con, target, treatment)
        if single:
            _one(exporter, con, target, (clips or [])[0], start, stop, single, out, as_json=as_json)
            return
        chosen = good_ranges(con, _chosen(con, target, clips or [], where, query, listed, dataset), min_quality)
        _many(exporter, chosen, writer, out, overwrite=overwrite, as_json=as_json)


def _writer(form: str) -> Writer | SetWriter:
    from motionlake.formats.write.registry import set_writers, writers

    known: dict[str, Writer | SetWriter] = {**writers(), **set_writers()}
    if form not in known:
        raise UserError(f"--format {form}: use {', '.join(sorted(known))}")
    return known[form]


def _single(
    clips: list[str], many: list[str], listed: Path | None, writer: Writer | SetWriter, out: Path | None
) -> Writer | None:
    """The writer where one clip is to be one file."""
    from motionlake.formats.write.registry import Writer

    if not clips and not many and listed is None:
        raise UserError("name a clip, or choose clips by --where, --sql, --list or --dataset")
    folder = out is not None and out.is_dir()
    one = len(clips) == 1 and not many and listed is None and not folder
    return writer if one and isinstance(writer, Writer) else None


def _one(
    exporter: ClipExporter,
    con: Connection,
    lake: Lake,
    clip: str,
    start: FrameOrSeconds | None,
    stop: FrameOrSeconds | None,
    writer: Writer,
    out: Path | None,
    *,
    as_json: bool,
) -> None:
    from motionlake.formats.write.stems import clip_stem
    from motionlake.retrieval.selection import ClipRange

    name = resolve_clip(con, clip)
    asked = range_query(con, lake, name, start, stop)
    try:
        motion = exporter.ready(ClipRange(name, asked.start, asked.stop))
        file = out or Path(f"{clip_stem(name)}{writer.suffix}")
        if out is None and file.exists():  # the recording itself, maybe, or that of another folder
            raise UserError(f"{file}: is there already; say with --out which file to write")
        check_folder_of(file)
        writer.write(motion, file)
    except ClipError as error:
        raise UserError(f"{name}: {error.reason}") from error
    frames, fps = len(motion.clip.channels), motion.clip.fps
    found = {"clip": name, "file": str(file), "frames": frames, "fps": fps}
    tell(found, f"{file}: {frames} frames of {name}", as_json=as_json)


def _chosen(
    con: Connection,
    lake: Lake,
    clips: list[str],
    where: str | None,
    query: str | None,
    listed: Path | None,
    dataset: str | None,
) -> list[ClipRange]:
    """What the options choose together, each range once."""
    from motionlake.retrieval.selection import ClipRange, by_condition, by_query, from_list, once

    names = [resolve_clip(con, name) for name in clips]
    found = [] if listed is not None and len(names) == 1 else [ClipRange(name) for name in names]
    if where is not None or dataset is not None:
        found += by_condition(lake, where, dataset)
    if query is not None:
        text = Path(query).read_text(encoding="utf-8") if query.endswith(".sql") and Path(query).is_file() else query
        found += by_query(con, lake, text)
    if listed is not None:
        found += from_list(con, listed, names[0] if len(names) == 1 else None)
    if not found:
        raise UserError("no clip is chosen: there is none of which that is true")
    return once(found)


def _many(
    exporter: ClipExporter,
    chosen: list[ClipRange],
    writer: Writer | SetWriter,
    out: Path | None,
    *,
    overwrite: bool,
    as_json: bool,
) -> None:
    from motionlake.formats.write.registry import SetWriter
    from motionlake.retrieval.export_files import check_free, export_files, export_set, file_names

    if out is None:
        raise UserError("say with --out which folder to write into")
    names = [] if isinstance(writer, SetWriter) else list(file_names(chosen, writer.suffix).values())
    check_free(out, names, overwrite=overwrite)
    with stage_progress() as progress:
        count = partial(progress, "export")
        if isinstance(writer, SetWriter):
            done = export_set(exporter, chosen, writer, out, count)
        else:
            done = export_files(exporter, chosen, writer, out, count)
    for row in done.failed[:MOST_NAMED]:
        notice(f"not written: {row['clip']}: {row['reason']}")
    if len(done.failed) > MOST_NAMED:
        notice(f"and {len(done.failed) - MOST_NAMED} more, which manifest.json names")
    found = {"folder": str(out), "clips": done.rows, "failed": done.failed}
    tell(found, f"{out}: {len(done.rows)} of {len(chosen)} clips as {writer.name}", as_json=as_json)
    if done.failed:
        raise typer.Exit(1)
