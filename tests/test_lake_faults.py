"""Real processes killed at bad moments: the same command, run again, ends in the tables of an undisturbed run."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from tests.lakes import Changed, Run, assert_same, finish, motionlake, query, quick_lake, tables
from tests.processes import Started, start, start_fresh

# What has appeared on disk, one after the other, when the driver dies.
CATALOG = ".catalog.duckdb.*.tmp"
FRAMES_MOMENTS = ((CATALOG,), ("frames/*/.*.tmp",), ("frames/*/[!.]*.parquet", CATALOG))
RUN_MOMENTS = (
    ("features/[!.]*.arrow",),
    ("models/network*",),
    ("models/network*", CATALOG),
    ("models/motifs*", CATALOG),
    ("assigned/[!.]*", CATALOG),
    ("models/postures*", CATALOG),
    ("postures/[!.]*", CATALOG),
)


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory, clips_folder: Path) -> Path:
    """Few clips in several shards, which are cut by bytes: copies of the small clips, whose texts end in blanks."""
    folder = tmp_path_factory.mktemp("many") / "many"
    for i in range(3):
        shutil.copytree(clips_folder, folder / f"copy{i}", ignore=shutil.ignore_patterns("labels.csv"))
    texts = [p for p in folder.rglob("*") if p.suffix in {".bvh", ".amc", ".skeleton", ".txt"}]
    for path in texts:
        with path.open("ab") as file:
            file.write(b"\n" * ((10 << 20) // len(texts)))
    return folder


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory, many: Path, scheduler: str) -> dict[str, list[str]]:
    lake = quick_lake(tmp_path_factory.mktemp("lakes") / "lake")
    for words in (["ingest", many], ["run", "all"]):
        run = motionlake(*words, "--lake", lake, "--scheduler", scheduler)
        assert run.status == 0, run.err
    return tables(lake)


def seen(lake: Path, pattern: str) -> set[tuple[Path, int]]:
    """Files of a pattern with their dates."""
    found = set()
    for path in lake.glob(pattern):
        with suppress(FileNotFoundError):
            found.add((path, path.stat().st_mtime_ns))
    return found


def waits_for(process: Started, lake: Path, patterns: Sequence[str]) -> bool:
    """Wait until each pattern in turn has a file it had not before; False if the process ends first."""
    for pattern in patterns:
        before = seen(lake, pattern)
        while not seen(lake, pattern) - before:
            if process.poll() is not None:
                return False
            time.sleep(0.004)
    return True


def kill_driver_at(lake: Path, words: Sequence[str | Path], moments: Sequence[Sequence[str]]) -> int:
    """Run a command once a moment and kill -9 its driver there; how many were caught alive."""
    caught = 0
    for patterns in moments:
        process = start(*words, "--workers", "1", "--lake", lake)
        if waits_for(process, lake, patterns):
            process.kill()
            caught += 1
        finish(process)
    return caught


def test_a_killed_driver(tmp_path: Path, many: Path, undisturbed: dict[str, list[str]], scheduler: str) -> None:
    lake = quick_lake(tmp_path / "lake")
    caught = kill_driver_at(lake, ["ingest", many], FRAMES_MOMENTS)
    assert motionlake("ingest", many, "--lake", lake, "--scheduler", scheduler).status == 0
    caught += kill_driver_at(lake, ["run", "all"], RUN_MOMENTS)
    for name in ("records.zip", "catalog.sums", "config.toml"):  # too short a moment to be met for sure
        (lake / f".{name}.0123456789ab.tmp").touch()
    assert motionlake("run", "all", "--lake", lake, "--scheduler", scheduler).status == 0
    assert caught >= len(FRAMES_MOMENTS) + len(RUN_MOMENTS) - 2
    assert_same(undisturbed, tables(lake))
    assert not [p for p in lake.rglob("*") if p.name.endswith(".tmp")]


def forks() -> set[psutil.Process]:
    """The processes below this one that are forks of a process that serves forks."""

    def serves(process: psutil.Process | None) -> bool:
        return process is not None and any("forkserver" in word for word in process.cmdline())

    found = set()
    for process in psutil.Process().children(recursive=True):
        with suppress(psutil.NoSuchProcess):
            if serves(process) and serves(process.parent()):
                found.add(process)
    return found


def alive(process: psutil.Process) -> bool:
    try:
        return bool(process.status() != psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return False


def kill_a_worker(starts: Callable[..., Started], words: Sequence[str | Path], lake: Path, pattern: str) -> Run:
    """kill -9 one of two workers when a file of the pattern has appeared, and let the command go on."""
    before = forks()
    process = starts(*words, "--workers", "2", "--lake", lake)
    assert waits_for(process, lake, [pattern])
    workers = [fork for fork in forks() - before if fork.pid != process.pid]
    assert len(workers) == 2
    family = psutil.Process(process.pid).children(recursive=True)
    workers[0].kill()
    process.wait(300)
    while any(map(alive, family)):
        time.sleep(0.01)  # they may say something when the driver has gone
    return finish(process)


def test_a_killed_worker(tmp_path: Path, many: Path, undisturbed: dict[str, list[str]]) -> None:
    lake = quick_lake(tmp_path / "lake")
    for run in (
        kill_a_worker(start_fresh, ["ingest", many], lake, "frames/*/*.*"),
        kill_a_worker(start, ["run", "all"], lake, "features/*"),  # half written or whole: the former may be missed
    ):
        assert run.status == 0, run.err
        assert "leaked" not in run.err
    assert_same(undisturbed, tables(lake))


def test_the_second_of_two_runs_says_so_and_exits(tmp_path: Path, many: Path) -> None:
    lake = quick_lake(tmp_path / "lake")
    first = start("ingest", many, "--workers", "1", "--lake", lake)
    while first.poll() is None and not (lake / ".lock").exists():
        time.sleep(0.001)
    while not (lake / ".lock").read_text(encoding="utf-8"):
        time.sleep(0.001)
    second = motionlake("run", "all", "--lake", lake)
    assert second.status == 2
    assert f"{lake}: the lake is being written by ingest, process {first.pid} of " in second.err
    assert len(second.err.splitlines()) == 1
    assert finish(first).status == 0


def test_searches_work_while_a_run_writes(lake: Path, many: Path) -> None:
    name = query(lake, "SELECT min(clip) FROM clips")[0][0]
    expected = motionlake("search", name, "--dataset", "clips", "-k", "3", "--json", "--lake", lake).json
    answered = 0
    writer = start("ingest", many, "--workers", "1", "--lake", lake)
    while writer.poll() is None:
        run = motionlake("search", name, "--dataset", "clips", "-k", "3", "--json", "--lake", lake)
        assert run.status == 0, run.err
        assert run.json == expected
        answered += 1
        time.sleep(0.1)  # the writer needs the processor too
    assert finish(writer).status == 0
    assert answered > 2


def test_a_catalog_held_open_for_writing_is_a_clear_error(lake: Path) -> None:

    con = Changed(lake)
    try:
        run = finish(start("status", "--lake", lake))
    finally:
        con.close()
    assert run.status == 2
    assert "close the program that has it open for writing" in run.err


def test_a_part_that_was_lost_is_a_clear_error(lake: Path, scheduler: str) -> None:
    for part in lake.glob("embeddings/*.parquet"):
        part.unlink()
    with (lake / "config.toml").open("a", encoding="utf-8") as handle:
        handle.write("seed = 5\n")
    run = motionlake("run", "all", "--lake", lake, "--scheduler", scheduler)
    assert run.status == 2
    assert len(run.err.strip().splitlines()[-1]) < 400
    assert "embeddings/" in run.err
