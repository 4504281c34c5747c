"""How stages scale over workers: measured with one and two, simulated up to 64. `python -m bench.worker_scaling`.

Lakes of long clips (`bench.long_clips`) go through every stage of `run all` but the graph, which so large a lake does
not have. Measured of each stage: the seconds of every shard in its worker, those of loading what they made into the
catalog, and the seconds of the stage. What is left of a stage's seconds with one worker is the driver's alone:
planning, and the training of models. Of the scheduler, what one task more costs that does nothing, of 100,000.

With W workers a stage takes what is the driver's alone and then the longest of three: its shards, each given to the
worker that is free first; loading; the scheduler. For a lake as large as BONES-SEED shards are drawn from those that
were measured, and what is the driver's and loading are continued in a straight line through two lakes. That is too
much where training looks at a sample of clips, so that this errs to the side of fewer workers. The same for the two
workers that this machine has says how well it holds.
"""

from __future__ import annotations

import argparse
import heapq
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final
from unittest import mock

import numpy as np
from distributed import Client, LocalCluster, as_completed
from motionlake.jobs import results as entered
from motionlake.jobs import run as jobs
from motionlake.jobs import session as sessions
from motionlake.lake.catalog import create_catalog
from motionlake.lake.layout import Lake
from motionlake.stages.registry import ALL
from motionlake.stages.sources import IngestOptions, Root

from bench.long_clips import read_recordings, write_long_clips
from bench.record import record, recordings

SEED: Final = 142_220  # clips of BONES-SEED
CLIPS: Final = (512, 1536)  # of the two lakes
WORKERS: Final = (1, 2, 4, 8, 16, 32, 64)
TASKS: Final = 100_000
AHEAD: Final = 1000  # tasks that the scheduler holds at a time
STAGES: Final = tuple(stage for stage in ALL if stage != "graph")
WARMING: Final = 8  # clips


@dataclass(frozen=True)
class Spent:
    """Seconds of one stage.

    Attributes:
        whole: from its begin to its end.
        shards: of each in its worker.
        clips: in these shards.
        loading: of the driver, into the catalog.
    """

    whole: float
    shards: tuple[float, ...]
    clips: int
    loading: float

    @property
    def own(self) -> float:
        """The driver's alone, with one worker."""
        return max(0.0, self.whole - sum(self.shards))


def measured(count: int, workers: int) -> dict[str, Spent]:
    """What every stage takes in a lake of so many clips."""
    found: dict[str, Spent] = {}
    with tempfile.TemporaryDirectory(prefix="bench-workers-") as name:
        folder, lake = Path(name), Lake(Path(name) / "lake")
        write_long_clips(read_recordings(recordings()), 0, count, folder / "clips")
        create_catalog(lake)
        root = Root("long", str(folder / "clips"), IngestOptions())
        load = entered._load
        with sessions.session(lake, "bench", lambda stage, done, total: None, lambda line: None, workers) as job:
            job.client(workers)  # which is there for all stages
            for stage in STAGES:
                results: list[Any] = []
                loading: list[float] = []

                def watched(*given: Any, results: list[Any] = results, loading: list[float] = loading) -> Any:
                    began = time.perf_counter()
                    try:
                        return load(*given)
                    finally:
                        loading.append(time.perf_counter() - began)
                        results.extend(given[2])

                began = time.perf_counter()
                with mock.patch.object(entered, "_load", watched):
                    if stage == "frames":
                        jobs.ingest(job, [root])
                    else:
                        jobs.run(job, [stage])
                whole = time.perf_counter() - began
                shards = tuple(float(result.seconds) for result in results)
                clips = sum(result.shard.items for result in results)
                found[stage] = Spent(whole, shards, clips, sum(loading))
    return found


