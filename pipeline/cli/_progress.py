"""Progress of long work, on stderr: bars on a terminal, elsewhere a line now and then."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final

from motionlake.cli._event_log import stage_event
from motionlake.cli._output import notice

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn

SPOKEN: Final = 10  # seconds between two lines of progress where there is no terminal


class StageProgress:
    """A bar a stage on a terminal; elsewhere a line every ten seconds."""

    def __init__(self, bars: Progress | None) -> None:
        self._bars = bars
        self._tasks: dict[str, Any] = {}
        self._started: dict[str, float] = {}
        self._spoke = time.monotonic()

    def __call__(self, stage: str, done: int, total: int) -> None:
        stage_event(stage, done, total)
        if self._bars is not None:
            if stage not in self._tasks:
                self._tasks[stage] = self._bars.add_task(stage, total=total)
            self._bars.update(self._tasks[stage], completed=done, total=total)
            return
        now = time.monotonic()
        started = self._started.setdefault(stage, now)
        if now - self._spoke >= SPOKEN and 0 < done < total:
            self._spoke = now
            left = (now - started) / done * (total - done)
            notice(f"{stage}: {done} of {total}, about {left:.0f} s left")


@contextmanager
def stage_progress() -> Iterator[StageProgress]:
    if not sys.stderr.isatty():
        yield StageProgress(None)
        return
    from rich import progress

    columns = (progress.MofNCompleteColumn(), progress.TimeElapsedColumn(), progress.TimeRemainingColumn())
    with bars(*columns) as shown:
        yield StageProgress(shown)


def bars(*columns: ProgressColumn) -> Progress:
    """Bars on stderr, each with its name and these columns."""
    from rich import progress
    from rich.console import Console

    named = progress.TextColumn("{task.description:>10}", markup=False)
    return progress.Progress(named, progress.BarColumn(), *columns, console=Console(stderr=True))
