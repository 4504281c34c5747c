"""How near `motionlake clean` brings clips with planted slides and sunk bodies: `python -m bench.mending`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.canonicalise import CanonicalMotion
from motionlake.motion.kinematics import forward_kinematics
from motionlake.motion.quality import Recording, check
from motionlake.motion.quality.mend import mended
from motionlake.motion.quality_config import QualityConfig

from bench.plants import Subject
from bench.quality import READ, read_set
from bench.quality_thresholds import is_found, planted
from bench.record import hash_files, record, recordings

KINDS: Final = ("slide", "penetration")
MOST: Final = 60  # clips of a set, drawn by seed
LIKE: Final = 1.001  # times the jerk before; what is not that of another number format


def main() -> None:
    figures = {name: mending(read_set(name, MOST).subjects, QualityConfig()) for name in READ}
    for name, found in figures.items():
        print(name, found)
    files = [path for each in READ.values() for path in (recordings() / each.folder).rglob("*") if path.is_file()]
    print(record("mending", figures, hash_files(files, recordings())))


def mending(subjects: Sequence[Subject], config: QualityConfig) -> dict[str, Any]:
    """Of a set, for each kind: clips that were mended, and medians before and after.

    `apart` is the mean distance of joints from the clip without the fault, metres; `slide` and `penetration` are the
    measures of the check; `rougher` counts clips whose largest jerk grew.
    """
    return {kind: _of_kind(kind, subjects, config) for kind in KINDS}


def _of_kind(kind: str, subjects: Sequence[Subject], config: QualityConfig) -> dict[str, Any]:
    rows = []
    for number, subject in enumerate(subjects):
        made = planted(kind, subject, number)
        if made is None:
            continue
        faults = check(made.recording, config).faults
        if not is_found(kind, made, faults):
            continue
        broken = _motion(made.recording, subject.rest_offsets)
        copy, done = mended(broken, [fault for fault in faults if fault.kind == kind])
        whole = forward_kinematics(subject.recording.positions[:, 0], broken.rotations, subject.rest_offsets)
        before, after = (check(_recording(each), config) for each in (broken, copy))
        rows.append(
            (
                bool(done), _apart(broken.positions, whole), _apart(copy.positions, whole),
                before.measures[kind], after.measures[kind],
                _jerk(copy.positions) > LIKE * _jerk(broken.positions),
                not is_found(kind, made, after.faults),
            )
        )  # fmt: skip
    if not rows:
        return {"found": 0}
    kept = [row for row in rows if row[0]]
    middle = np.median(np.array([row[1:5] for row in kept]), axis=0).tolist() if kept else [None] * 4
    return {
        "found": len(rows), "mended": len(kept), "apart": middle[0], "apart_after": middle[1], kind: middle[2],
        f"{kind}_after": middle[3], "nearer": sum(row[2] < row[1] for row in kept),
        "rougher": sum(row[5] for row in kept), "gone": sum(row[6] for row in kept),
    }  # fmt: skip


def _motion(recording: Recording, rest_offsets: Float64Array) -> CanonicalMotion:
    places = forward_kinematics(recording.positions[:, 0], recording.rotations, rest_offsets)
    return CanonicalMotion(
        fps=recording.fps, root=recording.positions[:, 0], rotations=recording.rotations, positions=places,
        rest_offsets=rest_offsets, body_height=recording.height, twist=recording.twist, filled=recording.filled, up="y",
        metres_per_unit=1.0, fk_error=0.0, fk_error_mean=0.0,
    )  # fmt: skip


def _recording(motion: CanonicalMotion) -> Recording:
    return Recording(motion.positions, motion.rotations, motion.fps, motion.twist, motion.filled)


def _apart(one: Float64Array, other: Float64Array) -> float:
    return float(np.linalg.norm(one - other, axis=2).mean())


def _jerk(places: Float64Array) -> float:
    return float(np.abs(np.diff(places, 3, axis=0)).max(initial=0.0))


if __name__ == "__main__":
    main()
