"""How much memory there is for a run: of the machine, its control group, and each process's address space."""

from __future__ import annotations

import os
import resource
from pathlib import Path
from typing import Final

from motionlake.errors import UserError

MIB: Final = 2**20
# Measured on 287 clips: once networks are loaded, driver and workers take 854 and 640 MiB, some of which they share.
DRIVER_BYTES: Final = 768 * MIB
WORKER_BYTES: Final = 768 * MIB
# Threads, libraries and the networks reserve more addresses than memory: 3,809 MiB in the driver of `run all`.
ADDRESSES: Final = 4096 * MIB
# With less, Arrow ends the process at some place without a word of ours.
LEAST_ADDRESSES: Final = 2048 * MIB
_GROUPS: Final = Path("/proc/self/cgroup")
_MOUNTED: Final = Path("/sys/fs/cgroup")
# What libraries say, each in its way, when memory cannot be had.
_SIGNS: Final = ("failed to map segment", "Cannot allocate memory", "can't allocate memory", "malloc of size",
                 "Out of Memory", "bad_alloc", "can't start new thread")  # fmt: skip
# What they raise where they say nothing of memory.
_WITHOUT_WORDS: Final = (OSError, ImportError, RuntimeError, SystemError)


def available(groups: Path = _GROUPS, mounted: Path = _MOUNTED) -> int:
    """Bytes that all processes of this control group may hold together: the machine's where nothing limits them."""
    found = [os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")]
    try:
        lines = groups.read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if controllers not in ("", "memory"):
            continue
        top = mounted if not controllers else mounted / "memory"
        name = "memory.max" if not controllers else "memory.limit_in_bytes"
        group = top / path.lstrip("/")
        for folder in (folder for folder in (group, *group.parents) if folder.is_relative_to(top)):
            found += _number(folder / name)
    return min(found)


def _number(file: Path) -> list[int]:
    """What a file of a control group limits to: nothing where it says "max" or is not there."""
    try:
        return [int(file.read_text(encoding="utf-8"))]
    except (OSError, ValueError):
        return []


def addresses() -> int | None:
    """Bytes of address space that this process may have (`ulimit -v`); None: any number."""
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    return None if soft == resource.RLIM_INFINITY else soft


def workers_that_fit(wanted: int) -> int:
    """At most so many workers as there is memory for, one at the least."""
    return max(1, min(wanted, (available() - DRIVER_BYTES) // WORKER_BYTES))


def warning(asked: int | None, cores: int) -> str:
    """What to tell before a run with as many workers as the user asked for, or one a core; "" where all is well."""
    there, fit = available(), workers_that_fit(cores)
    if there < DRIVER_BYTES + WORKER_BYTES:
        return f"memory: a run needs about {(DRIVER_BYTES + WORKER_BYTES) // MIB} MiB, there are {there // MIB}"
    if asked is None and fit < cores:
        return f"memory: {fit} worker{'s' * (fit > 1)} and not {cores}, for there are {there // MIB} MiB"
    return ""


def check_addresses() -> None:
    """Raises `UserError` where a process may have too little address space to make a lake."""
    limit = addresses()
    if limit is not None and limit < LEAST_ADDRESSES:
        raise UserError(
            f"`ulimit -v` leaves {limit // MIB} MiB of address space a process; a run needs {ADDRESSES // MIB}"
        )


def for_duckdb(most: int | None = None) -> dict[str, str]:
    """Settings that keep DuckDB within so many bytes, and within a limited address space, at which it does not look."""
    limit = addresses()
    bounds = [bound for bound in (most, limit and limit // 4) if bound]
    return {"memory_limit": f"{min(*bounds, available() * 4 // 5) // MIB}MiB"} if bounds else {}


def shortage(error: BaseException) -> str:
    """What to tell of an error that comes of too little memory; "" where it does not look so."""
    limit, there = addresses(), available()
    short = limit is not None and limit < ADDRESSES and isinstance(error, _WITHOUT_WORDS)
    if not (short or isinstance(error, MemoryError) or any(sign in str(error) for sign in _SIGNS)):
        return ""
    needs = (DRIVER_BYTES + WORKER_BYTES) // MIB
    told = f"out of memory: a run needs about {needs} MiB, and {WORKER_BYTES // MIB} for each further worker"
    told += f"; there are {there // MIB} MiB"
    if limit is not None:
        told += (
            f", and {limit // MIB} MiB of address space a process (`ulimit -v`), of which it needs {ADDRESSES // MIB}"
        )
    return told
