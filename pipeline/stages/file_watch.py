"""Which file a worker reads: one that takes too long, or ends its process, is known by name when its shard runs again.

Python cannot stop a thread that is deep in compiled code. So a timer of the interpreter, which needs no lock, ends the
whole process of a worker; its nanny starts another, the shard runs again, and the file is rejected.
"""

from __future__ import annotations

import faulthandler
import json
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from threading import Lock
from typing import Final, TextIO

from motionlake.errors import ClipError
from motionlake.formats.limits_config import LimitError, Limits
from motionlake.stages.stage import STAGING, Shard

# Fewer than the times that Dask starts a shard anew. Once or twice, others may have ended the process.
MOST_ENDS: Final = 3
_RUN: Final = json.dumps({"run": "again"}) + "\n"
_TIMED_OUT: Final = "Timeout ("  # how the interpreter's timer begins its report
# Whether this process is a worker that is started again when it ends.
replaceable: Final[ContextVar[bool]] = ContextVar("replaceable", default=False)

_deadlines: Final[dict[TextIO, float]] = {}  # of the files that threads of this process read, by their journals
_lock: Final = Lock()


def at_fault(root: Path, shard: Shard) -> set[str]:
    """The files of a shard that its next run will reject for what they did to the runs before."""
    path = journal_of(root, shard)
    if not path.is_file():
        return set()
    slow, ends = _faults(path.read_text(encoding="utf-8", errors="replace") + _RUN)
    return {*slow, *(name for name, times in ends.items() if times >= MOST_ENDS)}


def journal_of(root: Path, shard: Shard) -> Path:
    """Where a shard's files are entered while they are read; gone when it is done."""
    return root / STAGING / f"reading-{shard.key[:16]}.jsonl"


class FileWatch:
    """The files of one shard.

    Attributes:
        slow: files in which earlier runs of the shard ran out of time, with the seconds that they had.
        ends: how often the process ended while it read a file.
    """

    def __init__(self, journal: TextIO, before: str, limits: Limits) -> None:
        self._journal, self._limits = journal, limits
        self.slow, self.ends = _faults(before)

    @contextmanager
    def reading(self, path: str) -> Iterator[None]:
        """Enter a file; `ClipError` where it ended earlier runs."""
        if path in self.slow:
            raise LimitError("seconds", self.slow[path], f"takes more than {self.slow[path]} s to read")
        if self.ends[path] >= MOST_ENDS:
            raise ClipError(f"ended the process that reads it {self.ends[path]} times: it may need too much memory")
        print(json.dumps({"reads": path, "seconds": self._limits.seconds}), file=self._journal, flush=True)
        with self._in_time():
            yield

    @contextmanager
    def _in_time(self) -> Iterator[None]:
        if not replaceable.get() or not self._limits.seconds:
            yield
            return
        _set(self._journal, time.monotonic() + self._limits.seconds)
        try:
            yield
        finally:
            _set(self._journal, None)


def _set(journal: TextIO, deadline: float | None) -> None:
    """Enter or drop a thread's deadline, and let the timer run to the nearest."""
    with _lock:
        if deadline is None:
            del _deadlines[journal]
        else:
            _deadlines[journal] = deadline
        if not _deadlines:
            faulthandler.cancel_dump_traceback_later()
            return
        nearest = min(_deadlines, key=_deadlines.__getitem__)
        left = max(_deadlines[nearest] - time.monotonic(), 0.001)
        faulthandler.dump_traceback_later(left, exit=True, file=nearest)


def _faults(journal: str) -> tuple[dict[str, int], Counter[str]]:
    """What a journal tells of runs that did not end well.

    Returns:
        By file: the seconds that were not enough for it, and how often the process ended while it was read.
    """
    slow: dict[str, int] = {}
    ends: Counter[str] = Counter()
    last: dict[str, object] = {}
    for line in journal.splitlines():
        if line.startswith(_TIMED_OUT) and last:
            slow[str(last["reads"])] = int(str(last["seconds"]))
            last = {}
        try:
            entry = json.loads(line)
        except ValueError:
            continue
        if "run" in entry and last:
            ends[str(last["reads"])] += 1
        last = {} if "run" in entry else entry
    return slow, ends


@contextmanager
def watching(root: Path, shard: Shard, limits: Limits) -> Iterator[FileWatch]:
    """Watch the files of a shard while this runs."""
    path = journal_of(root, shard)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+", encoding="utf-8", errors="surrogateescape") as journal:
        journal.write(_RUN)
        journal.flush()
        journal.seek(0)
        try:
            yield FileWatch(journal, journal.read(), limits)
        finally:
            path.unlink(missing_ok=True)
