"""Runs tests in forks of a process that has imported what they need from elsewhere: `python fork_tests.py`.

Each line of its input is a JSON object: `tests`, `cache` (folder of compiled kernels), `log` (file) and `seconds`. Each
is answered by a line with how the tests ended, "passed", "failed" or "timed out", and the seconds of the processor that
they took. It imports nothing of the project, which is other in every fork.
"""

from __future__ import annotations

import importlib
import json
import os
import resource
import signal
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

PRELOAD: Final = (
    "numpy", "numba", "scipy.stats", "scipy.optimize", "scipy.spatial", "pyarrow.dataset", "pyarrow.parquet", "duckdb",
    "torch", "safetensors.torch", "sklearn.cluster", "pandas", "dask", "distributed", "distributed.http.scheduler",
    "threadpoolctl", "typer", "rich.progress", "pydivsufsort", "hypothesis.extra.numpy", "pytest", "xdist",
)  # fmt: skip
SLOW: Final = {"scheduler", "built_lake", "recordings"}  # what tests ask for that take long
_PAUSE: Final = 0.02  # seconds
_ENOUGH: Final = 30  # times the seconds of the processor, by the clock: a machine may have more to do


class Quick:
    """Leaves out tests that need a lake that commands have made, or a set of recordings."""

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        items[:] = [item for item in items if not SLOW & set(item.fixturenames)]


def serve() -> None:
    for name in PRELOAD:
        with suppress(ImportError):
            importlib.import_module(name)
    for line in sys.stdin:
        print(json.dumps(_run(**json.loads(line))), flush=True)


def _run(tests: list[str], cache: str, log: str, seconds: int) -> tuple[str, float]:
    """How tests end, and the seconds of the processor that they took."""
    child = os.fork()
    if child == 0:
        status = 70
        try:
            os.setsid()
            resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
            status = _pytest(tests, cache, Path(log))
        finally:
            os._exit(status)
    until = time.monotonic() + _ENOUGH * seconds
    done, status, used = os.wait4(child, os.WNOHANG)
    while not done and time.monotonic() < until:
        time.sleep(_PAUSE)
        done, status, used = os.wait4(child, os.WNOHANG)
    with suppress(ProcessLookupError):  # the tests' own processes, where they left some
        os.killpg(child, signal.SIGKILL)
    if not done:
        _, status, used = os.wait4(child, 0)
    spent = round(used.ru_utime + used.ru_stime, 2)
    if not done or (os.WIFSIGNALED(status) and spent >= seconds - 1):
        return "timed out", spent
    return "passed" if status == 0 else "failed", spent


def _pytest(tests: list[str], cache: str, log: Path) -> int:
    """Run tests in a fork, to the first that fails; hypothesis draws the same each time, and shrinks nothing."""
    file = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
    for stream in (1, 2):
        os.dup2(file, stream)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    import numba
    import pytest
    from hypothesis import Phase, settings

    os.environ["NUMBA_CACHE_DIR"] = numba.config.CACHE_DIR = cache
    phases = (Phase.explicit, Phase.generate)
    settings.register_profile("mutation", deadline=None, database=None, derandomize=True, phases=phases)
    with tempfile.TemporaryDirectory(prefix="mutation-tests-") as folder:
        options: list[Any] = ["-x", "-q", "-n0", "-p", "no:cacheprovider", "--hypothesis-profile", "mutation"]
        return int(pytest.main([*options, "--durations", "5", "--basetemp", f"{folder}/base", *tests], [Quick()]))


if __name__ == "__main__":
    serve()
