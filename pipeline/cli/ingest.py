"""motionlake ingest."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from motionlake.cli.closing import close_run, say_rejects
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
from motionlake.formats import readers
from motionlake.jobs import run as jobs
from motionlake.jobs.session import session
from motionlake.lake.catalog import create_catalog, reading
from motionlake.lake.layout import Lake, check_dataset
from motionlake.motion.rigs import load_rigs
from motionlake.stages.ingest import with_options
from motionlake.stages.sources import IngestOptions, Root, check_options, known_roots, scan


def ingest(
    sources: Annotated[list[Path], typer.Argument(help="Folders of clips, or single clip files.", show_default=False)],
    lake: LakeOption,
    dataset: Annotated[str | None, typer.Option(help="Name of the dataset (default: the folder's name).")] = None,
    labels: Annotated[
        Path | None, typer.Option(help="CSV: file, label, subject, split, … (default: SRC/labels.csv).")
    ] = None,
    segments: Annotated[
        Path | None, typer.Option(help="CSV: file, start, stop, label (default: SRC/segments.csv).")
    ] = None,
    rig: Annotated[str | None, typer.Option(help="Use this rig map whatever the joints are called.")] = None,
    up: Annotated[str | None, typer.Option(help="Axis that points up: x, y, z, -x, -y or -z.")] = None,
    unit: Annotated[str | None, typer.Option(help="Length unit: m, dm, cm, mm, in, ft, or metres per unit.")] = None,
    fps: Annotated[float | None, typer.Option(help="Frames a second, whatever the file says.")] = None,
    licence: Annotated[str | None, typer.Option(help="Licence to record with every clip.")] = None,
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

    Only new and changed files are read.

    Example: motionlake ingest recordings/hdm05 --lake mylake --licence CC-BY-SA-3.0

    A folder of Z-up clips in centimetres: motionlake ingest shots --lake mylake --up z --unit cm
    """
    options = IngestOptions(
        up=up, unit=unit, fps=fps, rig=rig, licence=licence,
        labels=str(labels.absolute()) if labels else None,
        segments=str(segments.absolute()) if segments else None,
    )  # fmt: skip
    check_options(options)
    target = Lake(lake.absolute())
    roots = [_root(source, dataset, options) for source in sources]
    _check_clips(target, roots)
    if not target.catalog.exists():
        create_catalog(target)
    if rig is not None and rig not in load_rigs(target.rigs):
        raise UserError(f"--rig {rig}: no such rig map; known are {', '.join(sorted(load_rigs(target.rigs)))}")
    with stage_progress() as progress, session(target, "ingest", progress, notice, workers, scheduler) as job:
        with reading(target) as con:
            known = {(r.dataset, r.root): r for r in known_roots(con)}
        roots = [_merged(root, known.get((root.dataset, root.root)), take_back) for root in roots]
        report = jobs.ingest(job, roots, checksum=checksum, retry_failed=retry_failed)
        close_run(job)
    for label in report.labels:
        if label.unmatched:
            example = f"; a path that matches is {label.example!r}, relative to the CSV file" if label.example else ""
            notice(
                f"{label.file}: {label.unmatched} of {label.rows} rows name no clip file; its first row names "
                f"{label.first!r}{example}"
            )
    for path in report.gone[:5]:
        notice(f"{path}: its source is gone; `motionlake remove` takes it out of the lake")
    if len(report.gone) > 5:
        notice(f"… and {len(report.gone) - 5} more whose source is gone")
    outcome = report.outcome
    figures = {
        "clips": outcome.clips, "frames": outcome.rows, "bytes": outcome.bytes, "unchanged": report.unchanged,
        "rejected": report.rejects, "failed": outcome.failed, "gone": len(report.gone),
    }  # fmt: skip
    rest = {
        "files rejected": report.rejects,
        "batches of files failed": outcome.failed,
        "source files gone": len(report.gone),
    }
    line = f"{outcome.clips} clips taken in ({outcome.rows} frames), {report.unchanged} files unchanged"
    tell(figures, line + "".join(f", {count} {what}" for what, count in rest.items() if count), as_json=as_json)
    say_rejects(target, sorted({r.dataset for r in roots}))
    nothing_labelled = any(label.rows and label.unmatched == label.rows for label in report.labels)
    if report.rejects or outcome.failed or nothing_labelled:
        raise typer.Exit(1)


def _root(source: Path, dataset: str | None, options: IngestOptions) -> Root:
    if not source.exists():
        raise UserError(f"{source}: no such file or folder")
    path = source.resolve()
    folder = path.parent if path.is_file() else path
    return Root(check_dataset(dataset or folder.name), str(path), options)


def _check_clips(lake: Lake, roots: list[Root]) -> None:
    """Raises `UserError` where a folder holds no clip files and none of it was ever taken in."""
    known: set[tuple[str, str]] = set()
    if lake.catalog.exists():
        with reading(lake) as con:
            known = {(root.dataset, root.root) for root in known_roots(con)}
    for root in roots:
        if (root.dataset, root.root) not in known and next(scan(Path(root.root), lake), None) is None:
            suffixes = sorted({suffix for reader in readers() for suffix in reader.suffixes})
            raise UserError(f"{root.root}: no clip files; motionlake reads {', '.join(suffixes)}, and .gz of each")


def _merged(root: Root, known: Root | None, take_back: bool) -> Root:
    """Options not given again stay as they were when the folder was first taken in."""
    if known is None:
        return root
    if take_back:
        known = replace(known, options=replace(known.options, ignored=()))
    return with_options(known, **{k: v for k, v in vars(root.options).items() if v is not None})
