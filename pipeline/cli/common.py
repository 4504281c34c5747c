"""What commands share: the option types, output for people or machines, progress on stderr."""

from __future__ import annotations

import json
import re
import sys
import time
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from motionlake.errors import UserError

if TYPE_CHECKING:
    from motionlake.lake.catalog import Connection
    from motionlake.lake.layout import Lake
    from motionlake.retrieval.protocol import Query, Scope
    from rich.progress import Progress

# Of every typer application.
SETTINGS: Final[dict[str, Any]] = {
    "add_completion": False,
    "rich_markup_mode": None,
    "pretty_exceptions_enable": False,
    "context_settings": {"help_option_names": ["-h", "--help"]},
}
LakeOption = Annotated[
    Path, typer.Option("--lake", "-l", envvar="MOTIONLAKE_LAKE", help="Folder of the lake.", show_default=False)
]
# For commands on a lake alone, which name its folder as the argument or as elsewhere.
FolderArgument = Annotated[Path | None, typer.Argument(help="Folder of the lake.", show_default=False)]
FolderOption = Annotated[
    Path | None,
    typer.Option("--lake", "-l", envvar="MOTIONLAKE_LAKE", help="The same, as elsewhere.", show_default=False),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON, for machines.")]
KOption = Annotated[int, typer.Option("-k", min=1, help="How many answers.")]
DatasetOption = Annotated[
    str | None, typer.Option("--dataset", help="Only clips of this dataset (default: of all).", show_default=False)
]
SplitOption = Annotated[
    str | None,
    typer.Option("--split", help="Only clips of this split of labels.csv, such as train.", show_default=False),
]
MirroredOption = Annotated[
    bool, typer.Option("--mirrored", help="Look for the mirror image too: left and right exchanged.")
]
OwnOption = Annotated[
    bool, typer.Option("--own", help="The query itself may be an answer, where it is a clip of the lake.")
]
RecordedOnlyOption = Annotated[
    bool, typer.Option("--recorded-only", help="Only recorded clips, none that a generator made.")
]
LabelColumn = Annotated[str, typer.Option("--label-column", help="Column of labels.csv that holds the classes.")]
WorkersOption = Annotated[
    int | None,
    typer.Option("--workers", min=1, help="Local worker processes (default: one a core).", show_default=False),
]
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        "--scheduler", help="Address of a running Dask scheduler, such as tcp://host:8786.", show_default=False
    ),
]


@dataclass(frozen=True)
class FrameOrSeconds:
    """A place in a clip as a person names it: a frame, from 0, or seconds from the clip's beginning."""

    value: float
    in_seconds: bool

    def frame(self, fps: float) -> int:
        """The frame it names in a clip of `fps` frames a second: the nearest one to a time."""
        return round(self.value * fps) if self.in_seconds else int(self.value)


def frame_or_seconds(text: str) -> FrameOrSeconds:
    """Read "120" (a frame) or "3s", "1.5s" (seconds).

    Raises:
        typer.BadParameter: it is neither.
    """
    found = re.fullmatch(r"(\d+)|(\d+\.?\d*|\.\d+) ?s", text.strip())
    if found is None:
        raise typer.BadParameter(f"'{text}' is neither a frame, such as 120, nor seconds, such as 3s or 1.5s.")
    return FrameOrSeconds(float(found[1] or found[2]), found[1] is None)


StartOption = Annotated[
    FrameOrSeconds | None,
    typer.Option(
        "--from", parser=frame_or_seconds, metavar="FRAME|SECONDS", show_default=False,
        help="Where to begin: a frame, as in 120, or seconds, as in 1.5s (default: the beginning).",
    ),
]  # fmt: skip
StopOption = Annotated[
    FrameOrSeconds | None,
    typer.Option(
        "--to", parser=frame_or_seconds, metavar="FRAME|SECONDS", show_default=False,
        help="Where to stop: the first frame left out, or its time, as in 3s (default: the end).",
    ),
]  # fmt: skip


def asked_for(
    con: Connection, lake: Lake, name: str, start: FrameOrSeconds | None = None, stop: FrameOrSeconds | None = None
) -> Query:
    """The clip file, or the clip of the lake, that a person names, and its frames from `--from` to `--to`.

    Raises:
        UserError: no such clip and no such file, or several clips.
    """
    from motionlake.retrieval.protocol import query_of

    query, fps = query_of(con, name), 0.0
    if any(edge is not None and edge.in_seconds for edge in (start, stop)):
        if isinstance(query.source, Path):
            from motionlake.retrieval.encode import first_body

            fps = first_body(lake, query.source)[0].fps
        else:
            from motionlake.lake.catalog import fetch

            fps = fetch(con, "clip", {"clip": query.source})[0]["fps"]
    first, last = (None if edge is None else edge.frame(fps) for edge in (start, stop))
    return replace(query, start=first, stop=last)


