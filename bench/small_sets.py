"""A few short clips of every set of recordings, in the folders and with the tables that the sets have."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bench.random_crops import Cut, cut_amc, cut_bvh

Row = dict[str, str]


@dataclass(frozen=True)
class Chosen:
    """What is taken of a set.

    Attributes:
        frames: that clips are cut to, from their first; 0 leaves them whole.
        each: clips of every group, the smallest files.
        columns: of labels.csv, by whose values clips are grouped.
        groups: those that are taken; every one if empty.
    """

    frames: int = 0
    each: int = 2
    columns: tuple[str, ...] = ()
    groups: tuple[str, ...] = ()


CHOSEN: Final[Mapping[str, Chosen]] = {
    "hdm05": Chosen(0, 2, ("label", "split"), ("kickLFront1Reps", "jogLeftCircle4StepsRstart", "hopBothLegs1hops")),
    "bandai1": Chosen(120, 2, ("label",), ("walk", "run", "dash", "kick", "punch")),
    "cmu_bvh": Chosen(480, 2, ("description",), ("walk", "slow walk", "run/jog", "punch/strike")),
    "cmu_dance": Chosen(600, 2, ("label", "subject")),
    "cmu_exercises": Chosen(1300, 5, ("subject",)),
    "cmu_86": Chosen(2400, 1),
    "utd_mhad": Chosen(0, 1, ("label", "split", "subject"), ("walk", "boxing", "clap")),
}
CUTS: Final[Mapping[str, Callable[[Path], Cut]]] = {".bvh": cut_bvh, ".amc": cut_amc}


def write_small_sets(data: Path, folder: Path) -> None:
    """Write the clips of `CHOSEN` out of the sets of `data` below `folder`."""
    for name, chosen in CHOSEN.items():
        source, target = data / name, folder / name
        taken = _clips(source, chosen)
        for file in taken:
            (target / file).parent.mkdir(parents=True, exist_ok=True)
            cut = CUTS.get((source / file).suffix) if chosen.frames else None
            if cut:
                (target / file).write_bytes(cut(source / file)(0, chosen.frames))
            else:
                shutil.copyfile(source / file, target / file)
        for skeleton in (source / "clips").rglob("*.asf"):
            shutil.copyfile(skeleton, target / skeleton.relative_to(source))
        for table in ("labels.csv", "segments.csv"):
            if (source / table).is_file():
                _write(target / table, [row for row in _rows(source / table) if _within(row, taken, chosen.frames)])


def _clips(source: Path, chosen: Chosen) -> list[str]:
    """The files taken of a set, as its tables name them."""
    if not chosen.columns:
        return sorted(p.relative_to(source).as_posix() for p in (source / "clips").rglob("*.amc"))[: chosen.each]
    groups: dict[tuple[str, ...], list[str]] = {}
    for row in _rows(source / "labels.csv"):
        if not chosen.groups or row[chosen.columns[0]] in chosen.groups:
            groups.setdefault(tuple(row[column] for column in chosen.columns), []).append(row["file"])
    by_size = (sorted(files, key=lambda file: (source / file).stat().st_size) for files in groups.values())
    return [file for files in by_size for file in files[: chosen.each]]


def _within(row: Row, taken: list[str], frames: int) -> bool:
    return row["file"] in taken and (not frames or int(row.get("stop") or 0) <= frames)


def _rows(table: Path) -> list[Row]:
    with table.open(newline="", encoding="utf-8") as handle:
        return list(csv.DictReader(handle))


def _write(table: Path, rows: list[Row]) -> None:
    with table.open("w", newline="", encoding="utf-8") as handle:
        writer = csv.DictWriter(handle, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
