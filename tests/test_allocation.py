"""Memory that a process frees is there for what it takes next."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

TAKES = """
import resource, sys
import numpy as np
from motionlake.allocation import keep_freed

kept = keep_freed() if sys.argv[1] == "keep" else None
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for frames in range(600, 900):
    held = [np.ones((frames, 21, 4)) for _ in range(4)]
    del held
print(kept, resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def faults_of_pages(how: str, **environment: str) -> tuple[str, int]:
    done = subprocess.run(
        [sys.executable, "-c", TAKES, how], capture_output=True, text=True, check=True,
        env={"PATH": "/usr/bin:/bin", **environment},
    )  # fmt: skip
    kept, faults = done.stdout.split()
    return kept, int(faults)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="of the C library of GNU")
def test_pages_are_taken_once() -> None:
    kept, few = faults_of_pages("keep")
    assert kept == "True"
    _, many = faults_of_pages("leave")
    assert few < 5_000 < many


def test_what_the_user_set_holds() -> None:
    assert faults_of_pages("keep", MALLOC_TRIM_THRESHOLD_="131072")[0] == "False"
