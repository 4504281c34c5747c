"""Whether alarms that count as mistakes are faults of the recordings, by what the checks do not look at.

`python -m bench.quality_evidence`. In `bench.quality` a clip in which a fault is told without having been planted
counts against precision. Here two of its rows stand beside the same with alarms taken for right that another measure
confirms:

- `spike` of cmu_dance, which the check finds in where joints are: the hips tip over by more than 1,000 degrees a
  second (trunks of pitchers tilt by 340 to 380 at most: J Sports Sci Med 14, 246, table 3). Turning about the upright
  axis does not count.
- `limb_drift` of utd_mhad, which the check finds beside the clip's own median: the bone leaves by as much the median
  that the same person's other clips give.

The control is a place drawn by seed where nothing of the kind is told. Thresholds are the program's, which are those
that `bench.quality` chooses for these two on the other sets.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.quality import Fault, Recording
from motionlake.motion.quality.bones import LIMBS
from motionlake.motion.quality_config import QualityConfig
from motionlake.motion.rotations import rotate
from motionlake.motion.skeleton import INDEX, PARENTS

from bench.plants import Subject
from bench.quality import MOST, READ, read_set
from bench.quality_thresholds import THRESHOLDS, is_found, planted
from bench.record import hash_files, record, recordings

TIPS_OVER: Final = 1_000.0  # degrees a second
FRAMES: Final = {"spike": 3, "limb_drift": 8}  # of a place that is drawn for the control
SLACK: Final = 2  # frames around a spike
_PERSON: Final = re.compile(r"_(s\d+)_")

# Whether a fault of clip n is one of the recording.
Evidence = Callable[[int, Fault], bool]


def tips_over(subjects: Sequence[Subject]) -> Evidence:
    """Whether the hips turn away from upright faster than any person's."""
    tilts = [_tilt(subject.recording) for subject in subjects]

    def told(clip: int, fault: Fault) -> bool:
        within = tilts[clip][max(0, fault.start - SLACK) : fault.stop + SLACK - 1]
        return bool(within.max(initial=0.0) > TIPS_OVER)

    return told


def _tilt(recording: Recording) -> Float64Array:
    """[F - 1] degrees a second by which the hips' up axis turns."""
    up = rotate(np.ascontiguousarray(recording.rotations[:, 0]), np.array([0.0, 1.0, 0.0]))
    cosines = np.clip((up[1:] * up[:-1]).sum(axis=1), -1.0, 1.0)
    return np.asarray(np.degrees(np.arccos(cosines)) * recording.fps)


def not_the_persons(subjects: Sequence[Subject]) -> Evidence:
    """Whether a limb's bone is longer or shorter than in the other clips of the same person, by `limb_drift`."""
    joints = [INDEX[name] for name in LIMBS]
    lengths = [_lengths(subject.recording, joints) for subject in subjects]
    medians = np.array([np.median(each, axis=0) for each in lengths])
    people = [found[1] if (found := _PERSON.search(subject.name)) else subject.name for subject in subjects]
    least = QualityConfig().limb_drift

    def told(clip: int, fault: Fault) -> bool:
        others = [other for other, person in enumerate(people) if person == people[clip] and other != clip]
        limb = LIMBS.index(fault.joint)
        own = np.median(lengths[clip][fault.start : fault.stop, limb])
        return bool(others) and bool(abs(own / np.median(medians[others, limb]) - 1) > least)

    return told


def _lengths(recording: Recording, joints: Sequence[int]) -> Float64Array:
    """[F, joints] metres of the bones that end at joints."""
    ends = recording.positions[:, joints] - recording.positions[:, [PARENTS[joint] for joint in joints]]
    return np.asarray(np.linalg.norm(ends, axis=2))


ROWS: Final = (("cmu_dance", "spike", tips_over), ("utd_mhad", "limb_drift", not_the_persons))


def measured(kind: str, subjects: Sequence[Subject], evidence: Evidence) -> dict[str, Any]:
    """The row of `bench.quality`, and the same with confirmed alarms taken for right."""
    config, check = QualityConfig(), THRESHOLDS[kind].check
    made = [each for number, subject in enumerate(subjects) if (each := planted(kind, subject, number)) is not None]
    found = sum(is_found(kind, each, check(each.recording, config).faults) for each in made)
    faults = [[f for f in check(s.recording, config).faults if f.kind == kind] for s in subjects]
    told = [[evidence(clip, fault) for fault in each] for clip, each in enumerate(faults)]
    control = [evidence(*place) for place in _elsewhere(kind, subjects, faults)]
    counts = {
        "planted": len(made), "found": found, "plain": len(subjects), "alarms": sum(map(bool, faults)),
        "confirmed": sum(map(any, told)), "ranges": sum(map(len, told)), "ranges_confirmed": sum(map(sum, told)),
        "control": len(control), "control_wrong": sum(control),
    }  # fmt: skip

    def precision(alarms: int) -> float:
        return found / (found + alarms * len(made) / len(subjects))

    return {
        **counts, "recall": found / len(made), "precision": precision(counts["alarms"]),
        "precision_with_evidence": precision(counts["alarms"] - counts["confirmed"]),
    }  # fmt: skip


def _elsewhere(kind: str, subjects: Sequence[Subject], faults: Sequence[Sequence[Fault]]) -> list[tuple[int, Fault]]:
    """A place of each clip, and of a limb, where nothing of the kind is told; none of a clip without such a place."""
    random, found = np.random.default_rng(0), []
    for clip, (subject, own) in enumerate(zip(subjects, faults, strict=True)):
        free = [
            (joint, start)
            for joint in LIMBS
            for start in range(max(1, len(subject.recording) - FRAMES[kind]))
            if not any(
                f.start < start + FRAMES[kind] and f.stop > start and (kind == "spike" or f.joint == joint) for f in own
            )
        ]
        if free:
            joint, start = free[int(random.integers(len(free)))]
            found.append((clip, Fault(kind=kind, joint=joint, start=start, stop=start + FRAMES[kind], severity=0.0)))
    return found


def main() -> None:
    figures: dict[str, dict[str, Any]] = {}
    for name, kind, evidence in ROWS:
        subjects = read_set(name, MOST).subjects
        figures[f"{kind}, {name}"] = measured(kind, subjects, evidence(subjects))
        print(name, kind, figures[f"{kind}, {name}"])
    files = [path for name, _, _ in ROWS for path in (recordings() / READ[name].folder).rglob("*") if path.is_file()]
    print(record("quality-evidence", figures, hash_files(files, recordings())))


if __name__ == "__main__":
    main()
