"""How much memory a run may use, and what is said where there is too little."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from motionlake import memory
from motionlake.lake.catalog import create_catalog, reading, writing
from motionlake.lake.host import MOST_TO_WRITE
from motionlake.lake.layout import Lake
from motionlake.memory import ADDRESSES, DRIVER_BYTES, MIB, WORKER_BYTES

from tests.lakes import made_clips

MACHINE = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def limited(folder: Path, groups: str, files: dict[str, str]) -> int:
    """The memory there is by these files of control groups."""
    for name, text in files.items():
        (folder / "mounted" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "mounted" / name).write_text(text)
    (folder / "groups").write_text(groups)
    return memory.available(folder / "groups", folder / "mounted")


@pytest.mark.parametrize(
    ("groups", "files", "found"),
    [
        ("0::/a/b\n", {"a/b/memory.max": "max\n", "a/memory.max": "1073741824\n"}, 2**30),
        ("0::/a/b\n", {"a/b/memory.max": "2097152\n", "a/memory.max": "1073741824\n"}, 2**21),
        ("0::/\n", {"memory.max": "max\n"}, MACHINE),
        ("6:cpu:/x\n4:memory:/x\n0::/\n", {"memory/x/memory.limit_in_bytes": "1073741824\n"}, 2**30),
        ("4:memory:/\n", {"memory/memory.limit_in_bytes": "9223372036854771712\n"}, MACHINE),
        ("", {}, MACHINE),
    ],
)
def test_a_control_group_and_those_above_it_limit(
    groups: str, files: dict[str, str], found: int, tmp_path: Path
) -> None:
    assert limited(tmp_path, groups, files) == found


def test_there_are_no_more_workers_than_there_is_memory_for(monkeypatch: pytest.MonkeyPatch) -> None:
    def with_memory(size: int) -> tuple[int, str, str]:
        monkeypatch.setattr(memory, "available", lambda: size)
        return memory.workers_that_fit(8), memory.warning(None, 8), memory.warning(8, 8)

    assert with_memory(64 * 1024 * MIB) == (8, "", "")
    fit, told, asked = with_memory(DRIVER_BYTES + 2 * WORKER_BYTES)
    assert (fit, asked) == (2, "")
    assert told == "memory: 2 workers and not 8, for there are 2304 MiB"
    fit, told, asked = with_memory(700 * MIB)
    assert fit == 1
    assert told == asked == "memory: a run needs about 1536 MiB, there are 700"


def test_errors_for_want_of_memory_are_known(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "addresses", lambda: None)
    assert "needs about 1536 MiB" in memory.shortage(MemoryError())
    assert memory.shortage(RuntimeError("can't start new thread"))
    assert not memory.shortage(RuntimeError("another fault"))
    assert memory.for_duckdb() == {}
    assert memory.for_duckdb(96 * memory.MIB) == {"memory_limit": "96MiB"}
    monkeypatch.setattr(memory, "addresses", lambda: ADDRESSES - MIB)
    assert "4095 MiB of address space" in memory.shortage(SystemError("error return without exception set"))
    assert not memory.shortage(ValueError("another fault"))
    assert memory.for_duckdb()["memory_limit"] == memory.for_duckdb(4096 * memory.MIB)["memory_limit"] == "1023MiB"
    assert memory.for_duckdb(96 * memory.MIB)["memory_limit"] == "96MiB"


def test_a_writer_is_bounded_and_a_reader_is_not(tmp_path: Path) -> None:
    lake = Lake(tmp_path / "lake")
    create_catalog(lake)
    asked = "SELECT current_setting('memory_limit')"
    with reading(lake) as con:
        (free,) = con.execute(asked).fetchall()[0]
    with writing(lake) as con:
        assert con.execute(asked).fetchall() == [(f"{MOST_TO_WRITE / MIB:.1f} MiB",)]
    assert free != f"{MOST_TO_WRITE / MIB:.1f} MiB"


def ingest(folder: Path, limit: int) -> subprocess.CompletedProcess[str]:
    program = f"""
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, ({limit}, {limit}))
from motionlake.cli.main import main
if __name__ == "__main__":
    sys.argv = ["motionlake", "ingest", {str(folder / "clips")!r}, "--lake", {str(folder / "lake")!r}, "--workers", "1"]
    main()
"""
    words = [sys.executable, "-c", program]
    return subprocess.run(
        words, capture_output=True, text=True, check=False, timeout=300, cwd=Path(__file__).parents[1]
    )


@pytest.mark.skipif(not hasattr(resource, "RLIMIT_AS"), reason="no limit of address space here")
def test_a_lake_is_made_in_four_gibibytes_of_addresses_and_says_so_in_one(tmp_path: Path) -> None:
    made_clips(tmp_path / "clips", 1)
    run = ingest(tmp_path, 1024 * MIB)
    assert run.returncode == 2
    assert run.stderr.splitlines()[-1] == (
        "motionlake: `ulimit -v` leaves 1024 MiB of address space a process; a run needs 4096"
    )
    run = ingest(tmp_path, ADDRESSES)
    assert run.returncode == 0, run.stderr
    assert "3 clips taken in" in run.stdout
