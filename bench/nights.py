"""New clips every night, simulated: `python -m bench.nights [--nights N] [--clips N] [--first N] [--every N]`.

A lake of `--first` clips takes in `--clips` more a night: `motionlake ingest`, then `motionlake run all`, each as a
process of its own, as cron starts them; every `--every` nights `motionlake compact`; then one search and `status`.
Clips are those of `bench.long_clips`, `--seconds` long in the mean. Of every command the seconds are kept, and those
of processors that it and all processes it started took; of every night the bytes of the catalog and how many files
there are. What grows is told by straight lines through the nights: their rise over these nights and over a year, as a
share of where they begin.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from bench.long_clips import read_recordings, write_long_clips
from bench.memory import LINGER, ended_seconds, orphans_adopted
from bench.record import record, recordings

YEAR: Final = 365


def command(*words: str | Path, statuses: Sequence[int] = (0,)) -> dict[str, float]:
    """Seconds of a command line, and seconds of processors with all that it started; leaves where it fails."""
    program = [str(Path(sys.executable).with_name("motionlake")), *map(str, words)]
    before, started = ended_seconds(), time.perf_counter()
    done = subprocess.run(program, capture_output=True, text=True, check=False)
    seconds = time.perf_counter() - started
    if done.returncode not in statuses:
        sys.exit(f"{' '.join(program)}: status {done.returncode}\n{done.stderr}")
    return {"seconds": seconds, "processor_seconds": ended_seconds(LINGER) - before}


def files_of(lake: Path) -> dict[str, int]:
    """Files of the lake and of its parts of frames, and bytes of its catalog."""
    return {
        "files": sum(1 for path in lake.rglob("*") if path.is_file()),
        "frames_parts": sum(1 for _ in lake.glob("frames/*/*.parquet")),
        "catalog_bytes": (lake / "catalog.duckdb").stat().st_size,
    }


def trend(values: Sequence[float]) -> dict[str, float]:
    """A straight line by least squares: where it begins, its slope a night, and its rise over the nights and over a
    year as a share of where it begins."""
    nights = np.arange(len(values))
    slope, first = np.polyfit(nights, values, 1) if len(values) > 1 else (0.0, values[0])
    share = slope / first if first > 0 else 0.0
    return {"first": float(first), "a_night": float(slope), "over_nights": float(share * (len(values) - 1)),
            "over_a_year": float(share * YEAR)}  # fmt: skip


def measure(given: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """What every night took, what the first clips took, and the trends."""
    lake, clips, sources = folder / "lake", folder / "clips", read_recordings(recordings())
    write_long_clips(sources, 0, given.first, clips, given.seconds)
    workers = ("--lake", lake, *(("--workers", str(given.workers)) if given.workers else ()))
    made = {"ingest": command("ingest", clips, *workers), "run": command("run", "all", *workers)}
    nights = []
    for night in range(given.nights):
        first = given.first + night * given.clips
        write_long_clips(sources, first, first + given.clips, clips, given.seconds)
        taken: dict[str, Any] = {"ingest": command("ingest", clips, *workers), "run": command("run", "all", *workers)}
        if given.every and (night + 1) % given.every == 0:
            taken["compact"] = command("compact", *workers)
        query = next(path.relative_to(clips).as_posix() for path in sorted(clips.rglob("*.bvh")))
        taken["search"] = command("search", f"clips/{query}", "--lake", lake)
        taken["status"] = command("status", "--lake", lake)
        nights.append({**taken, **files_of(lake)})
        told = ", ".join(f"{name} {nights[-1][name]['seconds']:.1f} s ({nights[-1][name]['processor_seconds']:.1f})"
                         for name in taken)  # fmt: skip
        print(f"night {night + 1}: {told}; {nights[-1]['files']} files, "
              f"catalog {nights[-1]['catalog_bytes'] / 1e6:.1f} MB", flush=True)  # fmt: skip
    trends = {
        f"{name}_{clock}": trend([night[name][clock] for night in nights])
        for name in ("ingest", "run", "search", "status")
        for clock in ("seconds", "processor_seconds")
    }
    trends |= {name: trend([night[name] for night in nights]) for name in ("files", "frames_parts", "catalog_bytes")}
    return {**vars(given), "made": made, "each_night": nights, "trends": trends}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=2000, help="clips of the lake before the first night")
    parser.add_argument("--nights", type=int, default=30)
    parser.add_argument("--clips", type=int, default=50, help="a night")
    parser.add_argument("--seconds", type=float, default=2.0, help="that a clip lasts in the mean")
    parser.add_argument("--every", type=int, default=7, help="nights from one compaction to the next; 0: never")
    parser.add_argument("--workers", type=int, help="of every command (default: as it chooses)")
    given = parser.parse_args()
    with orphans_adopted(), tempfile.TemporaryDirectory(prefix="bench-nights-") as name:
        figures = measure(given, Path(name))
    for name, line in figures["trends"].items():
        print(
            f"{name:26s} {line['first']:12.2f} at first, {100 * line['over_nights']:+6.1f} % over {given.nights} "
            f"nights, {100 * line['over_a_year']:+7.1f} % a year"
        )
    print(record("nights", figures))


if __name__ == "__main__":
    main()
