"""Commands killed at random moments: `python -m bench.kills --kills 100`.

A small lake is made by `ingest` and `run`, and at a random moment of each command somebody is killed: the driver, a
worker, the process that workers are forked of, all of them, or the scheduler of a running cluster. What is left is
looked at: exit status, what was said, processes and temporary files. After some kills the commands run to their end,
and every row of every table is compared with that of an undisturbed lake.

With `--s3` lakes lie in a bucket, on a server of this process: the commands name their address, work on a copy in a
cache of its own and publish what they have done. What is compared is a copy that is pulled afterwards.

With MOTIONLAKE_DATA the clips are the smallest of three sets of recordings, else made ones.
"""

from __future__ import annotations

import argparse
import logging
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final
from unittest import mock

import psutil
from motionlake.lake.cached import cache_folder, own_name

from bench.record import record
from tests.lakes import assert_same, finish, made_clips, quick_lake, real_clips, tables
from tests.processes import Started, start, start_fresh

STAGES: Final = "all"
EACH: Final = 12  # kills of a lake, at most, before it is made to its end
LONGEST: Final = 300.0  # seconds of a command before it counts as hanging
LINGER: Final = 15.0  # seconds for its processes to end after it
# Those who are killed of a command in an interpreter of its own; others of forks of a process that has all imported.
# "all" is the whole group of processes, as Ctrl-C and `timeout` do it.
FRESH: Final = ("all", "server of forks", "scheduler")
VICTIMS: Final = (
    ("driver", signal.SIGKILL), ("driver", signal.SIGTERM), ("driver", signal.SIGINT), ("driver", signal.SIGHUP),
    ("all", signal.SIGTERM), ("all", signal.SIGINT), ("all", signal.SIGKILL), ("worker", signal.SIGKILL),
    ("worker", signal.SIGTERM), ("server of forks", signal.SIGKILL), ("scheduler", signal.SIGKILL),
)  # fmt: skip


@dataclass
class Campaign:
    """What was done, and what was wrong with it."""

    kills: Counter[str] = field(default_factory=Counter)
    statuses: Counter[str] = field(default_factory=Counter)
    lakes: int = 0
    faults: list[str] = field(default_factory=list)

    def fault(self, line: str) -> None:
        print(f"FAULT {line}", flush=True)
        self.faults.append(line)


@dataclass(frozen=True)
class Target:
    """A lake that commands write to.

    Attributes:
        name: what `--lake` says, a folder or an address.
        folder: where the files lie that commands work on.
    """

    name: str
    folder: Path

    @classmethod
    def made(cls, folder: Path, bucket: str) -> Target:
        """An empty lake in a folder, or published below the address of a bucket."""
        lake = quick_lake(folder)
        if not bucket:
            return cls(str(folder), folder)
        address = f"{bucket}/{folder.name}"
        _must("push", address, "--lake", lake)
        return cls(address, cache_folder("lakes") / own_name(address))

    def tables(self) -> dict[str, list[str]]:
        """Every table of it; of one in a bucket as somebody else gets it."""
        if self.name == str(self.folder):
            return tables(self.folder)
        copy = self.folder.with_name(f"{self.folder.name}-pulled")
        _must("pull", self.name, "--lake", copy)
        return tables(copy)


def _must(*words: str | Path) -> None:
    run = finish(start(*words))
    if run.status:
        raise RuntimeError(run.err)


@contextmanager
def bucket(wanted: bool, folder: Path) -> Iterator[str]:
    """The address of a bucket that commands find; "" where lakes are folders."""
    if not wanted:
        yield ""
        return
    from tests.object_store import BUCKET, object_store

    logging.getLogger("werkzeug").setLevel(logging.ERROR)  # a line a request
    with object_store() as store, mock.patch.dict(
        os.environ, store.environment() | {"XDG_CACHE_HOME": str(folder / "cache")}
    ):  # fmt: skip
        yield f"s3://{BUCKET}"


def sources(folder: Path, count: int) -> Path:
    """`count` clips of each of three formats, in several shards, which are cut by bytes: some texts end in blanks."""
    data = os.environ.get("MOTIONLAKE_DATA")
    real_clips(Path(data), folder, count) if data else made_clips(folder, count)
    texts = sorted(p for p in folder.rglob("*") if p.suffix in {".bvh", ".amc", ".skeleton", ".txt"})
    for path in texts[:3]:
        with path.open("ab") as file:
            file.write(b"\n" * (2 << 20))
    return folder