def scope_of(dataset: str | None, split: str | None = None, recorded_only: bool = False, **others: bool) -> Scope:
    """Which clips the options of a command leave as answers. Raises `UserError` for what can be no dataset's name."""
    from motionlake.lake.layout import check_dataset
    from motionlake.retrieval.protocol import Scope

    if dataset is not None:
        check_dataset(dataset)
    return Scope(dataset, split, recorded_only, **others)


def named_folder(context: typer.Context, folder: Path | None, lake: Path | None) -> Path:
    """The folder that a command names one way or the other. Raises `UserError` where it names none or two."""
    if folder and lake and folder != lake and str(context.get_parameter_source("lake")).endswith("COMMANDLINE"):
        raise UserError(f"{context.info_name}: {folder} and --lake {lake} are two folders; name one")
    chosen = folder or lake
    if chosen is None:
        raise UserError(
            f"{context.info_name}: name the folder of the lake, as in `motionlake {context.info_name} mylake`"
        )
    return chosen


def check_positive(option: str, value: float | None) -> None:
    """Raises `UserError` where the value given for an option is not more than 0."""
    if value is not None and not value > 0:
        raise UserError(f"{option} {value:g}: must be more than 0")


def printable(text: str) -> str:
    """Text in which characters that a terminal would obey (escapes, line ends, turns of direction) are spelled out."""
    return "".join(
        c.encode("unicode_escape").decode() if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp") else c
        for c in text
    )


def notice(line: str) -> None:
    """Tell a person something while a command runs."""
    print(printable(line), file=sys.stderr, flush=True)


def print_json(value: Any) -> None:
    print(json.dumps(value, ensure_ascii=False, indent=2, default=str))


def tell(value: Any, shown: str | Sequence[Mapping[str, Any]] | None = None, *, as_json: bool) -> None:
    """The answer of a command: `value` as JSON for machines, else `shown` (default: `value`), a line or a table."""
    answer = value if shown is None else shown
    if as_json:
        print_json(value)
    elif isinstance(answer, str):
        print(printable(answer))
    else:
        print_rows(answer, as_json=False)


def tell_hits(rows: Sequence[Mapping[str, Any]], *, mirrored: bool, as_json: bool) -> None:
    """Answers of a search; a table says which are `mirrored` only where mirror images were looked for."""
    tell(rows, [{n: v for n, v in row.items() if mirrored or n != "mirrored"} for row in rows], as_json=as_json)


def print_rows(rows: Sequence[Mapping[str, Any]], *, as_json: bool) -> None:
    """Rows as a table for people, or as a JSON array."""
    if as_json:
        print_json(list(rows))
        return
    if not rows:
        notice("no rows")
        return
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    for name, value in rows[0].items():
        table.add_column(
            printable(name), justify="right" if isinstance(value, int | float) else "left", overflow="fold"
        )
    for row in rows:
        table.add_row(*(_cell(v) for v in row.values()))
    width = None if sys.stdout.isatty() else 200
    Console(width=width, highlight=False, markup=False, emoji=False).print(table)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else printable(str(value))


class StageProgress:
    """A bar a stage on a terminal; elsewhere a line every ten seconds."""

    def __init__(self, bars: Progress | None) -> None:
        self._bars = bars
        self._tasks: dict[str, Any] = {}
        self._started: dict[str, float] = {}
        self._spoke = time.monotonic()

    def __call__(self, stage: str, done: int, total: int) -> None:
        if self._bars is not None:
            if stage not in self._tasks:
                self._tasks[stage] = self._bars.add_task(stage, total=total)
            self._bars.update(self._tasks[stage], completed=done, total=total)
            return
        now = time.monotonic()
        started = self._started.setdefault(stage, now)
        if now - self._spoke >= 10 and 0 < done < total:
            self._spoke = now
            left = (now - started) / done * (total - done)
            notice(f"{stage}: {done} of {total}, about {left:.0f} s left")


@contextmanager
def stage_progress() -> Iterator[StageProgress]:
    if not sys.stderr.isatty():
        yield StageProgress(None)
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn("{task.description:>10}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True)) as bars:
        yield StageProgress(bars)
