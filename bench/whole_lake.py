"""A repository as large as BONES-SEED, indexed whole: `python -m bench.whole_lake FOLDER [--clips N]`.

Clips of `bench.long_clips` are written some thousand at a time, taken in by `motionlake ingest`, and then emptied, so
that the disk holds them: files of the same size and time without contents, which later runs find unchanged. Then
`run all`. What is measured of each command: seconds, seconds of processors of all that it started, and the most memory
that its processes held, the driver and together; of each stage the seconds of its shards, as the lake's manifest has
them, and of the training of its model. Writing the clips is measured by itself. Of the lake that is there then:
`status`, `run all` with nothing due, fifty new clips taken in and run through every stage as of a night, and a search
in a new process.

FOLDER keeps the lake and what was measured: a run that was interrupted goes on there, with the step that it was in.
A finished lake is there for `python -m bench.scale_search --folder FOLDER`, and for `--again N`, which asks these last
things of it N times more, each time with a night of other clips.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from time import perf_counter
from typing import Any, Final

from motionlake.lake.catalog import reading
from motionlake.lake.layout import Lake
from motionlake.lake.parts import replacing
from motionlake.stages.registry import ALL

from bench.long_clips import FPS, read_recordings, write_long_clips
from bench.memory import LINGER, ended_seconds, orphans_adopted, watch
from bench.record import record, recordings

CHECKOUT: Final = Path(__file__).parents[1]
SEED: Final = 142_220  # clips of BONES-SEED
TOGETHER: Final = 10_000  # clips that lie on the disk at a time
NIGHTLY: Final = 50
STEPS: Final = "steps.json"


class Steps:
    """What was measured, by step; a file of the folder, so that no step that is done is done again."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / STEPS
        self.done: dict[str, Any] = json.loads(self._file.read_text()) if self._file.exists() else {}

    def take(self, name: str, measure: Callable[[], dict[str, Any]]) -> None:
        if name in self.done:
            return
        self.done[name] = found = measure()
        with replacing(self._file) as path:
            path.write_text(json.dumps(self.done))
        print(f"{name}: " + ", ".join(f"{key} {value:,.1f}" for key, value in found.items()), flush=True)


def command(log: Path, *words: str | Path) -> dict[str, Any]:
    """What a command used; leaves where it fails."""
    program = [str(Path(sys.executable).with_name("motionlake")), *map(str, words)]
    before = ended_seconds()
    used = watch(program, Path.cwd(), log)
    if used.status:
        sys.exit(f"{' '.join(program)}: status {used.status}\n{log.read_text(errors='replace')[-2000:]}")
    return {
        "seconds": used.seconds,
        "processor_seconds": ended_seconds(LINGER) - before,
        "driver_mib": used.driver / 2**20, "together_mib": used.together / 2**20,
    }  # fmt: skip