def seconds_a_task(count: int) -> float:
    """Seconds of scheduler and client that one task costs, which does nothing."""
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as local, Client(local) as client:
        client.submit(int, 0, pure=False).result()
        pool, left = as_completed(), count
        began = time.perf_counter()
        for _ in range(min(AHEAD, count)):
            pool.add(client.submit(int, 0, pure=False))
            left -= 1
        for done in pool:
            done.release()
            if left:
                pool.add(client.submit(int, 0, pure=False))
                left -= 1
        return (time.perf_counter() - began) / count


def makespan(shards: Sequence[float], workers: int) -> float:
    """Seconds until all shards are done, each given to the worker that is free first."""
    free = [0.0] * workers
    for seconds in shards:
        heapq.heappush(free, heapq.heappop(free) + seconds)
    return max(free)


def simulated(own: float, shards: Sequence[float], loading: float, task: float, workers: int) -> tuple[float, str]:
    """Seconds of a stage, and what most of them go to."""
    parts = {"shards": makespan(shards, workers), "catalog": loading, "scheduler": task * len(shards)}
    longest = max(parts, key=lambda name: parts[name])
    return own + parts[longest], longest if parts[longest] > own else "driver"


@dataclass(frozen=True)
class Large:
    """A stage of a larger lake: the driver's seconds, those of its shards, and those of loading."""

    own: float
    shards: tuple[float, ...]
    loading: float


def enlarged(few: Spent, many: Spent, counts: Sequence[int], clips: int, rng: np.random.Generator) -> Large:
    """A stage of so many clips by two lakes of `counts` clips."""

    def continued(before: float, now: float) -> float:
        return now + max(0.0, now - before) / (counts[1] - counts[0]) * (clips - counts[1])

    share = clips / counts[1]
    drawn = rng.choice(many.shards, round(len(many.shards) * share)) if many.shards else np.empty(0)
    scale = sum(many.shards) * share / max(float(drawn.sum()), 1e-9)
    shards = tuple((drawn * scale).tolist())
    return Large(continued(few.own, many.own), shards, continued(few.loading, many.loading))


def scaled(stages: dict[str, Large], task: float, workers: int) -> dict[str, Any]:
    """Hours of all stages with so many workers, and what holds each up."""
    found = {name: simulated(each.own, each.shards, each.loading, task, workers) for name, each in stages.items()}
    return {
        "hours": sum(seconds for seconds, _ in found.values()) / 3600,
        "stages": {name: {"seconds": seconds, "bound_by": what} for name, (seconds, what) in found.items()},
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clips", type=int, nargs=2, default=list(CLIPS))
    parser.add_argument("--tasks", type=int, default=TASKS)
    given = parser.parse_args()
    measured(WARMING, 1)
    few, many = (measured(count, 1) for count in given.clips)
    both = measured(given.clips[1], 2)
    task = seconds_a_task(given.tasks)
    held = {
        name: {"measured": both[name].whole, "simulated": simulated(each.own, each.shards, each.loading, task, 2)[0]}
        for name, each in many.items()
    }
    rng = np.random.default_rng(0)
    large = {name: enlarged(few[name], many[name], given.clips, SEED, rng) for name in many}
    by_workers = {workers: scaled(large, task, workers) for workers in WORKERS}
    for workers, found in by_workers.items():
        bound = ", ".join(f"{name} {each['bound_by']}" for name, each in found["stages"].items())
        times = by_workers[1]["hours"] / found["hours"]
        print(f"{workers:3d} workers: {found['hours']:.2f} hours, {times:.1f} x; {bound}")
    two = {key: sum(each[key] for each in held.values()) for key in ("measured", "simulated")}
    print(
        f"two workers: {two['measured']:.0f} s measured, {two['simulated']:.0f} simulated; {1e6 * task:.0f} us a task"
    )
    figures = {
        "clips": given.clips, "tasks": given.tasks, "microseconds_a_task": 1e6 * task,
        "two_workers": held | {"all": two},
        "measured": [{name: asdict(each) for name, each in lake.items()} for lake in (few, many)],
        "seed": by_workers,
    }  # fmt: skip
    print(record("worker-scaling", figures))


if __name__ == "__main__":
    main()
