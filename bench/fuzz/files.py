"""A folder of damaged files of all formats through `motionlake ingest`: each is read or rejected with a reason."""

from __future__ import annotations

import os
import re
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.formats import is_clip, reader_for
from motionlake.lake.catalog import reading
from motionlake.lake.frames import read_part
from motionlake.lake.layout import Lake

from bench.lake import CHECKOUT, command
from bench.memory import Usage, watch
from tests.damage import damaged_files, gather, gather_made
from tests.fuzz import fault_of_words

LARGEST: Final = 1 << 30  # bytes that a process of the run may hold
FARTHEST: Final = 10_000.0  # metres
SHOWN: Final = 20


def ingest_damaged(count: int, seed: int, workers: int) -> dict[str, Any]:
    """Write and take in damaged files; the figures, and under "faults" what is not as promised."""
    data = os.environ.get("MOTIONLAKE_DATA")
    with tempfile.TemporaryDirectory(prefix="bench-fuzz-") as name:
        folder = Path(name)
        if data:
            gather(Path(data), folder / "good")
        else:
            gather_made(folder / "good")
        paths = damaged_files(folder / "good", folder / "damaged", count, seed)
        log = folder / "log"
        used = watch(command(folder / "damaged", folder / "lake", "damaged", workers), CHECKOUT, log)
        clips = [p.relative_to(folder / "damaged").as_posix() for p in paths if is_clip(p)]
        return {"files": count, "no_clip_any_more": count - len(clips)} | _judge(
            clips, Lake(folder / "lake"), used, log
        )


def _judge(paths: list[str], lake: Lake, used: Usage, log: Path) -> dict[str, Any]:
    """Figures of a run over files that are clips by name and first bytes, as a text cut to three words is not."""
    with reading(lake) as con:
        taken = {path for (path,) in con.sql("SELECT DISTINCT path FROM clips").fetchall()}
        rejects = con.sql("SELECT path, line, reason FROM rejects ORDER BY path").fetchall()
        failed = con.sql("SELECT reason FROM manifest WHERE state <> 'ok'").fetchall()
    rejected = {path for path, _, _ in rejects}
    faults = [f"{path}: neither read nor rejected" for path in sorted(set(paths) - taken - rejected)]
    faults += [f"{path}: read and rejected" for path in sorted(taken & rejected)]
    faults += [f"{path}: {fault}: {text}" for path, _, text in rejects if (fault := fault_of_words(text))]
    faults += [f"shard failed: {reason}" for (reason,) in failed]
    faults += unsound_frames(lake)
    said = log.read_text(encoding="utf-8", errors="replace")
    if used.status not in (0, 1) or "Traceback" in said:
        faults.append(f"exit status {used.status}: {said[-500:]}")
    largest = max(used.driver, *used.workers, 0)
    if largest >= LARGEST:
        faults.append(f"a process held {largest / 2**20:.0f} MiB")
    by_format = Counter(_format(path) for path in paths)
    read = Counter(_format(path) for path in taken)
    return {
        "read": len(taken), "rejected": len(rejected),
        "lost": len(set(paths) - taken - rejected), "seconds": used.seconds,
        "largest_process_mib": largest / 2**20, "driver_mib": used.driver / 2**20,
        "workers_mib": [size / 2**20 for size in used.workers], "together_mib": used.together / 2**20,
        "read_of_format": {name: f"{read[name]} of {by_format[name]}" for name in sorted(by_format)},
        "reasons": len({re.sub(r"\d+|'[^']*'", "_", text) for _, _, text in rejects}), "faults": faults,
    }  # fmt: skip


def _format(path: str) -> str:
    reader = reader_for(Path(path))
    return reader.name if reader else "?"


def unsound_frames(lake: Lake) -> list[str]:
    """The clips of a lake whose frames hold what no body does."""
    faults = []
    for part in sorted(lake.root.glob("frames/*/*.parquet")):
        for clip in read_part(part):
            positions, rotations = clip.positions.astype(float), clip.rotations.astype(float)
            if not (np.abs(positions) <= FARTHEST).all():
                faults.append(f"{clip.clip}: a position that is not finite or absurd")
            if not (np.abs(np.linalg.norm(rotations, axis=-1) - 1.0) < 0.01).all():
                faults.append(f"{clip.clip}: a rotation that is none")
    return faults


def show(figures: dict[str, Any]) -> None:
    """On a few lines, with the first faults."""
    print(
        f"{figures['files']} damaged files: {figures['read']} read, {figures['rejected']} rejected "
        f"({figures['reasons']} kinds of reasons), {figures['lost']} lost, {figures['no_clip_any_more']} of which too "
        f"little is left to tell a clip; {figures['seconds']:.0f} s; largest process "
        f"{figures['largest_process_mib']:.0f} MiB, driver {figures['driver_mib']:.0f} MiB"
    )
    print(", ".join(f"{name} {share} read" for name, share in figures["read_of_format"].items()))
    for fault in figures["faults"][:SHOWN]:
        print(f"    FAULT {fault}")