@contextmanager
def cluster(wanted: bool) -> Iterator[tuple[list[str], int]]:
    """Options of a command, and the scheduler of its cluster (0: it starts one of its own)."""
    if not wanted:
        yield (["--workers", "2"], 0)
        return
    with closing(socket.socket()) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    address, python = f"tcp://127.0.0.1:{port}", [sys.executable, "-m"]
    commands = (
        [*python, "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"],
        [*python, "distributed.cli.dask_worker", address, "--no-dashboard", "--nthreads", "1", "--death-timeout", "5"],
    )
    nowhere = subprocess.DEVNULL
    processes = [subprocess.Popen(c, start_new_session=True, stdout=nowhere, stderr=nowhere) for c in commands]
    try:
        yield (["--scheduler", address], processes[0].pid)
    finally:
        for process in processes:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def listens(process: Started) -> bool:
    """Whether a command has come as far as to obey signals: before, they end any interpreter as the system likes."""
    with suppress(OSError):
        caught = Path(f"/proc/{process.pid}/status").read_text("ascii").partition("SigCgt:")[2].split()[0]
        return bool(int(caught, 16) >> (signal.SIGHUP - 1) & 1)
    return False


def below(process: Started) -> list[psutil.Process]:
    """The processes of a command beside its driver: what it started, or what was forked of the server of forks here."""
    with suppress(psutil.NoSuchProcess):
        driver = psutil.Process(process.pid)
        if driver.ppid() == os.getpid():
            return list(driver.children(recursive=True))
        return [p for p in psutil.Process(driver.ppid()).children() if p.pid != process.pid]
    return []


def strike(who: str, how: int, process: Started, scheduler: int, rng: random.Random) -> bool:
    """Kill one; False where there is none such now."""
    children = below(process)
    found = {
        "driver": [process.pid],
        "scheduler": [scheduler],
        "server of forks": [p.pid for p in children if "forkserver" in _line(p) and _parent(p) == process.pid],
        "worker": [p.pid for p in children if "forkserver" in _line(p) and _parent(p) != process.pid],
        "all": [process.pid],
    }[who]
    if not found or process.poll() is not None:
        return False
    with suppress(ProcessLookupError):
        (os.killpg if who == "all" else os.kill)(rng.choice(found), how)
        return True
    return False


def _line(process: psutil.Process) -> str:
    with suppress(psutil.Error):
        return " ".join(process.cmdline())
    return ""


def _parent(process: psutil.Process) -> int:
    with suppress(psutil.Error):
        return int(process.ppid())
    return 0


def _unfinished(lake: Path) -> set[str]:
    return {path.name for path in lake.rglob("*") if ".tmp" in path.name}


def once(
    words: Sequence[str | Path],
    lake: Target,
    moment: float,
    victim: tuple[str, int],
    found: Campaign,
    rng: random.Random,
) -> bool:
    """Run a command, kill somebody at a moment, and look at what is left; whether the command did its work."""
    who, how = victim
    told = f"{signal.Signals(how).name} to {who} in {words[0]}"
    begin = start_fresh if who in FRESH else start
    before = _unfinished(lake.folder)
    with cluster(who == "scheduler") as (options, scheduler):
        run = begin(*words, *options, "--lake", lake.name)
        while not listens(run) and run.poll() is None:
            time.sleep(0.005)
        until = time.monotonic() + moment
        while time.monotonic() < until and run.poll() is None:
            time.sleep(0.005)
        family, struck = below(run), strike(who, how, run, scheduler, rng)
        while not struck and run.poll() is None:  # there is no such process yet
            time.sleep(0.005)
            family, struck = below(run), strike(who, how, run, scheduler, rng)
        found.kills[told] += struck
        ended = waited(run)
    status, said = run.poll(), run.said("err")
    found.statuses[str(status)] += 1
    _, left = psutil.wait_procs(family, timeout=LINGER)
    drained = struck and who in ("driver", "all") and how != signal.SIGKILL
    allowed = {0, 2} if who in ("scheduler", "server of forks") else {0}
    if struck and who in ("driver", "all"):
        allowed = {0, 128 + how} if drained else {0, -how}
    # One that ended well has cleared away what others left; one that was stopped leaves nothing of its own.
    rest = sorted(_unfinished(lake.folder) - (before if status else set())) if status == 0 or drained else []
    wrong = {
        "hangs": not ended, f"{len(left)} processes left": left, f"status {status}": status not in allowed,
        "a traceback": "Traceback" in said and not (who == "all" and how == signal.SIGKILL), f"{rest} left": rest,
    }  # fmt: skip
    if faults := [name for name, there in wrong.items() if there]:
        found.fault(f"{told}, after {moment:.2f} s: {', '.join(faults)}: {said[-600:]}")
    shutil.rmtree(run.folder)
    return status == 0