def write(first: int, stop: int, folder: Path, processes: int) -> dict[str, Any]:
    """Write the clips numbered [first, stop), by processes that end: a pool would leave one of its own behind."""
    started = perf_counter()
    cuts = [first + (stop - first) * number // processes for number in range(processes + 1)]
    writing = [
        subprocess.Popen(
            [sys.executable, "-m", "bench.whole_lake", str(folder), "--write", str(begin), str(end)],
            stdout=subprocess.PIPE, text=True, cwd=CHECKOUT, env=os.environ | {"PYTHONPATH": str(CHECKOUT)},
        )
        for begin, end in pairwise(cuts)
    ]  # fmt: skip
    told = [process.communicate()[0] for process in writing]
    if any(process.returncode for process in writing):
        sys.exit(f"{folder}: clips cannot be written")
    return {"seconds": perf_counter() - started, "frames": sum(map(int, told))}


def empty(folder: Path) -> None:
    """Leave of every file its size and the time at which it was written."""
    for path in folder.rglob("*.bvh"):
        kept = path.stat()
        if kept.st_blocks:
            os.truncate(path, 0)
            os.truncate(path, kept.st_size)
            os.utime(path, ns=(kept.st_atime_ns, kept.st_mtime_ns))


def measure(given: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """All steps that are not done yet."""
    steps, lake, log = Steps(folder), folder / "lake", folder / "log"
    options = options_of(given, folder)
    for shard, first in enumerate(range(0, given.clips, given.together)):
        clips, stop = folder / f"clips{shard:02}", min(given.clips, first + given.together)
        steps.take(f"write {shard}", partial(write, first, stop, clips, given.processes))
        steps.take(f"ingest {shard}", partial(command, log, "ingest", clips, *options))
        empty(clips)
    steps.take("run all", partial(command, log, "run", "all", *options))
    steps.take("stages", partial(seconds_of_stages, lake))
    for name, words in questions(given, folder, "night").items():
        steps.take(name, partial(command, log, *words))
    return steps.done


def options_of(given: argparse.Namespace, folder: Path) -> Sequence[str | Path]:
    """What every command that writes is told."""
    return ("--lake", folder / "lake", *(("--workers", str(given.workers)) if given.workers else ()))


def questions(given: argparse.Namespace, folder: Path, night: str, nights: int = 0) -> dict[str, Sequence[str | Path]]:
    """Commands for a finished lake, by name; first the clips of a night are written, which comes after so many."""
    lake, clips = folder / "lake", folder / night
    if not clips.exists():
        first = given.clips + nights * NIGHTLY
        write_long_clips(read_recordings(recordings()), first, first + NIGHTLY, clips)
    query = next(path.relative_to(clips).as_posix() for path in sorted(clips.rglob("*.bvh")))
    options = options_of(given, folder)
    return {
        "nothing due": ("run", "all", *options), "status": ("status", "--lake", lake),
        "night, ingest": ("ingest", clips, *options), "night, run": ("run", "all", *options),
        "search": ("search", f"{night}/{query}", "--lake", lake),
    }  # fmt: skip


def measure_again(given: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """What `questions` cost, `--again` times, by name: seconds, and the most memory that their processes held."""
    found: dict[str, dict[str, list[float]]] = {}
    for _ in range(given.again):
        nights = len(list(folder.glob("night*")))
        for name, words in questions(given, folder, f"night{nights:02}", nights).items():
            used = command(folder / "log", *words)
            print(f"{name}: {used['seconds']:.1f} s, {used['together_mib']:.0f} MiB", flush=True)
            for what in ("seconds", "together_mib"):
                found.setdefault(name, {}).setdefault(what, []).append(used[what])
    return found


def seconds_of_stages(lake: Path) -> dict[str, float]:
    """Seconds of a worker that the shards of each stage took, and "training": of the driver, that all models took."""
    with reading(Lake(lake)) as con:
        rows = con.execute("SELECT stage, sum(seconds) FROM manifest GROUP BY stage").fetchall()
        ((trained,),) = con.execute("SELECT coalesce(sum(seconds), 0) FROM models").fetchall()
    spent = {stage: float(seconds or 0.0) for stage, seconds in rows}
    return {stage: spent[stage] for stage in ALL if stage in spent} | {"training": float(trained)}


def summary(steps: dict[str, Any], lake: Path) -> dict[str, Any]:
    """Frames, seconds, frames a second and core by stage, the most memory, and bytes by folder of the lake."""
    frames = sum(found["frames"] for name, found in steps.items() if name.startswith("write "))
    commands = [found for name, found in steps.items() if name.startswith("ingest ") or name == "run all"]
    seconds = sum(found["seconds"] for found in commands)
    sizes = {
        path.name: sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
        for path in sorted(lake.iterdir()) if path.is_dir()
    }  # fmt: skip
    return {
        "frames": frames, "hours": seconds / 3600, "times_real_time": frames / FPS / seconds,
        "driver_mib": max(found.get("driver_mib", 0) for found in steps.values()),
        "together_mib": max(found.get("together_mib", 0) for found in steps.values()),
        "seconds": seconds, "processor_seconds": sum(found["processor_seconds"] for found in commands),
        "by_stage": {
            stage: {"worker_seconds": spent, "frames_a_second_and_core": frames / spent if spent else None}
            for stage, spent in steps["stages"].items()
        },
        "bytes": sizes | {"catalog.duckdb": (lake / "catalog.duckdb").stat().st_size}, "steps": steps,
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--clips", type=int, default=SEED)
    parser.add_argument("--together", type=int, default=TOGETHER, help="clips that lie on the disk at a time")
    parser.add_argument("--workers", type=int, help="of every command (default: as it chooses)")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1, help="that write clips")
    parser.add_argument("--write", type=int, nargs=2, help=argparse.SUPPRESS)  # what a child process does
    parser.add_argument("--again", type=int, default=0, help="times that a finished lake is asked again")
    given = parser.parse_args()
    if given.write:
        first, stop = given.write
        print(write_long_clips(read_recordings(recordings()), first, stop, given.folder))
        return
    given.folder = given.folder.absolute()
    given.folder.mkdir(parents=True, exist_ok=True)
    if not given.again or not (given.folder / "lake").exists():
        index(given, given.folder)
    if given.again:
        again(given, given.folder)


def index(given: argparse.Namespace, folder: Path) -> None:
    """Measure all steps, and record them."""
    with orphans_adopted():
        figures = summary(measure(given, folder), folder / "lake")
    for stage, found in figures["by_stage"].items():
        print(f"{stage:12s} {found['worker_seconds']:8.1f} s of a worker")
    print(
        f"{given.clips} clips, {figures['frames']} frames: {figures['hours']:.2f} hours, "
        f"{figures['times_real_time']:.0f} times real time, at most {figures['together_mib']:.0f} MiB"
    )
    print(record("whole-lake", {"clips": given.clips, "workers": given.workers, **figures}))


def again(given: argparse.Namespace, folder: Path) -> None:
    """Ask a finished lake again, and record what that cost."""
    with orphans_adopted():
        asked = measure_again(given, folder)
    print(record("whole-lake-again", {"clips": given.clips, "workers": given.workers, "asked": asked}))


if __name__ == "__main__":
    main()
