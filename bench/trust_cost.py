"""What it costs that a lake compares its files: `python -m bench.trust_cost OTHER`, a checkout of before.

Ingest, a cold search and scans of all frames (a cold command; ten in one process, without its start) are run in turn by
the two checkouts, each on a lake that it made itself. Seconds of the processor are the whole machine's, for workers are
no children of the command: let nothing else run. Above 1, this checkout takes longer.
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
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Final

from bench.record import hash_files, record, recordings

HERE: Final = Path(__file__).parents[1]
CLOCKS: Final = ("processor", "wall")
SCAN: Final = """
import sys, time, motionlake
con = motionlake.connect(sys.argv[1])
started = time.perf_counter()
for _ in range(10):
    con.execute("SELECT sum(hash(f)) FROM frames f").fetchall()
print(time.perf_counter() - started)
"""


def used() -> float:
    """Seconds that the processors of this machine have worked."""
    user, nice, system, *_ = Path("/proc/stat").read_text(encoding="utf-8").split("\n")[0].split()[1:]
    return (int(user) + int(nice) + int(system)) / os.sysconf("SC_CLK_TCK")


def _environment() -> dict[str, str]:
    """Bytecode is kept, as it is where people work: else the checkout that has some would start sooner."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


def run(checkout: Path, *words: object) -> tuple[float, float]:
    """Processor and wall seconds of a command."""
    before, started = used(), time.perf_counter()
    command = [str(checkout / ".venv" / "bin" / "motionlake"), *map(str, words)]
    subprocess.run(command, cwd=checkout, check=True, capture_output=True, text=True, env=_environment())
    return used() - before, time.perf_counter() - started


def scan(checkout: Path, lake: Path) -> tuple[float, float]:
    """Wall seconds of ten scans in one process, twice."""
    command = [str(checkout / ".venv" / "bin" / "python"), "-c", SCAN, str(lake)]
    said = subprocess.run(command, cwd=checkout, check=True, capture_output=True, text=True, env=_environment())
    return float(said.stdout), float(said.stdout)


def interleaved(
    checkouts: Mapping[str, Path], measured: Callable[[str, Path], tuple[float, float]], rounds: int
) -> dict[str, dict[str, float]]:
    """The least and the median of what each checkout takes, after one round that warms up, and the ratio of the least.

    A round is a run of each; who begins changes from round to round. What other guests of a machine take makes runs
    slower, never faster, and by more than what is looked for: the least of many runs tells what a program takes itself.
    """
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in checkouts}
    for number in range(rounds + 1):
        for name, checkout in sorted(checkouts.items(), reverse=bool(number % 2)):
            seconds = measured(name, checkout)
            if number:
                found[name].append(seconds)
    least, medians = _each(found, min), _each(found, statistics.median)
    ratio = {clock: least["here"][clock] / least["before"][clock] for clock in CLOCKS}
    return {**least, "ratio": ratio, **{f"median {name}": taken for name, taken in medians.items()}}


def _each(
    found: Mapping[str, list[tuple[float, float]]], of: Callable[[Iterable[float]], float]
) -> dict[str, dict[str, float]]:
    return {name: dict(zip(CLOCKS, map(of, zip(*taken, strict=True)), strict=True)) for name, taken in found.items()}


def measure(before: Path, source: Path, folder: Path, rounds: int) -> dict[str, dict[str, dict[str, float]]]:
    """Ingest, search and scan by both checkouts."""
    checkouts = {"here": HERE, "before": before}

    def ingest(name: str, checkout: Path) -> tuple[float, float]:
        lake = folder / f"{name}-lake"
        shutil.rmtree(lake, ignore_errors=True)
        return run(checkout, "ingest", source, "--workers", 1, "--lake", lake)

    found = {"ingest": interleaved(checkouts, ingest, rounds)}
    for name, checkout in checkouts.items():
        run(checkout, "run", "all", "--lake", folder / f"{name}-lake")
    clip = sorted(source.rglob("*.amc"))[0].stem

    def search(name: str, checkout: Path) -> tuple[float, float]:
        return run(checkout, "search", clip, "-k", 3, "--lake", folder / f"{name}-lake")

    found["search"] = interleaved(checkouts, search, rounds)
    query = "SELECT sum(hash(f)) FROM frames f"

    def cold(name: str, checkout: Path) -> tuple[float, float]:
        return run(checkout, "sql", query, "--lake", folder / f"{name}-lake")

    found["cold scan"] = interleaved(checkouts, cold, rounds)
    found["ten scans"] = interleaved(checkouts, lambda name, checkout: scan(checkout, folder / f"{name}-lake"), rounds)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("other", type=Path, help="checkout of the commit before, with its .venv")
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--set", default="hdm05")
    given = parser.parse_args()
    source = recordings() / given.set / "clips"
    with tempfile.TemporaryDirectory() as folder:
        figures = measure(given.other.resolve(), source, Path(folder), given.rounds)
    for name, taken in figures.items():
        ratio = taken["ratio"]
        print(f"{name}: {ratio['processor']:.3f} of the processor, {ratio['wall']:.3f} of the clock", taken)
    print(record("trust-cost", figures, hash_files(source.rglob("*.amc"), source)))
    sys.stdout.flush()


if __name__ == "__main__":
    main()
