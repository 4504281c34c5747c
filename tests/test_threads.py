"""Threads of linear algebra: limited within a block, given back after it, also where a library comes later.

Each in a process of its own, for that of the tests has one thread anyway.
"""

from __future__ import annotations

import os
import subprocess
import sys

SAID = """
import numpy
from threadpoolctl import threadpool_info
from motionlake.threads import limited

def threads():
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}
"""


def told(code: str) -> str:
    """What a program prints whose linear algebra has two threads."""
    free = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    own = free | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "2")
    run = subprocess.run([sys.executable, "-c", SAID + code], capture_output=True, text=True, check=True, env=own)
    return run.stdout.strip()


def test_a_block_limits_threads_and_gives_them_back() -> None:
    """The second time by what was found the first time."""
    code = """
for _ in range(2):
    print(threads())
    with limited(1):
        print(threads())
print(threads())
"""
    assert told(code).splitlines() == ["{2}", "{1}", "{2}", "{1}", "{2}"]


def test_a_library_that_comes_later_is_limited_too() -> None:
    code = """
with limited(1):
    pass
before = len(threadpool_info())
import scipy.linalg
print(len(threadpool_info()) > before, threads())
with limited(1):
    print(threads())
"""
    assert told(code).splitlines() == ["True {2}", "{1}"]


def test_blocks_of_several_threads_may_overlap() -> None:
    """The first to begin ends first; a number that the other found would be no library's own."""
    code = """
one, other = limited(1), limited(1)
one.__enter__()
other.__enter__()
one.__exit__(None, None, None)
print(threads())
import scipy.linalg
with limited(1):
    print(threads())
other.__exit__(None, None, None)
print(threads())
"""
    assert told(code).splitlines() == ["{1}", "{1}", "{2}"]
