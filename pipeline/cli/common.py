"""What commands share: types of options and arguments, and what of a lake these name."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from motionlake.cli._output import notice
from motionlake.cli._progress import stage_progress
from motionlake.errors import UserError

if TYPE_CHECKING:
    from motionlake.lake.bucket import Bucket
    from motionlake.lake.catalog import Connection
    from motionlake.lake.layout import Lake
    from motionlake.retrieval.protocol import Query

# Of every typer application.
SETTINGS: Final[dict[str, Any]] = {
    "add_completion": False,
    "rich_markup_mode": None,
    "pretty_exceptions_enable": False,
    "context_settings": {"help_option_names": ["-h", "--help"]},
}


def argument(help: str, **settings: Any) -> Any:  # noqa: A002
    """An argument whose default is not shown."""
    return typer.Argument(help=help, show_default=False, **settings)


def option(*names: str, help: str, **settings: Any) -> Any:  # noqa: A002
    """An option whose default is not shown, since `help` tells it."""
    return typer.Option(*names, help=help, show_default=False, **settings)


def dataset_name(value: str | None) -> str | None:
    """Callback of options that name a dataset: raises `UserError` for what can be no dataset's name."""
    from motionlake.lake.layout import check_dataset

    return None if value is None else check_dataset(value)


def positive(param: typer.CallbackParam, value: float | None) -> float | None:
    """Callback of options whose number must be more than 0: raises `UserError` where it is not."""
    if value is not None and not value > 0:
        raise UserError(f"{param.opts[0]} {value:g}: must be more than 0")
    return value


_copies: Final[list[tuple[Path, Bucket]]] = []  # of lakes in buckets, that this process works on


def lake_folder_of(value: Path) -> Path:
    """Callback of `--lake`: its folder, or the user's copy of the lake in a bucket, up to date.

    Raises:
        UserError: the bucket cannot be read, or the copy cannot be brought up to date.
    """
    if ":" not in str(value):
        return value
    from motionlake.lake.stores import is_address

    if not is_address(value):
        return value
    from motionlake.lake.bucket import Bucket
    from motionlake.lake.cached import copy_of

    bucket = Bucket(value)
    with stage_progress() as progress:
        folder = copy_of(bucket, progress, notice)
    _copies.append((folder, bucket))
    return folder


def source_of(value: Path) -> Path:
    """A file or folder that is named, or what was fetched of an address in a bucket.

    Raises:
        UserError: nothing is there, or the bucket cannot be read.
    """
    if ":" not in str(value):
        return value
    from motionlake.lake.stores import is_address

    if not is_address(value):
        return value
    from motionlake.lake.fetched import fetched

    with stage_progress() as progress:
        return fetched(value, progress)


def publish_copies() -> None:
    """Publish what the command has changed of lakes in buckets.

    Raises:
        UserError: somebody else has published meanwhile, or the bucket cannot be written.
    """
    while _copies:
        from motionlake.lake.copies import push_changes
        from motionlake.lake.layout import Lake

        folder, bucket = _copies.pop()
        with stage_progress() as progress:
            moved = push_changes(Lake(folder), bucket, progress)
        if moved is not None:
            notice(f"{moved.address}: version {moved.version}, {moved.files} files sent, {moved.bytes / 1e6:.1f} MB")


