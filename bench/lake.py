"""Whole ingests: `python -m bench.lake ingest`.

Every set of MOTIONLAKE_DATA, into a dataset of its own: clips, frames, rejects, frames a second, bytes a
frame. Then as many as 10,000 short clips cut from real ones: peak memory of driver and workers.

Each set is ingested twice. "Frames job" is the job on a running cluster whose workers have compiled code
loaded. "Command" is `motionlake ingest` from nothing: interpreter, cluster and lake included. Processor time
is that of driver and workers together, which other load on the machine hardly changes.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import pyarrow.parquet as pq
from motionlake.formats import is_clip
from motionlake.jobs import run as jobs
from motionlake.jobs.session import Session, session
from motionlake.lake.catalog import create_catalog, fetch, reading
from motionlake.lake.layout import Lake
from motionlake.motion.rigs import load_rigs
from motionlake.stages.frames import canonical_motions
from motionlake.stages.sources import IngestOptions, Root

from bench.memory import Usage, processor_seconds, watch
from bench.random_crops import recordings_to_cut, write_trimmed
from bench.record import record, recordings

BYTES_BAR: Final = 200
SIZES: Final = (1_000, 10_000)
CHECKOUT: Final = Path(__file__).parents[1]


@dataclass(frozen=True)
class Ingest:
    """One set's ingest.

    Attributes:
        seconds: of the frames job.
        processor_seconds: of driver and workers in that time.
        command_seconds: of `motionlake ingest`.
        frame_bytes: canonical Parquet parts.
        raw_bytes: parts of the files' own channels.
    """

    clips: int
    frames: int
    rejects: list[str]
    seconds: float
    processor_seconds: float
    command_seconds: float
    frame_bytes: int
    raw_bytes: int

    @property
    def bytes_a_frame(self) -> float:
        return self.frame_bytes / max(self.frames, 1)


def command(source: Path, lake: Path, dataset: str, workers: int) -> list[str]:
    """The command line that ingests a folder."""
    words = [sys.executable, "-m", "motionlake.cli.main", "ingest", str(source), "--lake", str(lake)]
    return [*words, "--dataset", dataset, "--workers", str(workers)]


def ingest_sets(data: Path, workers: int, names: Sequence[str] = ()) -> dict[str, Ingest]:
    """Ingest every set, or those named, one after the other."""
    sets = [
        folder
        for folder in sorted(data.iterdir())
        if (folder / "clips").is_dir() and (not names or folder.name in names)
    ]
    with tempfile.TemporaryDirectory(prefix="bench-lake-") as folder, _session(Path(folder) / "lake", workers) as job:
        examples = [str(next(p for p in sorted((s / "clips").rglob("*")) if is_clip(p))) for s in sets]
        job.client(workers).run(_load_code, examples)
        return {s.name: _measure(job, s, Path(folder), workers) for s in sets}


@contextmanager
def _session(path: Path, workers: int) -> Iterator[Session]:
    lake = Lake(path)
    create_catalog(lake)
    with session(lake, "bench", lambda stage, done, total: None, lambda line: None, workers) as job:
        yield job


def _load_code(paths: Sequence[str]) -> None:
    for path in paths:
        list(canonical_motions(Path(path), load_rigs(), IngestOptions()))


def _measure(job: Session, source: Path, folder: Path, workers: int) -> Ingest:
    root = Root(source.name, str(source.resolve()), IngestOptions())
    before, started = processor_seconds(), time.perf_counter()
    outcome = jobs.ingest(job, [root]).outcome
    seconds, spent = time.perf_counter() - started, processor_seconds() - before
    used = watch(command(source, folder / f"{source.name}-lake", source.name, workers), CHECKOUT)
    parts = sorted((job.lake.root / "frames" / f"dataset={source.name}").glob("*.parquet"))
    raw = (p for part in parts for p in (job.lake.root / "raw").glob(f"*/{part.name}"))
    with reading(job.lake) as con:
        rows = fetch(con, "rejects_of", {"dataset": source.name})
    return Ingest(
        clips=outcome.clips,
        frames=sum(pq.read_metadata(part).num_rows for part in parts),
        rejects=[f"{row['path']}: {row['reason']}" for row in rows],
        seconds=seconds,
        processor_seconds=spent,
        command_seconds=used.seconds,
        frame_bytes=sum(part.stat().st_size for part in parts),
        raw_bytes=sum(part.stat().st_size for part in raw),
    )


def together(sets: dict[str, Ingest]) -> Ingest:
    """All sets as one."""
    each = list(sets.values())
    return Ingest(
        sum(s.clips for s in each), sum(s.frames for s in each), [r for s in each for r in s.rejects],
        sum(s.seconds for s in each), sum(s.processor_seconds for s in each), sum(s.command_seconds for s in each),
        sum(s.frame_bytes for s in each), sum(s.raw_bytes for s in each),
    )  # fmt: skip


def rates(ingest: Ingest, workers: int) -> dict[str, float]:
    """What a person compares."""
    return {
        "frames_per_second": ingest.frames / ingest.seconds,
        "frames_per_second_and_core": ingest.frames / ingest.seconds / workers,
        "frames_per_processor_second": ingest.frames / ingest.processor_seconds,
        "command_frames_per_second": ingest.frames / ingest.command_seconds,
        "bytes_a_frame": ingest.bytes_a_frame,
        "raw_bytes_a_frame": ingest.raw_bytes / max(ingest.frames, 1),
    }


def ingest_many(data: Path, count: int, workers: int) -> Usage:
    """Ingest `count` short clips from a cold start."""
    with tempfile.TemporaryDirectory(prefix="bench-lake-") as folder:
        source = Path(folder) / "clips"
        size = write_trimmed(recordings_to_cut(data), data, count, source)
        used = watch(command(source, Path(folder) / "lake", "trimmed", workers), CHECKOUT)
        print(
            f"{count:6} clips ({size / 1e6:.0f} MB): {used.seconds:.1f} s, peak memory of the driver "
            f"{_mb(used.driver)}, of its workers {', '.join(map(_mb, used.workers))}, together {_mb(used.together)}"
            + (f"; exit status {used.status}" if used.status else ""),
            flush=True,
        )
    return used


def _mb(size: float) -> str:
    return f"{size / 1e6:.0f} MB"


def show(name: str, ingest: Ingest, workers: int) -> None:
    """One set, on two lines, and its rejects."""
    figures = rates(ingest, workers)
    print(
        f"{name}: {ingest.clips} clips, {ingest.frames} frames, {len(ingest.rejects)} rejects; "
        f"{figures['bytes_a_frame']:.0f} bytes a frame (raw channels {figures['raw_bytes_a_frame']:.0f})\n"
        f"    frames/s: job {figures['frames_per_second']:.0f}, a core {figures['frames_per_second_and_core']:.0f}, "
        f"a second of processor time {figures['frames_per_processor_second']:.0f}, "
        f"command {figures['command_frames_per_second']:.0f} ({ingest.command_seconds:.1f} s)"
    )
    for line in ingest.rejects:
        print(f"    rejected {line}")


def ingest(workers: int, sizes: Sequence[int], names: Sequence[str]) -> None:
    """All of it."""
    data = recordings()
    figures: dict[str, Any] = {"workers": workers}
    sets = ingest_sets(data, workers, names)
    everything = together(sets)
    for name, measured in [*sets.items(), ("all sets", everything)]:
        show(name, measured, workers)
        figures[name] = asdict(measured) | rates(measured, workers)
    met = "met" if everything.bytes_a_frame <= BYTES_BAR else "MISSED"
    print(f"{everything.bytes_a_frame:.0f} bytes a frame over all sets (bar {BYTES_BAR}: {met})")
    used = {count: ingest_many(data, count, workers) for count in sizes}
    few, many = used[min(sizes)], used[max(sizes)]
    growth = {
        "driver": many.driver / few.driver,
        "largest_worker": many.workers[0] / few.workers[0],
        "together": many.together / few.together,
    }
    print(f"peak memory, {max(sizes)} over {min(sizes)} clips: " + ", ".join(f"{k} {v:.2f}" for k, v in growth.items()))
    figures["memory"] = {str(count): asdict(usage) for count, usage in used.items()} | {"growth": growth}
    print(record("ingest-lake", figures))


def main() -> None:
    parser = argparse.ArgumentParser(description="Measure whole ingests.")
    parser.add_argument("what", choices=["ingest"])
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--clips", type=int, nargs="+", default=list(SIZES), help="sizes of the memory test")
    parser.add_argument("--sets", nargs="+", default=[], help="these alone")
    arguments = parser.parse_args()
    ingest(arguments.workers, arguments.clips, arguments.sets)


if __name__ == "__main__":
    main()
