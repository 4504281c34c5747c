"""Several commands on one lake: who may write, what readers keep, and what signals and full disks leave."""

from __future__ import annotations

import fcntl
import gc
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
import psutil
import pytest
import torch
from distributed import Client
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from motionlake.errors import UserError
from motionlake.lake.catalog import reading
from motionlake.lake.layout import Lake, open_lake
from motionlake.lake.lock import locked
from motionlake.stopping import Stopped, held, obeying
from motionlake.training import Checkpoint, Loop

from tests.lakes import assert_same, files, finish, motionlake, query, quick_lake, tables
from tests.processes import Started, start, start_fresh

WRITERS = (
    ["init"], ["ingest", "CLIPS"], ["run", "all"], ["run", "words"], ["remove", "--dataset", "clips"],
    ["remove", "--gone"], ["train", "words"], ["synthesize", "--class", "kin"], ["migrate"],
)  # fmt: skip
BEING_WRITTEN = "motionlake: {lake}: the lake is being written by {holder}"


def says(process: Started, text: str) -> bool:
    file = process.folder / "err"
    return file.exists() and text in file.read_text(encoding="utf-8")


def waits(condition: Callable[[], object], process: Started) -> None:
    while not condition():
        assert process.poll() is None, process.said("err")
        time.sleep(0.004)


@pytest.mark.parametrize("words", WRITERS, ids=" ".join)
def test_everything_that_writes_takes_the_lock_first(
    tmp_path: Path, words: list[str], clips_folder: Path, built_lake: Path
) -> None:
    there = words[0] != "init"
    lake = Path(shutil.copytree(built_lake, tmp_path / "lake")) if there else tmp_path / "lake"
    before = tables(lake) if there else {}
    given = [str(clips_folder) if word == "CLIPS" else word for word in words]
    with locked(Lake(lake), "a test"):
        found = files(lake)
        run = motionlake(*given, "--lake", lake)
    assert run.status == 2
    assert run.err.startswith(BEING_WRITTEN.format(lake=lake, holder=f"a test, process {os.getpid()} of "))
    assert run.err.endswith(f"wait for it to end, or stop it with `kill {os.getpid()}`, then try again\n")
    assert run.err.count("\n") == 1
    assert files(lake) == found
    if there:
        assert_same(before, tables(lake))


def test_a_first_ingest_makes_no_catalog_that_another_one_makes(tmp_path: Path, clips_folder: Path) -> None:
    both = [start("ingest", clips_folder, "--workers", "1", "--lake", tmp_path / "lake") for _ in range(2)]
    runs = sorted((finish(process) for process in both), key=lambda run: run.status)
    assert runs[0].status == 0, runs[0].err
    if runs[1].status:
        assert "the lake is being written by ingest, process " in runs[1].err
        assert runs[1].err.count("\n") == 1
    assert query(tmp_path / "lake", "SELECT count(*) FROM clips")[0][0] == 15


@contextmanager
def held_by(text: bytes, lake: Path) -> Iterator[None]:
    """A lock file of some content that somebody holds."""
    with (lake / ".lock").open("wb") as handle:
        handle.write(text)
        handle.flush()
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield


JUNK = (
    b"[1]", b"\x80\xff\x00", b"[" * 5000, b"[/red]", b"{}", b'{"command": 1}', b"9" * 5000, b"x" * (1 << 20),
    b'{"command":"\\u001b[2J","process":1,"user":"u","host":"h","since":"s"}',
    b'{"command":"c","process":-1,"user":"u","host":"h","since":"s"}',
)  # fmt: skip


@given(st.sampled_from(JUNK) | st.binary(max_size=300) | st.text(max_size=50).map(str.encode))
@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_junk_in_the_lock_file_is_never_told_nor_obeyed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: bytes
) -> None:
    monkeypatch.setattr("motionlake.lake.lock._PATIENCE", 0.0)
    with held_by(text, tmp_path), pytest.raises(UserError) as refused, locked(Lake(tmp_path), "a test"):
        pass
    assert str(refused.value).startswith(f"{tmp_path}: the lake is being written by another program, which .lock does")
    with locked(Lake(tmp_path), "a test"):
        assert b"a test" in (tmp_path / ".lock").read_bytes()
    assert (tmp_path / ".lock").read_bytes() == b""


