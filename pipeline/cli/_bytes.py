"""How far a download has come: a bar on a terminal, else a line every ten seconds."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final

from motionlake.cli._output import notice
from motionlake.cli._progress import SPOKEN, bars

if TYPE_CHECKING:
    from rich.progress import Progress

UNITS: Final = ("B", "kB", "MB", "GB", "TB")


def amount(size: int | None) -> str:
    """Bytes as people read them; "?" where they are not known."""
    if size is None:
        return "?"
    step = min(len(UNITS) - 1, (len(str(size)) - 1) // 3)
    value = size / 1000**step
    return f"{value:.0f} {UNITS[step]}" if value >= 100 or not step else f"{value:.1f} {UNITS[step]}"


class ByteProgress:
    """Bytes that have arrived, their rate, and what is left."""

    def __init__(self, bars: Progress | None) -> None:
        self._bars = bars
        self._tasks: dict[str, Any] = {}
        self._began: dict[str, tuple[float, int]] = {}
        self._spoke = time.monotonic()

    def __call__(self, file: str, there: int, total: int | None) -> None:
        if self._bars is not None:
            if file not in self._tasks:
                self._tasks[file] = self._bars.add_task(file, total=total, completed=there)
            self._bars.update(self._tasks[file], completed=there, total=total)
            return
        now = time.monotonic()
        began, first = self._began.setdefault(file, (now, there))
        if now - self._spoke >= SPOKEN and now > began:
            self._spoke = now
            rate = (there - first) / (now - began)
            left = f", about {(total - there) / rate:.0f} s left" if total and rate > 0 else ""
            notice(f"{file}: {amount(there)} of {amount(total)}, {amount(int(rate))}/s{left}")


@contextmanager
def byte_progress() -> Iterator[ByteProgress]:
    if not sys.stderr.isatty():
        yield ByteProgress(None)
        return
    from rich import progress

    columns = (progress.DownloadColumn(), progress.TransferSpeedColumn(), progress.TimeRemainingColumn())
    with bars(*columns) as shown:
        yield ByteProgress(shown)