def waited(run: Started) -> bool:
    """Whether a command ends in time; one that does not is killed."""
    with suppress(subprocess.TimeoutExpired):
        run.wait(LONGEST)
    ended = run.poll() is not None
    run.kill()
    run.wait(LINGER)
    return ended


def undisturbed(folder: Path, source: Path, bucket: str) -> tuple[dict[str, list[str]], dict[str, float]]:
    """The tables of a lake that nobody disturbs, and the seconds of each command."""
    lake, seconds = Target.made(folder, bucket), {}
    for words in commands(source):
        began = time.monotonic()
        _must(*words, "--workers", "2", "--lake", lake.name)
        seconds[str(words[0])] = time.monotonic() - began
    return lake.tables(), seconds


def commands(source: Path) -> list[list[str | Path]]:
    return [["ingest", source], ["run", STAGES]]


def kill(kills: int, seed: int, clips: int, limit: float, *, s3: bool = False) -> dict[str, Any]:
    """All of it; at most `limit` seconds of kills."""
    found, began = Campaign(), time.monotonic()
    with tempfile.TemporaryDirectory(prefix="bench-kills-") as name, bucket(s3, Path(name)) as address:
        folder = Path(name)
        source = sources(folder / "clips", clips)
        finish(start("--version"))  # what is forked is there when commands are timed
        expected, seconds = undisturbed(folder / "undisturbed", source, address)
        rng = random.Random(seed)
        while found.kills.total() < kills and time.monotonic() - began < limit:
            lake, struck = Target.made(folder / f"lake{found.lakes}", address), 0
            for words in commands(source):
                done = False
                while not done:
                    wanted = struck < EACH and found.kills.total() < kills
                    victim = rng.choices(VICTIMS, [1 if who in FRESH else 2 for who, _ in VICTIMS])[0]
                    moment = rng.uniform(0.0, seconds[str(words[0])]) if wanted else 10 * LONGEST
                    before = found.kills.total()
                    done = once(words, lake, moment, victim if wanted else ("driver", signal.SIGKILL), found, rng)
                    struck += found.kills.total() - before
                    if not wanted and not done:
                        break
            try:
                assert_same(expected, lake.tables())
            except AssertionError as error:
                found.fault(f"lake {found.lakes}: {error}")
            found.lakes += 1
            print(f"{found.kills.total()} kills, {found.lakes} lakes, {len(found.faults)} faults", flush=True)
    return {
        "seed": seed, "kills": found.kills.total(), "by_victim": dict(sorted(found.kills.items())),
        "statuses": dict(found.statuses), "lakes_compared": found.lakes, "faults": found.faults,
        "undisturbed_seconds": seconds, "seconds": time.monotonic() - began,
        "lakes": "s3" if s3 else "folders", "clips": "recordings" if os.environ.get("MOTIONLAKE_DATA") else "made",
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description="Kill commands at random moments and compare the tables.")
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--clips", type=int, default=4, help="of each of three formats")
    parser.add_argument("--limit", type=float, default=float("inf"), help="seconds after which no lake is begun")
    parser.add_argument("--s3", action="store_true", help="lakes lie in a bucket")
    given = parser.parse_args()
    for number in (signal.SIGINT, signal.SIGHUP):  # or commands would ignore them where this one was told to
        signal.signal(number, signal.SIG_DFL)
    figures = kill(given.kills, given.seed, given.clips, given.limit, s3=given.s3)
    print(f"{figures['kills']} kills on {figures['lakes_compared']} lakes: {len(figures['faults'])} faults")
    print(record("kills", figures))
    if figures["faults"]:
        sys.exit(1)


if __name__ == "__main__":
    main()
