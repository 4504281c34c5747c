"""Real motion as HumanML3D's numbers and back: `python -m bench.humanml3d` (docs/humanml3d.md).

Clips of four sets are put on SMPL's mean body at 20 frames a second, written, and read again. Prints, for every set,
how far joints and standing feet are from where they were, how the body faces, how far joints turn from how they did,
with and without the turns about bones, and frames a second. Needs MOTIONLAKE_DATA.
"""

from __future__ import annotations

import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.formats import read_clips
from motionlake.formats.write.registry import ClipToWrite, set_writers
from motionlake.motion.character import character_of, zero_clip
from motionlake.motion.clip import SourceClip
from motionlake.motion.humanml3d import FPS, placed
from motionlake.motion.kinematics import solve
from motionlake.motion.posing import resampled
from motionlake.motion.retarget import retarget
from motionlake.motion.rigs import load_rigs
from motionlake.motion.rotations import angle, conjugate, multiply
from motionlake.motion.smpl import BODY_JOINTS, INDEX, smpl_hierarchy
from motionlake.motion.smpl_from_joints import CHILDREN

from bench.record import record, recordings
from bench.retargeting import SETS, clips_of

ANKLES: Final = [INDEX["left_ankle"], INDEX["right_ankle"]]
STEADY: Final = 0.005  # metres a frame: an ankle that goes less stands
BORNE: Final = [joint for joint in range(BODY_JOINTS) if CHILDREN[joint]]


def on_smpl(folder: Path) -> list[SourceClip]:
    """Some clips of a set on SMPL's mean body, at HumanML3D's rate."""
    target = character_of(zero_clip(smpl_hierarchy()), load_rigs()["smpl"])
    return [resampled(retarget(motion, target, own), FPS) for _, motion, own in clips_of(folder)]


def seen(clip: SourceClip) -> tuple[Float64Array, Float64Array]:
    """[F, 22, 3] joints as HumanML3D places them, and [F, 22, 4] rotations as the pelvis sees them."""
    motion = solve(clip)
    assert motion.world is not None
    world = motion.world[:, :BODY_JOINTS]
    return placed(motion.positions[:, :BODY_JOINTS])[0], multiply(conjugate(world[:, :1]), world)


def there_and_back(clips: list[SourceClip], folder: Path) -> dict[str, float]:
    """The figures of a set."""
    found: dict[str, list[Float64Array]] = {"joints": [], "feet": [], "facing": [], "twist": [], "smallest": []}
    wrote = read = 0.0
    for form, kind in (("humanml3d", "smallest"), ("humanml3d-twist", "twist")):
        out = folder / form
        out.mkdir()
        start = time.perf_counter()
        set_writers()[form].write_all((ClipToWrite(f"{n:03d}", clip, 1.0) for n, clip in enumerate(clips)), out)
        wrote += time.perf_counter() - start
        for number, clip in enumerate(clips):
            start = time.perf_counter()
            [again] = read_clips(out / "new_joint_vecs" / f"{number:03d}.npy")
            read += time.perf_counter() - start
            (before, turned), (after, turned_again) = seen(clip), seen(again)
            off = np.linalg.norm(after - before, axis=-1)
            stands = np.linalg.norm(np.diff(before[:, ANKLES], axis=0), axis=-1) < STEADY
            hips = [rows[:, INDEX["left_hip"]] - rows[:, INDEX["right_hip"]] for rows in (before, after)]
            facing = [np.arctan2(-each[:, 2], each[:, 0]) for each in hips]
            found["joints"].append(off.ravel())
            found["feet"].append(off[1:, ANKLES][stands])
            found["facing"].append(np.abs(np.angle(np.exp(1j * (facing[1] - facing[0])))))
            found[kind].append(angle(turned, turned_again)[:-1, BORNE].ravel())
    every = {name: np.concatenate(values) for name, values in found.items()}
    frames = 2 * sum(len(clip.channels) for clip in clips)
    return {
        "clips": len(clips),
        "frames": frames // 2,
        "joints, largest mm": float(1000 * every["joints"].max()),
        "standing feet, largest mm": float(1000 * every["feet"].max(initial=0)),
        "facing, largest degrees": float(np.rad2deg(every["facing"].max())),
        "rotations with twist, largest degrees": float(every["twist"].max()),
        "rotations of smallest turns, median degrees": float(np.median(every["smallest"])),
        "rotations of smallest turns, 99 % below degrees": float(np.quantile(every["smallest"], 0.99)),
        "frames a second written": round(frames / wrote),
        "frames a second read": round(frames / read),
    }


def main() -> None:
    figures: dict[str, dict[str, float]] = {}
    for name in SETS:
        folder = recordings() / name
        if folder.is_dir():
            clips = on_smpl(folder)
            with TemporaryDirectory() as temporary:
                there_and_back(clips[:1], Path(temporary))  # code is compiled at its first use
            with TemporaryDirectory() as temporary:
                figures[name] = there_and_back(clips, Path(temporary))
            print(f"{name}: {figures[name]}", flush=True)
    print(record("humanml3d", figures))


if __name__ == "__main__":
    main()
