"""What commands share: the option types, output for people or machines, progress on stderr."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

LakeArgument = Annotated[Path, typer.Argument(help="Folder of the lake.", show_default=False)]
LakeOption = Annotated[
    Path, typer.Option("--lake", "-l", envvar="MOTIONLAKE_LAKE", help="Folder of the lake.", show_default=False)
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON, for machines.")]
RealOption = Annotated[bool, typer.Option("--real", help="Leave synthetic clips out.")]
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


def notice(line: str) -> None:
    """Tell a person something while a command runs."""
    print(line, file=sys.stderr, flush=True)


def print_json(value: Any) -> None:
    print(json.dumps(value, ensure_ascii=False, indent=2, default=str))


def print_rows(rows: Sequence[Mapping[str, Any]], *, as_json: bool) -> None:
    """Rows as a table for people, or as a JSON array."""
    if as_json:
        print_json(list(rows))
        return
    if not rows:
        notice("no rows")
        return
    table = Table(box=None, pad_edge=False, header_style="bold")
    for name, value in rows[0].items():
        table.add_column(name, justify="right" if isinstance(value, int | float) else "left", overflow="fold")
    for row in rows:
        table.add_row(*(_cell(v) for v in row.values()))
    Console(width=None if sys.stdout.isatty() else 200, highlight=False).print(table)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


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
    columns = (TextColumn("{task.description:>10}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True)) as bars:
        yield StageProgress(bars)
