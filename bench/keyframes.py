"""Motion through keyframes, measured on clips left out: `python -m bench.keyframes`.

Poses of a clip of one fold, evenly apart in time, are given; recorded frames of the clips of the other folds lead from
each to the next (`motionlake.matching.keyed`). Beside it poses that are interpolated (`even_stretch`).
"""

from __future__ import annotations

import argparse
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.evaluation.synthesis.contact import footing
from motionlake.evaluation.synthesis.movement import energy
from motionlake.matching.recordings import longest_range
from motionlake.motion.generation import FPS, MotionRequest
from motionlake.motion.ground import ground_of
from motionlake.motion.keyframes import KeyPoses, even_stretch, through
from motionlake.motion.kinematics import continuous_signs, forward_kinematics
from motionlake.motion.resampling import resample
from motionlake.motion.skeleton import body_length
from motionlake.training import on_threads

from bench.canonical_sets import LabelledClip
from bench.matching import FOLDS, SETS, generator, parted
from bench.matching import recorded as recorded_at
from bench.matching_clips import offsets_of, seed_of
from bench.record import hash_files, record, recordings

GAPS: Final = (0.25, 0.5, 1.0, 2.0)  # seconds from pose to pose
CLIPS: Final = 4  # of every fold
SECONDS: Final = 10.0  # of a clip


def filled(label: str, fold: int, clip: LabelledClip, gap: float) -> dict[str, float] | None:
    """What is measured of one clip with a pose every `gap` seconds; None of one that is too short."""
    start, stop = longest_range(clip.positions, clip.rotations, clip.fps)
    stop = min(stop, start + round(SECONDS * clip.fps))
    rotations = continuous_signs(resample(clip.rotations[start:stop].astype(float), clip.fps, FPS, spherical=True))
    hips = resample(clip.positions[start:stop].astype(float), clip.fps, FPS)[:, 0]
    frames = np.arange(0, len(hips), round(gap * FPS))
    if len(frames) < 3:
        return None
    body = offsets_of(clip)
    keys = KeyPoses(frames, hips[frames], rotations[frames])
    true = forward_kinematics(hips, rotations, body)[: frames[-1] + 1]
    request = MotionRequest((label,), 1.0, 0, seed_of(clip), temperature=0.0, keys=keys)
    made = generator((label,), fold).generate([request])[0].positions
    even = forward_kinematics(*through(keys, [even_stretch(keys, i) for i in range(len(frames) - 1)]), body)
    ground, size = ground_of(recorded_at(clip)), body_length(body)
    found = {"missed": float(np.abs(made[frames] - true[frames]).max()), "energy_real": energy(true, FPS)}
    for name, motion in (("made", made), ("interpolated", even), ("real", true)):
        found[f"{name}_skates"] = footing(motion, FPS, ground).skates
        if name != "real":
            found[f"{name}_error"] = _error(motion, true) / size
            found[f"{name}_energy"] = energy(motion, FPS)
    return found


def _error(made: Float64Array, true: Float64Array) -> float:
    return float(np.linalg.norm(made - true, axis=-1).mean())


def of_class(label: str) -> dict[str, Any]:
    """Of every gap means over clips; energies as ratios to the recordings."""
    found: dict[str, Any] = {}
    for gap in GAPS:
        rows = [
            row
            for fold in range(FOLDS)
            for clip in parted(label, fold)[1][:CLIPS]
            if (row := filled(label, fold, clip, gap)) is not None
        ]
        if not rows:
            continue
        mean = {name: float(np.mean([row[name] for row in rows])) for name in rows[0]}
        for name in ("made", "interpolated"):
            mean[f"{name}_energy"] /= mean["energy_real"]
        found[f"{gap:g}"] = {**mean, "missed": max(row["missed"] for row in rows), "clips": len(rows)}
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("classes", nargs="*", default=list(SETS), help=f"of {', '.join(SETS)} (default: all)")
    figures: dict[str, Any] = {"classes": {}}
    with on_threads(1):
        for label in parser.parse_args().classes:
            figures["classes"][label] = found = of_class(label)
            for gap, row in found.items():
                print(label, gap, *(f"{name} {value:.4f}" for name, value in row.items()), flush=True)
    sets = [recordings() / name for name in ("cmu_bvh", "cmu_dance")]
    data = hash_files([p for folder in sets for p in folder.rglob("*") if p.is_file()], recordings())
    print(record("keyframes", figures, data))


if __name__ == "__main__":
    main()