def test_a_lock_file_that_is_none_is_left_alone(tmp_path: Path) -> None:
    precious = tmp_path / "precious"
    precious.write_text("kept")
    lake = quick_lake(tmp_path / "lake")
    for make in (lambda lock: lock.symlink_to(precious), os.mkfifo, Path.mkdir):
        (lake / ".lock").unlink()
        make(lake / ".lock")
        run = motionlake("run", "all", "--lake", lake)
        assert run.status == 2
        assert f"{lake}/.lock: " in run.err
        assert run.err.count("\n") == 1
        if (lake / ".lock").is_dir():
            (lake / ".lock").rmdir()
    assert precious.read_text() == "kept"


def test_parts_stay_while_somebody_reads(lake: Path) -> None:
    part = next(lake.glob("frames/*/*.parquet"))
    with reading(open_lake(lake)) as con:
        frames = con.execute("SELECT count(*) FROM frames").fetchall()
        assert motionlake("remove", "--dataset", "clips", "--lake", lake).status == 0
        assert con.execute("SELECT count(*) FROM frames").fetchall() == frames
        assert part.exists()
    assert query(lake, "SELECT count(*) FROM clips") == [(0,)]
    assert motionlake("remove", "--gone", "--lake", lake).status == 0
    assert not part.exists(), "nobody reads any more"


def has_parts(lake: Path, count: int) -> bool:
    return len(list(lake.glob("frames/*/[!.]*.parquet"))) >= count


def family(process: Started) -> list[psutil.Process]:
    return list(psutil.Process(process.pid).children(recursive=True))


def ended(processes: list[psutil.Process]) -> bool:
    return not psutil.wait_procs(processes, timeout=20)[1]


@pytest.fixture(scope="module")
def shards(tmp_path_factory: pytest.TempPathFactory, clips_folder: Path) -> Path:
    """The small clips in several shards, which are cut by bytes: some texts end in blanks."""
    folder = Path(shutil.copytree(clips_folder, tmp_path_factory.mktemp("shards") / "shards"))
    texts = sorted(p for p in folder.rglob("*") if p.suffix in {".bvh", ".amc", ".skeleton", ".txt"})
    for path in texts:
        with path.open("ab") as file:
            file.write(b"\n" * (2 << 20))
    return folder


def test_signals_drain(tmp_path: Path, shards: Path, scheduler: str) -> None:
    lake, entered = quick_lake(tmp_path / "lake"), 0
    for number, parts in ((signal.SIGHUP, 0), (signal.SIGTERM, 2), (signal.SIGINT, 4)):
        process = start_fresh("ingest", shards, "--workers", "1", "--lake", lake)
        # The first is stopped while its cluster starts.
        waits(partial(says, process, "new or changed"), process)
        waits(partial(has_parts, lake, parts), process)
        below = family(process)
        os.kill(process.pid, number)
        run = finish(process)
        assert run.status == 128 + number
        assert "the same command goes on where this one stopped" in run.err.splitlines()[-1]
        assert "Traceback" not in run.err
        assert ended(below)
        assert not [name for name in files(lake) if ".tmp" in name]
        (now,) = query(lake, "SELECT count(*) FROM manifest WHERE state = 'ok'")[0]
        assert now >= max(entered, parts - 1), "what was done is entered"
        entered = now
    assert not query(lake, "FROM manifest WHERE state = 'failed'")
    assert motionlake("ingest", shards, "--lake", lake, "--scheduler", scheduler).status == 0
    undisturbed = quick_lake(tmp_path / "undisturbed")
    assert motionlake("ingest", shards, "--lake", undisturbed, "--scheduler", scheduler).status == 0
    assert_same(tables(undisturbed), tables(lake))


def test_a_training_goes_on_at_the_step_a_signal_stopped_it_at(tmp_path: Path) -> None:
    def train(path: Path | None, stop: int = -1) -> list[float]:
        torch.manual_seed(0)
        network, rng = torch.nn.Linear(3, 1), np.random.default_rng(0)
        optimiser = torch.optim.SGD(network.parameters(), lr=0.1)

        def step(number: int) -> float:
            if number == stop:
                os.kill(os.getpid(), signal.SIGTERM)
            loss = network(torch.from_numpy(rng.normal(size=(4, 3)).astype(np.float32))).square().mean()
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            return float(loss.detach())

        kept = None if path is None else Checkpoint(path, np.zeros(1, np.float32))
        return Loop(network, optimiser, rng, 9, step, kept).run()

    with pytest.raises(Stopped), obeying():
        train(tmp_path / "kept", 4)
    assert (tmp_path / "kept").exists()
    assert train(tmp_path / "kept") == train(None)


