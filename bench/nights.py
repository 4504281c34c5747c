"""New clips every night, simulated: `python -m bench.nights [--folder FOLDER] [--nights N] [--clips N] [--first N]`.

A lake of `--first` clips takes in `--clips` more a night: `motionlake ingest`, then `motionlake run all`, each as a
process of its own, as cron starts them; every `--every` nights `motionlake compact`; then one search and `status`.
Clips are those of `bench.long_clips`, `--seconds` long in the mean. Of every command the seconds are kept, and those
of processors that it and all processes it started took; of every night the bytes of the catalog and how many files
there are. What grows is told by straight lines through the nights: their rise over these nights and over a year, as a
share of where they begin.

FOLDER keeps the lake and what was measured, so that a year need not be simulated at once: `--nights` more follow those
that are there, and the record is of all. Where `bench.whole_lake` left a lake in it, that one takes the nights in.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.lake.layout import Lake
from motionlake.lake.parts import replacing

from bench.long_clips import Recording, read_recordings, write_long_clips
from bench.memory import LINGER, ended_seconds, orphans_adopted
from bench.record import record, recordings
from bench.scale_search import clips_in
from bench.whole_lake import empty, options_of

YEAR: Final = 365
STATE: Final = "nights.json"
INBOX: Final = "inbox"  # the folder that clips arrive in


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
    file, sources = folder / STATE, read_recordings(recordings())
    state = json.loads(file.read_text()) if file.exists() else begin(given, folder, sources)
    nights = state["each_night"]
    for _ in range(given.nights):
        nights.append(a_night(given, folder, sources, state["first"], len(nights) + 1))
        with replacing(file) as path:
            path.write_text(json.dumps(state))
    trends = {
        f"{name}_{clock}": trend([night[name][clock] for night in nights])
        for name in ("ingest", "run", "search", "status")
        for clock in ("seconds", "processor_seconds")
    }
    trends |= {name: trend([night[name] for night in nights]) for name in ("files", "frames_parts", "catalog_bytes")}
    return {**vars(given), "folder": None, **state, "trends": trends}


def begin(given: argparse.Namespace, folder: Path, sources: Sequence[Recording]) -> dict[str, Any]:
    """What is known before the first night: `first`, the clips of the lake, and `made`, what a new one took."""
    if (folder / "lake").exists():
        return {"first": clips_in(Lake(folder / "lake")), "made": None, "each_night": []}
    write_long_clips(sources, 0, given.first, folder / "clips", given.seconds)
    options = options_of(given, folder)
    made = {"ingest": command("ingest", folder / "clips", *options), "run": command("run", "all", *options)}
    return {"first": given.first, "made": made, "each_night": []}


def a_night(
    given: argparse.Namespace, folder: Path, sources: Sequence[Recording], known: int, number: int
) -> dict[str, Any]:
    """What the commands of a night took; the lake had `known` clips before the first."""
    lake, inbox, options = folder / "lake", folder / INBOX, options_of(given, folder)
    first = known + (number - 1) * given.clips
    write_long_clips(sources, first, first + given.clips, inbox, given.seconds)
    taken: dict[str, Any] = {"ingest": command("ingest", inbox, *options), "run": command("run", "all", *options)}
    if given.every and number % given.every == 0:
        taken["compact"] = command("compact", *options)
    query = next(inbox.rglob(f"*_{first:06}.bvh")).relative_to(inbox).as_posix()
    empty(inbox)
    taken["search"] = command("search", f"{INBOX}/{query}", "--lake", lake)
    taken["status"] = command("status", "--lake", lake)
    night = {**taken, **files_of(lake)}
    told = ", ".join(f"{name} {spent['seconds']:.1f} s ({spent['processor_seconds']:.1f})"
                     for name, spent in taken.items())  # fmt: skip
    print(f"night {number}: {told}; {night['files']} files, catalog {night['catalog_bytes'] / 1e6:.1f} MB", flush=True)
    return night


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, help="keeps the lake and what was measured (default: neither is kept)")
    parser.add_argument("--first", type=int, default=2000, help="clips of a new lake before the first night")
    parser.add_argument("--nights", type=int, default=30)
    parser.add_argument("--clips", type=int, default=50, help="a night")
    parser.add_argument("--seconds", type=float, default=2.0, help="that a clip lasts in the mean")
    parser.add_argument("--every", type=int, default=7, help="nights from one compaction to the next; 0: never")
    parser.add_argument("--workers", type=int, help="of every command (default: as it chooses)")
    given = parser.parse_args()
    with orphans_adopted(), tempfile.TemporaryDirectory(prefix="bench-nights-") as name:
        figures = measure(given, given.folder or Path(name))
    for name, line in figures["trends"].items():
        print(
            f"{name:26s} {line['first']:12.2f} at first, {100 * line['over_nights']:+6.1f} % over "
            f"{len(figures['each_night'])} nights, {100 * line['over_a_year']:+7.1f} % a year"
        )
    print(record("nights", figures))


if __name__ == "__main__":
    main()
