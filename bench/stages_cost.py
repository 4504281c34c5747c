"""What every stage costs, by the number of clips: `python -m bench.stages_cost [--clips N ...] [--workers N]`.

Lakes of so many clips as long as those of BONES-SEED (`bench.long_clips`) go through every stage of `run all` in one
session, after one of few clips for which kernels are compiled. Processor seconds are those of driver and workers
together, which other load on the machine changes little. What one more frame costs is the difference of the last two
lakes: so the start of the workers and the training of dictionary and motifs, which any lake pays once, count little.
The hours are those of 142,220 clips of 7.3 s at 120 frames a second on two cores by it, without the neighbour graph,
which so large a lake does not have, and without its shortlist, which small ones do not.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any, Final

from motionlake.jobs import run as jobs
from motionlake.jobs.session import session
from motionlake.lake.catalog import create_catalog
from motionlake.lake.layout import Lake
from motionlake.stages.registry import ALL
from motionlake.stages.sources import IngestOptions, Root

from bench.long_clips import FPS, MEAN, read_recordings, write_long_clips
from bench.memory import processor_seconds
from bench.record import record, recordings

CLIPS: Final = (400, 1200)
WARMING: Final = 4  # clips
SEED: Final = 142_220 * MEAN * FPS  # frames


def measure(count: int, workers: int) -> dict[str, Any]:
    """Processor seconds of each stage, seconds of all of them, frames, and bytes of the lake by folder."""
    with tempfile.TemporaryDirectory(prefix="bench-stages-") as name:
        folder, lake = Path(name), Lake(Path(name) / "lake")
        frames = write_long_clips(read_recordings(recordings()), 0, count, folder / "clips")
        create_catalog(lake)
        root = Root("long", str(folder / "clips"), IngestOptions())
        spent: dict[str, float] = {}
        started = time.perf_counter()
        with session(lake, "bench", lambda stage, done, total: None, lambda line: None, workers) as job:
            for stage in ALL:
                before = processor_seconds()
                if stage == "frames":
                    jobs.ingest(job, [root])
                else:
                    jobs.run(job, [stage])
                spent[stage] = processor_seconds() - before
        seconds = time.perf_counter() - started
        sizes = {
            path.name: sum(file.stat().st_size for file in path.rglob("*")) if path.is_dir() else path.stat().st_size
            for path in sorted(lake.root.iterdir())
        }
    return {"clips": count, "frames": frames, "seconds": seconds, "processor_seconds": spent, "bytes": sizes}


def a_frame_more(few: dict[str, Any], many: dict[str, Any]) -> dict[str, float]:
    """Microseconds of a processor by stage that one more frame costs."""
    frames = many["frames"] - few["frames"]
    before, after = few["processor_seconds"], many["processor_seconds"]
    return {stage: 1e6 * (after[stage] - before[stage]) / frames for stage in after}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clips", type=int, nargs="+", default=list(CLIPS))
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    measure(WARMING, given.workers)
    sizes = [measure(count, given.workers) for count in sorted(given.clips)]
    figures: dict[str, Any] = {"workers": given.workers, "sizes": sizes}
    for size in sizes:
        spent = sum(size["processor_seconds"].values())
        print(f"{size['clips']} clips, {size['frames']} frames: {size['seconds']:.0f} s, {spent:.0f} s of processors")
    if len(sizes) > 1:
        more = figures["microseconds_a_frame"] = a_frame_more(*sizes[-2:])
        for stage, cost in more.items():
            print(f"{stage:12s} {cost:7.1f} microseconds of a processor a frame")
        whole = sum(cost for stage, cost in more.items() if stage != "graph")
        hours = SEED * whole / 2e6 / 3600
        figures |= {"frames_a_second_and_core": 1e6 / whole, "seed_hours_on_two_cores": hours}
        print(f"all but the graph: {1e6 / whole:.0f} frames a second and core; SEED: {hours:.2f} hours")
    print(record("stages-cost", figures))


if __name__ == "__main__":
    main()
