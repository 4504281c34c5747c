"""Threads of linear algebra: limited within a block, given back after it, also where a library comes later."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from motionlake.threads import limited
from threadpoolctl import threadpool_info


def blas_threads() -> list[int]:
    return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]


def test_a_block_limits_threads_and_gives_them_back() -> None:
    np.ones((2, 2)) @ np.ones((2, 2))
    before = blas_threads()
    if not before or max(before) < 2:
        pytest.skip("linear algebra has one thread here")
    for _ in range(2):  # the second time by what was found before
        with limited(1):
            assert set(blas_threads()) == {1}
        assert blas_threads() == before


def test_a_library_that_comes_later_is_limited_too() -> None:
    told = """
import numpy
from motionlake.threads import limited
from threadpoolctl import threadpool_info
with limited(1): pass
import scipy.linalg
with limited(1):
    print({library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"})
"""
    run = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "{1}"