# How a name that is both is told apart, in every help.
PATHS: Final = "where there are both, ./NAME means the file"
# What may not be read is told of with its owner, not by typer.
LakeOption = Annotated[
    Path,
    option(
        "--lake", "-l", envvar="MOTIONLAKE_LAKE", readable=False, callback=lake_folder_of,
        help="Folder of the lake, or its address in a bucket, such as s3://bucket/lake.",
    ),
]  # fmt: skip
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON, for machines.")]
ClipArgument = Annotated[str, argument(f"A clip of the lake, or a clip file; {PATHS}.")]
ClipsArgument = Annotated[list[str] | None, argument(f"Clips of the lake, or clip files; {PATHS}.")]
DatasetOption = Annotated[
    str | None, option("--dataset", help="Only clips of this dataset (default: of all).", callback=dataset_name)
]
SplitOption = Annotated[str | None, option("--split", help="Only clips of this split of labels.csv, such as train.")]
RecordedOnlyOption = Annotated[
    bool, typer.Option("--recorded-only", help="Only recorded clips, none that a generator made.")
]
MinQualityOption = Annotated[
    str | None,
    option("--min-quality", help="Only clips that `run quality` found to be ok, or at least doubtful: say which."),
]
LabelColumn = Annotated[str, typer.Option("--label-column", help="Column of labels.csv that holds the classes.")]
WorkersOption = Annotated[int | None, option("--workers", min=1, help="Local worker processes (default: one a core).")]
SchedulerOption = Annotated[
    str | None,
    option(
        "--scheduler", "--scheduler-file",
        help="A running Dask scheduler: its address, such as tcp://host:8786, or the file that it wrote.",
    ),
]  # fmt: skip


@dataclass(frozen=True)
class FrameOrSeconds:
    """A place in a clip as a person names it: a frame, from 0, or seconds from the clip's beginning."""

    value: float
    in_seconds: bool

    def frame(self, fps: float) -> int:
        """The frame it names in a clip of `fps` frames a second: the nearest one to a time."""
        from motionlake.retrieval.named_ranges import frame_at

        return frame_at(self.value, fps, in_seconds=self.in_seconds)


def frame_or_seconds(text: str) -> FrameOrSeconds:
    """Read "120" (a frame) or "3s", "1.5s" (seconds). Raises `typer.BadParameter` for anything else."""
    found = re.fullmatch(r"(\d+)|(\d+\.?\d*|\.\d+) ?s", text.strip())
    if found is None:
        raise typer.BadParameter(f"'{text}' is neither a frame, such as 120, nor seconds, such as 3s or 1.5s.")
    return FrameOrSeconds(float(found[1] or found[2]), found[1] is None)


_PLACE: Final[dict[str, Any]] = {"parser": frame_or_seconds, "metavar": "FRAME|SECONDS"}
StartOption = Annotated[
    FrameOrSeconds | None,
    option(
        "--from", help="Where to begin: a frame, as in 120, or seconds, as in 1.5s (default: the beginning).", **_PLACE
    ),
]
StopOption = Annotated[
    FrameOrSeconds | None,
    option("--to", help="Where to stop: the first frame left out, or its time, as in 3s (default: the end).", **_PLACE),
]


def named_source(con: Connection, name: str) -> str | Path:
    """The clip of the lake, or the clip file, that a person names; a notice where it might have been the other."""
    from motionlake.lake.resolve import clip_or_file, hidden_file

    found = clip_or_file(con, name)
    line = hidden_file(name, found)
    if line is not None:
        notice(line)
    return found


def named_query(
    con: Connection, lake: Lake, name: str, start: FrameOrSeconds | None = None, stop: FrameOrSeconds | None = None
) -> Query:
    """The clip of the lake, or the clip file, that a person names, and its frames from `--from` to `--to`.

    Raises:
        UserError: no such clip and no such file, or several clips.
    """
    return range_query(con, lake, named_source(con, name), start, stop)


def range_query(
    con: Connection, lake: Lake, source: str | Path, start: FrameOrSeconds | None, stop: FrameOrSeconds | None
) -> Query:
    """A clip, by its full name, or a clip file, and its frames from `--from` to `--to`."""
    from motionlake.lake.catalog import fetch
    from motionlake.retrieval.protocol import Query

    fps = 0.0
    if any(edge is not None and edge.in_seconds for edge in (start, stop)):
        if isinstance(source, Path):
            from motionlake.stages.frames import first_body

            fps = first_body(lake, source)[0].fps
        else:
            fps = fetch(con, "clip", {"clip": source})[0]["fps"]
    first, last = (None if edge is None else edge.frame(fps) for edge in (start, stop))
    return Query(source, first, last)
