"""Tables do not depend on who computes them: one worker or several, a local cluster or a running one."""

from __future__ import annotations

import json
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from motionlake.errors import UserError
from motionlake.jobs import cluster
from motionlake.jobs.run import run
from motionlake.jobs.session import session
from motionlake.lake.layout import open_lake
from motionlake.lake.working import deferred

from tests.lakes import assert_same, motionlake, query, quick_lake, tables
from tests.processes import serve_forks

STARTING = 60.0


@contextmanager
def process(*words: str) -> Iterator[subprocess.Popen[bytes]]:
    started = subprocess.Popen([sys.executable, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield started
    finally:
        started.terminate()
        started.wait(timeout=30)


@contextmanager
def running_cluster() -> Iterator[str]:
    """A scheduler and two workers, of one thread and of two, as processes of their own, the way people run them."""
    with closing(socket.socket()) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    words = ("-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard")
    with process(*words) as scheduler:
        for _ in range(int(STARTING / 0.1)):
            with closing(socket.socket()) as probe:
                if probe.connect_ex(("127.0.0.1", port)) == 0:
                    break
            assert scheduler.poll() is None
            time.sleep(0.1)
        worker = ("-m", "distributed.cli.dask_worker", address, "--no-dashboard", "--nthreads")
        with process(*worker, "1"), process(*worker, "2"):
            yield address


@pytest.fixture(scope="module")
def several(tmp_path_factory: pytest.TempPathFactory, clips_folder: Path) -> Path:
    """The small clips in several shards, which are cut by bytes: some texts end in blanks."""
    folder = Path(shutil.copytree(clips_folder, tmp_path_factory.mktemp("several") / "several"))
    texts = sorted(p for p in folder.rglob("*") if p.suffix in {".bvh", ".amc", ".skeleton", ".txt"})
    for path in texts[:2]:
        with path.open("ab") as file:
            file.write(b"\n" * (2 << 20))
    return folder


@pytest.fixture(scope="module")
def of_one_worker(tmp_path_factory: pytest.TempPathFactory, several: Path) -> dict[str, list[str]]:
    serve_forks()
    return build(tmp_path_factory.mktemp("lakes") / "one", several, "--workers", "1")


def build(lake: Path, source: Path, *how: str) -> dict[str, list[str]]:
    quick_lake(lake)
    for words in (["ingest", source], ["run", "all"]):
        run = motionlake(*words, "--lake", lake, *how)
        assert run.status == 0, run.err
    return tables(lake)


def test_any_number_of_workers_makes_the_same_tables(
    tmp_path: Path, several: Path, of_one_worker: dict[str, list[str]]
) -> None:
    serve_forks()
    assert_same(of_one_worker, build(tmp_path / "two", several, "--workers", "2"))
    assert query(tmp_path / "two", "SELECT count(*) > 2 FROM manifest WHERE stage = 'words'") == [(True,)]


def test_a_running_cluster_makes_the_same_tables(
    tmp_path: Path, several: Path, of_one_worker: dict[str, list[str]]
) -> None:
    with running_cluster() as address:
        assert_same(of_one_worker, build(tmp_path / "lake", several, "--scheduler", address))


def test_there_are_no_more_workers_than_shards(tmp_path: Path) -> None:
    serve_forks()
    lake = open_lake(quick_lake(tmp_path / "lake"))
    with session(lake, "test", lambda *_: None, lambda _: None, workers=2) as job:
        assert [len(job.client(shards).nthreads()) for shards in (1, 3, 1)] == [1, 2, 2]


def test_few_clips_need_no_cluster(tmp_path: Path, clips_folder: Path) -> None:
    """Stages after frames run in this process, and change the catalog once each."""
    serve_forks()
    root = quick_lake(tmp_path / "lake")
    assert motionlake("ingest", clips_folder, "--lake", root, "--workers", "1").status == 0

    with session(open_lake(root), "test", lambda *_: None, lambda _: None) as job:
        run(job, ["words", "moves"])
        assert job._client is None
        with deferred(job.lake) as work:
            assert work.all_changes == 2
    assert {row[0] for row in query(root, "SELECT DISTINCT state FROM manifest WHERE stage = 'words'")} == {"ok"}
    with session(open_lake(root), "test", lambda *_: None, lambda _: None, workers=1) as job:
        run(job, ["postures"])
        assert job._client is not None


def test_a_worker_that_cannot_see_the_lake_is_a_clear_error(
    tmp_path: Path, clips_folder: Path, scheduler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    lake = quick_lake(tmp_path / "lake")
    # The workers of another machine, as the driver meets them: the probe it wrote is not there.
    monkeypatch.setattr(Path, "write_text", lambda self, *_, **__: 0)
    run = motionlake("ingest", clips_folder, "--lake", lake, "--scheduler", scheduler)
    assert run.status == 2
    assert "cannot see the lake's folder" in run.err
    assert len(run.err.strip().splitlines()) <= 2


def test_no_scheduler_is_a_clear_error(tmp_path: Path, clips_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "_CONNECT", "1s")
    lake = quick_lake(tmp_path / "lake")
    run = motionlake("ingest", clips_folder, "--lake", lake, "--scheduler", "tcp://127.0.0.1:9")
    assert run.status == 2
    assert "no Dask scheduler answers there" in run.err


def test_a_scheduler_is_named_by_its_file(tmp_path: Path, clips_folder: Path, scheduler: str) -> None:
    """As jobs of a batch system find it; a file that no scheduler wrote, or that is not there, is one clear line."""
    file = tmp_path / "scheduler.json"
    file.write_text(json.dumps({"type": "Scheduler", "address": scheduler, "workers": {}}), encoding="utf-8")
    lake = quick_lake(tmp_path / "lake")
    assert motionlake("ingest", clips_folder, "--lake", lake, "--scheduler-file", file).status == 0
    for text in ("{}", "[]", "no JSON"):
        file.write_text(text, encoding="utf-8")
        with pytest.raises(UserError, match="it holds no address of a scheduler; give the file that"):
            cluster._address(str(file))
    file.unlink()
    with pytest.raises(UserError, match="No such file or directory; give the file that"):
        cluster._address(str(file))


def test_a_lake_may_be_moved(tmp_path: Path, lake: Path, clips_folder: Path, scheduler: str) -> None:
    moved = Path(shutil.move(lake, tmp_path / "elsewhere"))
    before = tables(moved)
    run = motionlake("run", "all", "--lake", moved, "--scheduler", scheduler, "--json")
    assert run.status == 0
    assert not any(row["shards"] for row in run.json)
    assert_same(before, tables(moved))
