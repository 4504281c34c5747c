"""Faults planted in real recordings, and how many `motionlake check` finds: `python -m bench.quality [--tuning]`.

Every fault is planted once in every clip in which it can be, at a place and of a severity drawn by seed. A planted clip
counts as found where a fault of that kind overlaps what was planted, and the same clip without it as a false alarm
where one of that kind is told; so precision counts faults that a recording had before against the check. Thresholds
were chosen on the first clips of each set (`--tuning`), shuffled by seed; figures are of all others. The first frame of
cmu_bvh, a T-pose of calibration, is cut off but for the row that counts how often it is found. The bar is precision and
recall of 0.9, and false alarms in 5 % of clean CMU clips.
"""

from __future__ import annotations

import argparse
import random
from collections import Counter
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from motionlake.motion.quality import Quality, Recording, check
from motionlake.motion.quality.scale import falls, steps
from motionlake.motion.quality_config import QualityConfig

from bench.canonical_sets import SETS, LabelledClip, LabelledSet, read
from bench.plants import PLANTS, Planted, Subject
from bench.record import hash_files, record, recordings

CMU: Final = "cmu_bvh"
READ: Final = {CMU: LabelledSet(CMU, "description"), "hdm05": SETS["hdm05"], "bandai1": SETS["bandai1"]}
TUNING: Final = {CMU: 45, "hdm05": 60, "bandai1": 45}  # clips on which thresholds were chosen
LONGEST: Final = 20.0  # seconds of a clip that are used
BAR: Final = 0.9
ALARMS: Final = 0.05


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--tuning", action="store_true", help="The clips on which thresholds were chosen; nothing is kept."
    )
    tuning = parser.parse_args().tuning
    figures = {name: measured(name, tuning=tuning) for name in READ}
    figures["all"] = _together(list(figures.values()))
    for name, found in figures.items():
        print(f"{name}: {found['clips']} clips, {found['clean']} of them without any fault")
        for kind, row in found["faults"].items():
            print(f"  {kind:14}" + "".join(f"{key} {_shown(row[key]):8}" for key in row))
    print(f"first frame of {CMU} told as a T-pose: {figures[CMU]['calibration']}")
    if not tuning:
        files = [path for each in READ.values() for path in (recordings() / each.folder).rglob("*") if path.is_file()]
        print(record("quality", figures, hash_files(files, recordings())))


def _shown(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def measured(name: str, *, tuning: bool) -> dict[str, Any]:
    """Of a set of recordings."""
    config = QualityConfig()
    clips = read(READ[name])
    clips.sort(key=lambda clip: clip.name)
    random.Random(0).shuffle(clips)
    clips = clips[: TUNING[name]] if tuning else clips[TUNING[name] :] or clips
    calibration = [_t_first(clip, config) for clip in clips] if name == CMU else []
    subjects = [_subject(clip, 1 if name == CMU else 0) for clip in clips]
    plain = [check(subject.recording, config) for subject in subjects]
    faults = {kind: _row(kind, subjects, plain, config) for kind in PLANTS}
    tellable = [bool(falls(s.recording) or steps(s.recording)) for s in subjects]
    chosen = [i for i, told in enumerate(tellable) if told]
    faults["fps_tellable"] = _row("fps", [subjects[i] for i in chosen], [plain[i] for i in chosen], config)
    return {
        "clips": len(subjects),
        "clean": sum(not quality.faults for quality in plain),
        "verdicts": Counter(quality.verdict for quality in plain),
        "calibration": f"{sum(calibration)} of {len(calibration)}",
        "alarms": {
            s.name: sorted({f.kind for f in q.faults}) for s, q in zip(subjects, plain, strict=True) if q.faults
        },
        "faults": faults,
    }


def _subject(clip: LabelledClip, first: int) -> Subject:
    stop = first + round(LONGEST * clip.fps)
    assert clip.rest_offsets is not None
    recording = Recording(clip.positions[first:stop], clip.rotations[first:stop], clip.fps)
    return Subject(clip.name, recording, clip.rest_offsets)


def _t_first(clip: LabelledClip, config: QualityConfig) -> bool:
    return any(f.kind == "tpose_start" for f in check(_subject(clip, 0).recording, config).faults)


def _row(kind: str, subjects: Sequence[Subject], plain: Sequence[Quality], config: QualityConfig) -> dict[str, Any]:
    planted = found = 0
    for number, subject in enumerate(subjects):
        made = _planted(kind, subject, number)
        if made is not None:
            planted += 1
            found += _is_found(kind, made, check(made.recording, config))
    alarms = sum(any(fault.kind == kind for fault in quality.faults) for quality in plain)
    return _rates(planted, found, len(plain), alarms)


def _rates(planted: int, found: int, clean: int, alarms: int) -> dict[str, Any]:
    # As many clips without as with the fault, so that precision does not depend on where it could be planted.
    false = alarms * planted / clean if clean else 0.0
    return {
        "planted": planted, "found": found, "recall": found / planted if planted else None,
        "precision": found / (found + false) if found + false else None, "clean": clean, "alarms": alarms,
        "alarm_rate": alarms / clean if clean else None,
    }  # fmt: skip


def _planted(kind: str, subject: Subject, number: int) -> Planted | None:
    """The fault in a clip; a place where it cannot be is drawn again."""
    drawn = np.random.default_rng([list(PLANTS).index(kind), number])
    return next((made for made in (PLANTS[kind](subject, drawn) for _ in range(5)) if made is not None), None)


def _is_found(kind: str, made: Planted, quality: Quality) -> bool:
    slack = 2
    return any(f.kind == kind and f.start < made.stop + slack and f.stop > made.start - slack for f in quality.faults)


def _together(sets: Sequence[dict[str, Any]]) -> dict[str, Any]:
    rows: dict[str, Any] = {}
    for kind in sets[0]["faults"]:
        counts = [sum(one["faults"][kind][key] for one in sets) for key in ("planted", "found", "clean", "alarms")]
        rows[kind] = _rates(*counts)
    return {"clips": sum(s["clips"] for s in sets), "clean": sum(s["clean"] for s in sets), "faults": rows}


if __name__ == "__main__":
    main()
