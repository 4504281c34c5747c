"""Alarms in a set of recordings, drawn for a person to judge: `python -m bench.quality_alarms OUT SET KIND`.

Precision in `bench.quality` takes every fault that a recording had before for a false alarm. Whether it is one, only a
person can say. Thresholds are those of the program. Each clip in which the fault is told has a panel of its worst range
and what is around it:

- slide: of ankle and toe of the foot that slides, the height above where they rest (cm) and the speed over the ground
  (m/s), and thin the speed of the other foot;
- spike: the way of the joint over time, each axis in cm from its middle, and how far each frame is from the mean of the
  two beside it;
- penetration: the heights of ankle and toe of either foot, in cm above where feet rest.

`judged.csv` in OUT lists the clips; who looks writes "fault", "none" or "doubtful" into its second column, and
`python -m bench.quality_alarms OUT SET KIND --judged FILE` counts them.
"""

from __future__ import annotations

import argparse
import csv
from collections import Counter
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import FloatArray
from motionlake.motion.quality import Recording, check
from motionlake.motion.quality.faults import Fault
from motionlake.motion.quality_config import QualityConfig
from motionlake.motion.skeleton import INDEX

from bench.quality import MOST, READ, read_set
from bench.record import hash_files, record, recordings

AROUND: Final = 0.7  # seconds before and after a range
LONGEST: Final = 3.0  # seconds of it that are drawn
COLUMNS: Final = 4
ROWS: Final = 4
ANSWERS: Final = ("fault", "none", "doubtful")


def alarms(name: str, kind: str) -> list[tuple[str, Recording, Fault]]:
    """(clip, recording, its worst fault of the kind) of every clip of a set that has one."""
    found = []
    for subject in read_set(name, MOST).subjects:
        faults = [fault for fault in check(subject.recording, QualityConfig()).faults if fault.kind == kind]
        if faults:
            found.append((subject.name, subject.recording, max(faults, key=lambda fault: fault.severity)))
    found.sort(key=lambda each: (each[0], each[2].start))
    # Takes of several subjects are called alike.
    return [(f"{number} {clip}", recording, fault) for number, (clip, recording, fault) in enumerate(found, 1)]


def feet(positions: FloatArray, fps: float) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Of ankles and toes [F] the height above where they rest in the recording, cm, and the speed over the ground."""
    found: dict[str, tuple[FloatArray, FloatArray]] = {}
    for side in ("left", "right"):
        for joint in (f"{side}_ankle", f"{side}_toe"):
            path = positions[:, INDEX[joint]]
            height = 100 * (path[:, 1] - np.quantile(path[:, 1], 0.05))
            speed = np.linalg.norm(np.gradient(path[:, [0, 2]], axis=0), axis=1) * fps
            found[joint] = height, speed
    return found


def draw(axes: Any, recording: Recording, fault: Fault) -> None:
    """The panel of one alarm."""
    positions, fps = np.asarray(recording.positions, float), recording.fps
    stop = min(fault.stop, fault.start + round(LONGEST * fps))
    first, last = max(0, fault.start - round(AROUND * fps)), min(len(positions), stop + round(AROUND * fps))
    seconds = np.arange(first, last) / fps
    shown = slice(first, last)
    axes.axvspan(fault.start / fps, stop / fps, color="#f4c7b8", lw=0)
    if fault.kind == "spike":
        path = positions[:, INDEX[fault.joint]]
        off = np.zeros(len(path))
        off[1:-1] = 100 * np.linalg.norm(path[1:-1] - (path[2:] + path[:-2]) / 2, axis=1)
        for axis, color in zip(range(3), ("#1b6ca8", "#2f8f4e", "#8a5fb0"), strict=True):
            way = 100 * path[shown, axis]
            axes.plot(seconds, way - np.median(way), color=color, lw=1)
        axes.plot(seconds, 10 * off[shown], color="black", lw=0.8)
        return
    measured = feet(positions, fps)
    if fault.kind == "penetration":
        for (joint, (height, _)), color in zip(
            measured.items(), ("#1b6ca8", "#7db8e0", "#2f8f4e", "#9ed0ac"), strict=True
        ):
            axes.plot(seconds, height[shown], color=color, lw=1, label=joint)
        axes.axhline(0, color="black", lw=0.5)
        return
    side = "left" if fault.joint.startswith("left") else "right"
    other = "right" if side == "left" else "left"
    beside = axes.twinx()
    for part, style in (("ankle", "-"), ("toe", "--")):
        axes.plot(seconds, measured[f"{side}_{part}"][0][shown], color="#1b6ca8", ls=style, lw=1.2)
        beside.plot(seconds, measured[f"{side}_{part}"][1][shown], color="#c0392b", ls=style, lw=1.2)
        beside.plot(seconds, measured[f"{other}_{part}"][1][shown], color="#999999", ls=style, lw=0.5)
    axes.set_ylim(-3, 15)
    beside.set_ylim(0, 1.2)
    beside.axhline(QualityConfig().slide, color="#c0392b", lw=0.4)
    beside.tick_params(labelsize=6, colors="#c0392b")


def sheets(found: list[tuple[str, Recording, Fault]], out: Path) -> None:
    """Pages of panels."""
    from matplotlib.figure import Figure

    most = COLUMNS * ROWS
    for page, start in enumerate(range(0, len(found), most), 1):
        figure = Figure(figsize=(20, 13), layout="constrained")
        panels = figure.subplots(ROWS, COLUMNS, squeeze=False).ravel()
        for axes, (clip, recording, fault) in zip(panels, found[start : start + most], strict=False):
            draw(axes, recording, fault)
            axes.set_title(f"{clip} {fault.joint} {fault.severity:.3g}", fontsize=8)
            axes.tick_params(labelsize=6)
        for axes in panels[len(found) - start :]:
            axes.set_axis_off()
        figure.savefig(out / f"page-{page}.png", dpi=80)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("set", choices=READ)
    parser.add_argument("kind", choices=("slide", "spike", "penetration"))
    parser.add_argument("--judged", type=Path, help="a file of clips and what was seen, to be counted")
    given = parser.parse_args()
    found = alarms(given.set, given.kind)
    if given.judged:
        with given.judged.open(newline="", encoding="utf-8") as handle:
            seen = {row["clip"]: row for row in csv.DictReader(handle)}
        answers = Counter(row["seen"] for row in seen.values())
        if set(seen) != {clip for clip, _, _ in found} or not set(answers) <= set(ANSWERS):
            parser.error(f"{given.judged} is not of these {len(found)} clips, each {', '.join(ANSWERS)}")
        figures = {"set": given.set, "kind": given.kind, "seen": answers, "clips": seen}
        files = [path for path in (recordings() / READ[given.set].folder).rglob("*") if path.is_file()]
        print(dict(answers), record("quality-alarms", figures, hash_files(files, recordings())))
        return
    given.out.mkdir(parents=True, exist_ok=True)
    sheets(found, given.out)
    with (given.out / "judged.csv").open("w", newline="", encoding="utf-8") as handle:
        csv.writer(handle).writerows([("clip", "seen", "why"), *((clip, "", "") for clip, _, _ in found)])
    print(f"{len(found)} clips in {given.out}")


if __name__ == "__main__":
    main()
