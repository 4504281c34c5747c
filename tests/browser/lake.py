"""A small lake of real recordings for the tests of the browser application, with every stage that views show."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

from tests.lakes import QUICK, motionlake, quick_lake, write_labels

# How many of the smallest clips of each set, or which ones.
SETS = {"bandai1": ("*.bvh", 8), "hdm05": ("*.amc", 10), "utd_mhad": ("*.npz", 8), "cmu_bvh": ("*.bvh", 8)}
SEGMENTED = ("26_01.bvh", "27_01.bvh", "29_01.bvh")


def browser_clips(recordings: Path, folder: Path) -> None:
    """Some forty clips with labels, three of them cut into labelled segments, and one recording twice."""
    rows: list[dict[str, str]] = []
    for name, (pattern, count) in SETS.items():
        base = recordings / name
        labels = {row["file"]: row for row in csv.DictReader((base / "labels.csv").open(encoding="utf-8"))}
        paths = sorted((base / "clips").rglob(pattern), key=lambda path: (path.stat().st_size, path.name))[:count]
        if name == "cmu_bvh":
            paths += [base / "clips" / file for file in SEGMENTED]
        for number, path in enumerate(paths):
            target = folder / name / path.relative_to(base / "clips")
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, target)
            row = labels.get(path.relative_to(base).as_posix(), {})
            label = row.get("label") or row.get("description") or ""
            known = "" if number % 5 == 4 else label  # some are left for people to label
            about = {"label": known, "subject": row.get("subject") or ""}
            rows.append({"file": target.relative_to(folder).as_posix(), **about})
        for companion in (base / "clips").rglob("*.asf"):
            shutil.copyfile(companion, folder / name / companion.relative_to(base / "clips"))
    copy = folder / "cmu_bvh" / "again_26_01.bvh"
    shutil.copyfile(folder / "cmu_bvh" / "26_01.bvh", copy)
    write_labels(folder / "labels.csv", rows)
    with (recordings / "cmu_bvh" / "segments.csv").open(encoding="utf-8") as handle:
        spans = [row for row in csv.DictReader(handle) if Path(row["file"]).name in SEGMENTED]
    write_labels(folder / "segments.csv", [{**row, "file": f"cmu_bvh/{Path(row['file']).name}"} for row in spans])


def browser_lake(clips: Path, lake: Path, scheduler: str) -> None:
    """A lake of those clips."""
    quick_lake(lake, QUICK)
    for words in (["ingest", clips], ["run", "all"], ["run", "quality"], ["run", "synth"]):
        run = motionlake(*words, "--lake", lake, "--scheduler", scheduler)
        assert run.status in (0, 1), run.err