@pytest.fixture
def interrupts() -> Iterator[None]:
    """Interrupts are heard, as in a terminal: what a shell starts in the background ignores them."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interrupts")
def test_a_signal_waits_for_what_is_held_and_a_second_one_for_nothing() -> None:
    done = []

    def stopped() -> None:
        with held():
            os.kill(os.getpid(), signal.SIGINT)
            done.append("held")
        done.append("not this")

    with pytest.raises(Stopped), obeying():
        stopped()
    assert done == ["held"]
    child = os.fork()
    if child == 0:
        with obeying(), held():
            for _ in range(2):
                os.kill(os.getpid(), signal.SIGTERM)
                time.sleep(0.3)
            os._exit(1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 143


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_a_command_whose_work_is_done_is_not_said_to_be_killed(number: int) -> None:
    """A signal comes while it ends: what libraries registered to be done then takes a while. Not one long sleep, in
    which Python would not hear a signal that came just before it."""
    code = (
        "import atexit, signal, sys, time\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "signal.signal(signal.SIGHUP, signal.SIG_DFL)\n"  # as `nohup` would not have it
        "import motionlake.cli.main as cli\n"
        "cli.main = sys.exit\n"
        "atexit.register(lambda: (print('ends', flush=True), [time.sleep(0.05) for _ in range(1200)]))\n"
        "cli.program()"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ends\n"
        process.send_signal(number)
        assert process.wait(20) == 128 + number


def test_a_signal_where_python_drops_exceptions_comes_again(capfd: pytest.CaptureFixture[str]) -> None:
    def collected(phase: str, _info: Mapping[str, int]) -> None:
        if phase == "stop":
            gc.callbacks.remove(collected)
            signal.raise_signal(signal.SIGTERM)

    def stopped() -> None:
        gc.callbacks.append(collected)
        gc.collect()
        time.sleep(30)

    with pytest.raises(Stopped, match="SIGTERM"), obeying():
        stopped()
    assert "Traceback" not in capfd.readouterr().err


def test_a_worker_killed_while_it_starts_is_started_again(tmp_path: Path, shards: Path) -> None:
    lake = quick_lake(tmp_path / "lake")
    process = start_fresh("ingest", shards, "--workers", "1", "--lake", lake)

    def workers() -> list[psutil.Process]:
        return [p for p in family(process) if p.ppid() != process.pid]

    waits(workers, process)
    workers()[0].kill()
    run = finish(process)
    assert run.status == 0, run.err
    assert "Traceback" not in run.err


@contextmanager
def no_file_longer(size: int, process: int = 0) -> Iterator[None]:
    """A full disk, as a process meets it."""
    before = resource.prlimit(process, resource.RLIMIT_FSIZE)
    resource.prlimit(process, resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.prlimit(process, resource.RLIMIT_FSIZE, before)


def test_a_full_disk_is_told_in_a_line_and_leaves_nothing_half_made(
    tmp_path: Path, shards: Path, scheduler: str
) -> None:
    lake = tmp_path / "lake"
    with no_file_longer(100_000):
        runs = [motionlake("init", lake)]
    assert not list(lake.glob("*.duckdb"))
    quick_lake(lake)
    before = tables(lake)
    with Client(scheduler) as client:
        (worker,) = client.run(os.getpid).values()
    ingest = ("ingest", shards, "--lake", lake, "--scheduler", scheduler)
    for process, size in ((0, 200_000), (worker, 10_000)):
        with no_file_longer(size, process):
            runs.append(motionlake(*ingest))
        assert not [name for name in files(lake) if ".tmp" in name or name.endswith(".parquet")]
        if process == 0:
            assert_same(before, tables(lake))
    for run in runs:
        assert run.status == 2
        assert run.err.splitlines()[-1].startswith(f"motionlake: {lake}")
        assert "File too large; make room there" in run.err
    assert not query(lake, "FROM manifest WHERE state = 'failed'")
    assert motionlake(*ingest).status == 0
    assert query(lake, "SELECT count(*) FROM clips")[0][0] == 15


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_query_with_its_status(built_lake: Path, number: int) -> None:
    """DuckDB has an error of its own for a query that a signal cuts short."""
    run = start(
        "sql", "SELECT sum(hash(a.range + b.range)) FROM range(100000000) a, range(100000) b", "--lake", built_lake
    )
    time.sleep(3)
    os.kill(run.pid, number)
    run.wait(30)
    assert run.poll() == 128 + number, run.said("err")
    assert "the same command goes on" in run.said("err")
    finish(run)
