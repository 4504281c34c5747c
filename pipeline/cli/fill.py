"""motionlake ingest, run and remove: clips in, what is computed of them, and clips out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from motionlake.cli._output import notice, tell
from motionlake.cli._running import running
from motionlake.cli.common import (
    JsonOption,
    LakeOption,
    SchedulerOption,
    WorkersOption,
    argument,
    dataset_name,
    option,
    source_of,
)
from motionlake.errors import UserError
from motionlake.formats import readers
from motionlake.jobs import run as jobs
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.citations import read_source
from motionlake.lake.layout import Lake, check_dataset, open_lake
from motionlake.motion.rigs import load_rigs
from motionlake.names import kept
from motionlake.stages.registry import ALL, BY_NAME, dry_run
from motionlake.stages.removal import (
    Removal,
    clips_of_sources,
    gone_sources,
    remove_dataset,
    remove_sources,
    sources_of,
)
from motionlake.stages.source_files import holds_clips
from motionlake.stages.sources import AUTO, IngestOptions, Root, check_options, known_roots

SHOWN = 5  # files that a notice names


def ingest(
    sources: Annotated[
        list[Path], argument("Folders of clips, or single clip files; also such as s3://bucket/clips.", readable=False)
    ],
    lake: LakeOption,
    dataset: Annotated[str | None, typer.Option(help="Name of the dataset (default: the folder's name).")] = None,
    labels: Annotated[
        Path | None, typer.Option(help="CSV: file, label, subject, split, … (default: SRC/labels.csv).")
    ] = None,
    segments: Annotated[
        Path | None, typer.Option(help="CSV: file, start, stop, label (default: SRC/segments.csv).")
    ] = None,
    rig: Annotated[str | None, typer.Option(help="Use this rig map where it fits; auto: choose one.")] = None,
    up: Annotated[
        str | None, typer.Option(help="Axis that points up: x, y, z, -x, -y or -z; auto: that of the rig.")
    ] = None,
    unit: Annotated[
        str | None,
        typer.Option(
            help="Length unit: m, dm, cm, mm, in, ft, or metres per unit; auto: of the file, the rig or body height."
        ),
    ] = None,
    fps: Annotated[float | None, typer.Option(help="Frames a second, whatever the file says.")] = None,
    licence: Annotated[
        str | None, typer.Option(help="Licence to record with every clip (default: that of SRC/SOURCE.json).")
    ] = None,
    checksum: Annotated[bool, typer.Option(help="Hash every file again; do not trust size and date.")] = False,
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Take up rejected files again.")] = False,
    take_back: Annotated[
        bool, typer.Option("--take-back", help="Also take in what `remove --for-good` removed from this folder.")
    ] = False,
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    as_json: JsonOption = False,
) -> None:
    """Take clips into a lake, which is created if it is not there.

    Only new and changed files are read. Options of a folder hold until others are given; auto undoes one.

    Example: motionlake ingest recordings/hdm05 --lake mylake --licence CC-BY-SA-3.0

    A folder of Z-up clips in centimetres: motionlake ingest shots --lake mylake --up z --unit cm

    From a bucket: motionlake ingest s3://bucket/clips --lake mylake
    """
    options = IngestOptions(
        up=up, unit=unit, fps=fps, rig=rig, licence=licence,
        labels=str(labels.absolute()) if labels else None,
        segments=str(segments.absolute()) if segments else None,
    )  # fmt: skip
    check_options(options)
    target = Lake(lake.absolute())
    roots = [_root(source_of(source), dataset, options) for source in sources]
    _check_clips(target, roots)
    if rig not in (None, AUTO) and rig not in load_rigs(target.rigs):
        raise UserError(f"--rig {rig}: no such rig map; known are {', '.join(sorted(load_rigs(target.rigs)))}")
    with running(target, "ingest", workers, scheduler, create=True) as job:
        with reading(target) as con:
            known = {(r.dataset, r.root): r for r in known_roots(con)}
        roots = [_merged(root, known.get((root.dataset, root.root)), take_back) for root in roots]
        report = jobs.ingest(job, roots, checksum=checksum, retry_failed=retry_failed)
    for label in report.labels:
        if label.unmatched:
            example = f"; a path that matches is {label.example!r}, relative to the CSV file" if label.example else ""
            notice(
                f"{label.file}: {label.unmatched} of {label.rows} rows name no clip file; its first row names "
                f"{label.first!r}{example}"
            )
    gone = [f"{path}: its source is gone; `motionlake remove` takes it out of the lake" for path in report.gone]
    _notice_first(gone, " whose source is gone")
    outcome = report.outcome
    metrics = {
        "clips": outcome.clips, "frames": outcome.rows, "bytes": outcome.bytes, "unchanged": report.unchanged,
        "rejected": report.rejects, "failed": outcome.failed, "gone": len(report.gone),
    }  # fmt: skip
    rest = {
        "files rejected": report.rejects,
        "batches of files failed": outcome.failed,
        "source files gone": len(report.gone),
    }
    line = f"{outcome.clips} clips taken in ({outcome.rows} frames), {report.unchanged} files unchanged"
    tell(metrics, line + "".join(f", {count} {what}" for what, count in rest.items() if count), as_json=as_json)
    _notice_rejects(target, sorted({r.dataset for r in roots}))
    nothing_labelled = any(label.rows and label.unmatched == label.rows for label in report.labels)
    if not report.sound or outcome.failed or nothing_labelled:
        raise typer.Exit(1)


def _root(source: Path, dataset: str | None, options: IngestOptions) -> Root:
    if not source.exists():
        raise UserError(f"{source}: no such file or folder")
    path = source.resolve()
    folder = path.parent if path.is_file() else path
    return Root(check_dataset(dataset or kept(folder.name)), kept(path), _with_source(folder, options))


def _with_source(folder: Path, options: IngestOptions) -> IngestOptions:
    """The options with what SOURCE.json of the folder says, which is told in a line."""
    try:
        found = read_source(folder)
    except ValueError as error:
        notice(f"{error}; its licence is not taken")
        return options
    if found is None:
        return options
    file, source = found
    licence = options.licence or source.licence or "not stated"
    notice(f"{file}: {source.name}, licence {licence}" + ", citation kept" * bool(source.citation))
    return replace(options, source=source)


def _check_clips(lake: Lake, roots: Sequence[Root]) -> None:
    """Raises `UserError` where a folder holds no clip files and none of it was ever taken in."""
    known: set[tuple[str, str]] = set()
    if lake.catalog.exists():
        with reading(lake) as con:
            known = {(root.dataset, root.root) for root in known_roots(con)}
    for root in roots:
        if (root.dataset, root.root) not in known and not holds_clips(root.folder, lake):
            suffixes = sorted({suffix for reader in readers() for suffix in reader.suffixes})
            raise UserError(f"{root.root}: no clip files; motionlake reads {', '.join(suffixes)}, and .gz of each")


def _merged(root: Root, known: Root | None, take_back: bool) -> Root:
    """Options not given again stay as they were when the folder was taken in last, which is said of those that shape
    frames; "auto" undoes one."""
    given = {name: value for name, value in vars(root.options).items() if value not in (None, ())}
    known = known or Root(root.dataset, root.root, IngestOptions())
    stay = {name: value for name, value in known.options.shaping().items() if value is not None and name not in given}
    if stay:
        words = " ".join(f"--{name} {value}" for name, value in stay.items())
        undone = " ".join(f"--{name} {AUTO}" for name in stay if name != "fps")
        notice(f"{root.root}: is taken in with {words}, as before" + (f"; {undone} undoes it" if undone else ""))
    if take_back:
        given["ignored"] = ()
    given = {name: None if value == AUTO else value for name, value in given.items()}
    return replace(known, options=replace(known.options, **given))


def _notice_rejects(lake: Lake, datasets: Sequence[str]) -> None:
    with reading(lake) as con:
        rows = [{**r, "dataset": d} for d in datasets for r in fetch(con, "rejects_of", {"dataset": d})]
    places = [f"{r['dataset']}/{r['path']}" + (f", line {r['line']}" if r["line"] else "") for r in rows]
    lines = [f"rejected {place}: {r['reason']}" for place, r in zip(places, rows, strict=True)]
    _notice_first(lines, f": motionlake sql 'FROM rejects' --lake {lake.root}")


def run(
    lake: LakeOption,
    stage: Annotated[str, typer.Argument(help=f"all, or one of {', '.join(ALL + BY_NAME)}.")] = "all",
    refit: Annotated[bool, typer.Option("--refit", help="Fit the models of the stage anew.")] = False,
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Take up what failed before.")] = False,
    dataset: Annotated[str | None, option(help="Transitions of this dataset only.")] = None,
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    as_json: JsonOption = False,
) -> None:
    """Bring a lake up to date: only what is missing is computed.

    Example: motionlake run all --lake mylake

    Fit motifs to all that is in the lake now: motionlake run motifs --refit --lake mylake

    Transitions for motion graphs, which "all" leaves out: motionlake run transitions --dataset dances --lake mylake

    A generator of new motion: motionlake run synth --lake mylake
    """
    if stage != "all" and stage not in ALL + BY_NAME:
        raise UserError(f"{stage}: no such stage; use all, or one of {', '.join(ALL + BY_NAME)}")
    if dataset is not None and stage != "transitions":
        raise UserError(f"--dataset {dataset}: only transitions are made for one dataset; leave it out")
    target = open_lake(lake)
    stages = ALL if stage == "all" else (stage,)
    with running(target, f"run {stage}", workers, scheduler) as job:
        with job.reader() as at:
            outlook = dry_run(at, stages, refit=refit) if known_roots(at.con) else [_nothing(target)]
        for line in outlook:
            notice(line)
        report = jobs.run(job, stages, refit=refit, retry_failed=retry_failed, dataset=dataset)
    rows = [
        {"stage": name, "shards": o.ok, "failed": o.failed, "rows": o.rows, "bytes": o.bytes}
        for name, o in job.outcomes.items()
    ]
    tell(rows, as_json=as_json)
    if any(o.failed for o in job.outcomes.values()) or (report and not report.sound):
        raise typer.Exit(1)


def _nothing(lake: Lake) -> str:
    return f"{lake.root}: holds no clips yet; take some in with `motionlake ingest FOLDER --lake {lake.root}`"


def remove(
    lake: LakeOption,
    clips: Annotated[list[str] | None, argument("Clips, by name.")] = None,
    dataset: Annotated[
        str | None, option(help="Remove a whole dataset, or of it what --where says.", callback=dataset_name)
    ] = None,
    gone: Annotated[bool, typer.Option("--gone", help="Remove every clip whose source file is gone.")] = False,
    where: Annotated[
        str | None, option("--where", help="Clips of which this is true: a condition in SQL over the table clips.")
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say which clips would go, and remove none.")] = False,
    for_good: Annotated[
        bool, typer.Option("--for-good", help="Do not take these files in again (undo: ingest --take-back).")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Take clips out of a lake, with all that was computed of them.

    Source files are not touched. A removed clip comes back when its folder is ingested again, unless it is removed
    --for-good; `motionlake ingest FOLDER --take-back` takes it in again all the same.

    Example: motionlake remove walk_01 --lake mylake

    Example: motionlake remove --gone --lake mylake

    Example: motionlake remove --where "frames / fps < 0.5" --dry-run --lake mylake
    """
    if not clips and dataset is None and not gone and where is None:
        raise UserError("remove: name clips, or give --where CONDITION, --dataset NAME or --gone")
    target = open_lake(lake)
    clips = list(clips or [])
    if where is not None or (dry_run and dataset is not None):
        clips += _meant(target, where, dataset)
        dataset = None
    if dry_run:
        with reading(target) as con:
            going = clips_of_sources(con, sources_of(con, clips) + (gone_sources(con) if gone else []))
        tell({"would_remove": going}, "\n".join([*going, f"{len(going)} clips would be removed"]), as_json=as_json)
        return
    with running(target, "remove", damaged=True):
        removed = Removal(0, 0) if dataset is None else remove_dataset(target, dataset)
        with reading(target) as con:
            sources = sources_of(con, clips) + (gone_sources(con) if gone else [])
        removed += remove_sources(target, sources, for_good=for_good)
    if removed.files and not for_good and dataset is None:
        notice("remove: the next `motionlake ingest` of their folder takes them in again; --for-good keeps them out")
    found = {"clips": removed.clips, "files": removed.files}
    tell(found, f"{removed.clips} clips removed ({removed.files} source files forgotten)", as_json=as_json)


def _meant(lake: Lake, condition: str | None, dataset: str | None) -> list[str]:
    """The clips of which a condition is true, of one dataset or all. Raises `UserError` where there is none."""
    from motionlake.retrieval.selection import by_condition

    found = [clip.clip for clip in by_condition(lake, condition, dataset)]
    if not found:
        raise UserError("remove: there is no clip of which that is true")
    return found


def _notice_first(lines: Sequence[str], rest: str) -> None:
    """Tell the first few lines, and how many more there are of the `rest`."""
    for line in lines[:SHOWN]:
        notice(line)
    if len(lines) > SHOWN:
        notice(f"… and {len(lines) - SHOWN} more{rest}")
