"""What it costs that a lake compares its files: `python -m bench.trust_cost OTHER`, a checkout of before.

Ingest, a cold search and scans of all frames (a cold command; ten in one process, without its start) are run by both
checkouts at the same time, each on a core of its own and on a lake that it made itself; the next round swaps the cores.
What other guests take of the machine, which varies by more than what is looked for, so meets both alike. Seconds of
the processor are those of the core, for workers are no children of the command: let nothing else run. Above 1, this
checkout takes longer.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

from bench.record import hash_files, record, recordings

HERE: Final = Path(__file__).parents[1]
Measured = Callable[[int, str, Path], tuple[float, float]]
CLOCKS: Final = ("processor", "wall")
SCAN: Final = """
import sys, time, motionlake
con = motionlake.connect(sys.argv[1])
started = time.perf_counter()
for _ in range(10):
    con.execute("SELECT sum(hash(f)) FROM frames f").fetchall()
print(time.perf_counter() - started)
"""


def used(core: int) -> float:
    """Seconds that a core has worked."""
    lines = Path("/proc/stat").read_text(encoding="utf-8").split("\n")
    user, nice, system, *_ = next(line for line in lines if line.startswith(f"cpu{core} ")).split()[1:]
    return (int(user) + int(nice) + int(system)) / os.sysconf("SC_CLK_TCK")


def said(core: int, checkout: Path, program: str, *words: object) -> str:
    """What a program of a checkout says, run on one core.

    Bytecode is kept, as it is where people work: else the checkout that has some would start sooner.
    """
    command = ["taskset", "--cpu-list", str(core), str(checkout / ".venv" / "bin" / program), *map(str, words)]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return subprocess.run(command, cwd=checkout, check=True, capture_output=True, text=True, env=environment).stdout


def run(core: int, checkout: Path, *words: object) -> tuple[float, float]:
    """Processor and wall seconds of a command."""
    before, started = used(core), time.perf_counter()
    said(core, checkout, "motionlake", *words)
    return used(core) - before, time.perf_counter() - started


def scan(core: int, checkout: Path, lake: Path) -> tuple[float, float]:
    """Wall seconds of ten scans in one process, twice."""
    seconds = float(said(core, checkout, "python", "-c", SCAN, lake))
    return seconds, seconds


def side_by_side(checkouts: Mapping[str, Path], measured: Measured, rounds: int) -> dict[str, object]:
    """Seconds of all rounds together, after one that warms up, their ratio, and its standard error over the rounds."""
    cores = sorted(os.sched_getaffinity(0))[: len(checkouts)]
    if len(cores) < len(checkouts):
        raise SystemExit(f"{len(checkouts)} cores are needed, one for each checkout")
    found: list[dict[str, tuple[float, float]]] = []
    with ThreadPoolExecutor(len(checkouts)) as threads:
        for number in range(rounds + 1):
            turned = cores[number % 2 :] + cores[: number % 2]
            running = {
                name: threads.submit(measured, core, name, checkout)
                for core, (name, checkout) in zip(turned, checkouts.items(), strict=True)
            }
            taken = {name: future.result() for name, future in running.items()}
            if number:
                found.append(taken)
    figures: dict[str, object] = {}
    for index, clock in enumerate(CLOCKS):
        seconds = {name: [taken[name][index] for taken in found] for name in checkouts}
        each = [here / before for here, before in zip(seconds["here"], seconds["before"], strict=True)]
        figures[clock] = {
            "ratio": sum(seconds["here"]) / sum(seconds["before"]),
            "standard error": statistics.stdev(each) / len(each) ** 0.5,
            **{f"{name}, a round": statistics.mean(taken) for name, taken in seconds.items()},
        }
    return figures


def measure(before: Path, source: Path, folder: Path, rounds: int) -> dict[str, dict[str, object]]:
    """Ingest, search and scan by both checkouts."""
    checkouts = {"here": HERE, "before": before}

    def command(core: int, name: str, checkout: Path, *words: object) -> tuple[float, float]:
        return run(core, checkout, *words, "--lake", folder / f"{name}-lake")

    def ingest(core: int, name: str, checkout: Path) -> tuple[float, float]:
        shutil.rmtree(folder / f"{name}-lake", ignore_errors=True)
        return command(core, name, checkout, "ingest", source, "--workers", 1)

    found = {"ingest": side_by_side(checkouts, ingest, rounds)}
    for name, checkout in checkouts.items():
        command(0, name, checkout, "run", "all")
    clip = sorted(source.rglob("*.amc"))[0].stem
    cold = {"search": ("search", clip, "-k", 3), "cold scan": ("sql", "SELECT sum(hash(f)) FROM frames f")}
    for what, words in cold.items():
        found[what] = side_by_side(checkouts, lambda *where, words=words: command(*where, *words), rounds)
    found["ten scans"] = side_by_side(
        checkouts, lambda core, name, checkout: scan(core, checkout, folder / f"{name}-lake"), rounds
    )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("other", type=Path, help="checkout of the commit before, with its .venv")
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--set", default="hdm05")
    given = parser.parse_args()
    source = recordings() / given.set / "clips"
    with tempfile.TemporaryDirectory() as folder:
        figures = measure(given.other.resolve(), source, Path(folder), given.rounds)
    for name, taken in figures.items():
        print(f"{name}: {taken}")
    print(record("trust-cost", figures, hash_files(source.rglob("*.amc"), source)))
    sys.stdout.flush()


if __name__ == "__main__":
    main()
