"""Benches of this checkout beside those of another one: `python -m bench.against OTHER dtw emd align ingest`.

The two checkouts run each bench in turn, so that what else the machine does falls on both. Every number that both
record is compared: above 1, this checkout's is the greater. Each checkout needs its own environment
(`make .venv-bench/.ready setup`).
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from bench.record import record

HERE: Final = Path(__file__).parents[1]
BENCHES: Final = {
    "dtw": (".venv-bench", "bench.dtw"),
    "emd": (".venv", "bench.emd"),
    "align": (".venv-bench", "bench.align"),
    "ingest": (".venv-bench", "bench.ingest", "peers"),
}


def run_bench(checkout: Path, name: str) -> dict[str, float]:
    """The numbers that a bench records when it runs in a checkout; its record file is removed again."""
    environment, *module = BENCHES[name]
    results = checkout / "bench" / "results"
    before = set(results.glob("*.json"))
    command = [str(checkout / environment / "bin" / "python"), "-m", *module]
    subprocess.run(command, cwd=checkout, check=True, capture_output=True, text=True)
    (written,) = set(results.glob("*.json")) - before
    figures = json.loads(written.read_text(encoding="utf-8"))["figures"]
    written.unlink()
    return dict(numbers(figures))


def numbers(value: Any, name: str = "") -> Iterator[tuple[str, float]]:
    """Every number of a JSON value with the path that leads to it."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from numbers(inner, f"{name}/{key}" if name else str(key))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield name, float(value)


def compare(other: Path, name: str, rounds: int) -> dict[str, float]:
    """Median of a number here over the median there, for every number that both checkouts record."""
    here: dict[str, list[float]] = {}
    there: dict[str, list[float]] = {}
    for _ in range(rounds):
        for checkout, found in ((HERE, here), (other, there)):
            for key, number in run_bench(checkout, name).items():
                found.setdefault(key, []).append(number)
    medians = {key: (statistics.median(here[key]), statistics.median(there[key])) for key in here if key in there}
    return {key: ours / theirs for key, (ours, theirs) in medians.items() if theirs}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("other", type=Path, help="the other checkout")
    parser.add_argument("benches", nargs="+", choices=sorted(BENCHES))
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    found = {name: compare(given.other.resolve(), name, given.rounds) for name in given.benches}
    for name, ratios in found.items():
        for key, ratio in ratios.items():
            print(f"{name:7} {key:60} {ratio:6.2f}")
    print(record("against", {"rounds": given.rounds, "ratios": found}))


if __name__ == "__main__":
    main()
