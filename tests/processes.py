"""The command line as processes of its own, which tests may kill."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import forkserver
from pathlib import Path
from typing import Any

# What commands and Dask's workers import: a process that has imported it all is forked in a moment.
PRELOAD = (
    "tests.processes", "distributed.http.scheduler", "numba", "pandas", "pyarrow.dataset", "rich.progress", "torch",
    "safetensors.torch", "scipy.stats", "sklearn.cluster", "typer._adapters", "motionlake.cli.fill",
    "motionlake.cli.lake", "motionlake.cli.make", "motionlake.deep_motifs.words.training",
    "motionlake.deephums.submotions", "motionlake.formats.asf_amc", "motionlake.formats.bvh",
    "motionlake.formats.write.bvh", "motionlake.formats.deepmimic", "motionlake.formats.ntu_skeleton",
    "motionlake.formats.positions_npz", "motionlake.glogen.generator", "motionlake.jobs.cluster",
    "motionlake.lake.migrations", "motionlake.pesta.dictionary_fitting",
)  # fmt: skip

# A start looks at the processes of other threads too: of two that ask at once for a status, one would get none.
_one_thread = threading.Lock()
_PAUSE = 0.005  # seconds


@dataclass(frozen=True)
class Started:
    """A command in a session of its own; what it says goes to files, which no worker that outlives it holds open."""

    pid: int
    poll: Callable[[], int | None]
    wait: Callable[[float], object]
    folder: Path

    def kill(self) -> None:
        """Kill -9."""
        if self.poll() is None:
            with suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGKILL)

    def said(self, stream: str) -> str:
        """What it has said; nothing where it was killed before it could."""
        file = self.folder / stream
        return file.read_text(encoding="utf-8") if file.exists() else ""


def serve_forks() -> None:
    """Start the process that commands and Dask's workers are forked of, unless it runs."""
    multiprocessing.set_forkserver_preload(list(PRELOAD))
    forkserver.ensure_running()


def start(*words: str | Path) -> Started:
    """A command as a fork of a process that has imported what commands need."""
    serve_forks()
    folder = Path(tempfile.mkdtemp(prefix="command-"))
    context = multiprocessing.get_context("forkserver")
    process = context.Process(target=_command, args=([*map(str, words)], _environment(), folder))

    def status() -> int | None:
        with _one_thread:
            return process.exitcode

    def wait(seconds: float) -> None:
        until = time.monotonic() + seconds
        while status() is None and time.monotonic() < until:
            time.sleep(_PAUSE)

    with _one_thread:
        process.start()
    assert process.pid
    return Started(process.pid, status, wait, folder)


def start_fresh(*words: str | Path) -> Started:
    """A command in an interpreter of its own, as people start it: in any folder, whose modules are not its own."""
    folder = Path(tempfile.mkdtemp(prefix="command-"))
    (folder / "distributed.py").write_text("raise SystemExit('not this one')", encoding="utf-8")
    with (folder / "out").open("wb") as out, (folder / "err").open("wb") as err:
        process = subprocess.Popen(
            [Path(sys.executable).with_name("motionlake"), *map(str, words)],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=err,
            start_new_session=True,
            env=_environment(),
            preexec_fn=_hear,
        )
    return Started(process.pid, process.poll, process.wait, folder)


def _hear() -> None:
    """Obey signals, whatever those who started the tests ignore."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def _environment() -> dict[str, str]:
    return {k: v for k, v in os.environ.items() if k not in ("MOTIONLAKE_DEBUG", "PYTHONSAFEPATH")}


def _command(words: list[str], environment: Mapping[str, str], folder: Path) -> None:
    os.setsid()
    _hear()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for name, stream in (("out", sys.stdout), ("err", sys.stderr)):
        with (folder / name).open("wb") as file:
            os.dup2(file.fileno(), stream.fileno())
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = ["motionlake", *words]
    # Dask's workers are forked of the process that this one was, which has imported what they need; what a killed
    # command leaves behind is its own affair.
    server: Any = forkserver
    server.resource_tracker._resource_tracker._fd = None
    server.ensure_running = server._forkserver.ensure_running = lambda: None
    from motionlake.cli.main import main

    main()
