"""Kernels on disk: one process at a time reads and writes them, for numba alone would mix those of two."""

from __future__ import annotations

import fcntl
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import TimeoutError as NotYet
from pathlib import Path

import pytest
from motionlake import compiler
from numba.core.compiler_lock import global_compiler_lock

FILE = Path(compiler.__file__)


def take(file: int) -> None:
    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def compile_something() -> None:
    with global_compiler_lock, global_compiler_lock:
        pass


@pytest.fixture
def file() -> int:
    return os.open(FILE, os.O_RDONLY)


def test_who_compiles_shuts_out_other_processes(file: int) -> None:
    with global_compiler_lock:
        with global_compiler_lock, pytest.raises(BlockingIOError):
            take(file)
        with pytest.raises(BlockingIOError):
            take(file)
    fcntl.flock(file, fcntl.LOCK_EX)  # waits for other tests' processes, not for this one
    os.close(file)


def test_who_compiles_waits_for_other_processes(file: int) -> None:
    fcntl.flock(file, fcntl.LOCK_EX)
    with ThreadPoolExecutor(1) as pool:
        compiled = pool.submit(compile_something)
        with pytest.raises(NotYet):
            compiled.result(timeout=0.2)
        os.close(file)
        compiled.result(timeout=60)


def test_nobody_waits_for_a_stopped_process_for_good(file: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiler, "_PATIENCE", 0.1)
    fcntl.flock(file, fcntl.LOCK_EX)
    compile_something()
    os.close(file)


def test_kernels_import_no_linear_algebra_and_can_have_it() -> None:
    code = """
import sys
import numpy as np
from motionlake.compiler import njit
total = njit(lambda row: row.sum())
assert total(np.ones(3)) == 3
print(*sys.modules)
product = njit(lambda a, b: a @ b)
assert (product(np.eye(2), np.ones((2, 2))) == 1).all()
from numba.np import linalg
assert linalg.ensure_blas.__module__ == linalg.__name__
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert not {name for name in run.stdout.split() if name.startswith("scipy.linalg")}
