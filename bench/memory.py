"""Peak memory and processor time of a command and the processes it starts, sampled with psutil."""

from __future__ import annotations

import ctypes
import os
import resource
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import psutil

INTERVAL = 0.05  # seconds between samples
SUBREAPER: Final = 36  # of prctl: processes whose parent ended become children of this one
LINGER: Final = 10.0  # seconds for processes that a command started to end after it
FEW = 100 << 20  # helpers of multiprocessing stay far below what a worker holds


@dataclass(frozen=True)
class Usage:
    """What one command used.

    Attributes:
        seconds: from start to end, the interpreter's start included.
        status: exit status.
        driver: peak resident bytes of the command's own process.
        workers: peak resident bytes of each child process that held more than 100 MB, largest first.
        together: peak of the sum over all its processes (pages that processes share count in each).
    """

    seconds: float
    status: int
    driver: int
    workers: tuple[int, ...]
    together: int


def watch(command: Sequence[str], cwd: Path, log: Path = Path(os.devnull)) -> Usage:
    """Run a command to its end; its output goes to a file, or is dropped."""
    started = time.perf_counter()
    with log.open("wb") as said:
        child = subprocess.Popen(command, cwd=cwd, stdout=said, stderr=said)
    root = psutil.Process(child.pid)
    peaks: dict[int, int] = {}
    together = 0
    before: dict[int, int] = {}
    while child.poll() is None:
        seen = _resident(root)
        # For an instant after a fork a child shows its parent's memory: what was not there before waits.
        now = {pid: size for pid, size in seen.items() if pid in before or pid == child.pid}
        before = seen
        together = max(together, sum(now.values()))
        peaks.update({pid: max(size, peaks.get(pid, 0)) for pid, size in now.items()})
        time.sleep(INTERVAL)
    seconds = time.perf_counter() - started
    workers = sorted((size for pid, size in peaks.items() if pid != child.pid and size > FEW), reverse=True)
    return Usage(seconds, child.returncode, peaks.get(child.pid, 0), tuple(workers), together)


def _resident(root: psutil.Process) -> dict[int, int]:
    sizes: dict[int, int] = {}
    try:
        processes = [root, *root.children(recursive=True)]
    except psutil.NoSuchProcess:
        return sizes
    for process in processes:
        try:
            sizes[process.pid] = process.memory_info().rss
        except psutil.NoSuchProcess:
            continue
    return sizes


def processor_seconds() -> float:
    """User and system time so far of this process and its living children."""
    processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
    times = [p.cpu_times() for p in processes]
    return float(sum(t.user + t.system for t in times))


@contextmanager
def orphans_adopted() -> Iterator[None]:
    """What a command leaves behind becomes a child of this process, so that its time counts once it has ended."""
    prctl = ctypes.CDLL(None).prctl
    prctl(SUBREAPER, 1, 0, 0, 0)
    try:
        yield
    finally:
        prctl(SUBREAPER, 0, 0, 0, 0)


def ended_seconds(linger: float = 0.0) -> float:
    """User and system time of all processes that were started here and have ended; those that a command left behind
    are waited for, so many seconds at most."""
    until = time.monotonic() + linger
    with suppress(ChildProcessError):
        while time.monotonic() < until:
            if os.waitpid(-1, os.WNOHANG)[0] == 0:
                time.sleep(0.02)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
