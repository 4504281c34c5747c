"""Motion of three rigs on three others: `python -m bench.retargeting` (docs/measurements.md).

Prints, for every set and every character of another: how far ankles that stand are from where they should be, how often
a bent knee is on the other side of its leg, how far limbs turn, and how a motion comes back. Needs MOTIONLAKE_DATA.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.formats import read_clips
from motionlake.motion.auto_rig import rig_of
from motionlake.motion.canonicalise import CanonicalMotion, canonicalise
from motionlake.motion.character import Character, character_of, leg_length
from motionlake.motion.clip import SourceClip
from motionlake.motion.kinematics import solve, world_rotations
from motionlake.motion.retarget import retarget
from motionlake.motion.rigs import load_rigs
from motionlake.motion.rotations import angle
from motionlake.motion.skeleton import INDEX
from motionlake.motion.standing import SIDES, contacts

from bench.record import record, recordings

SETS: Final = {"hdm05": "*/*.amc", "cmu_bvh": "*.bvh", "bandai1": "*.bvh", "cmu_dance": "**/*.bvh"}
CLIPS: Final = 8  # of a set
BENT: Final = 0.25  # of a thigh: a knee this far beside its leg is on a side
ARMS: Final = ("shoulder", "elbow", "wrist")


def clips_of(folder: Path) -> Iterator[tuple[SourceClip, CanonicalMotion, Character]]:
    """Some clips of a set, at even distances from the shortest to the longest."""
    paths = sorted((folder / "clips").glob(SETS[folder.name]), key=lambda path: (path.stat().st_size, path.name))
    for path in paths[:: max(1, len(paths) // CLIPS)][:CLIPS]:
        clip = read_clips(path)[0]
        rig = rig_of(clip, solve(clip), load_rigs())
        yield clip, canonicalise(clip, solve(clip), rig), character_of(clip, rig)


def beside(motion: CanonicalMotion, side: str) -> tuple[Float64Array, Float64Array]:
    """[F, 3] of a knee from the line from hip to ankle, and [F] its length in thighs."""
    hip, knee, ankle = (motion.positions[:, INDEX[f"{side}_{part}"]] for part in ("hip", "knee", "ankle"))
    along = (ankle - hip) / np.linalg.norm(ankle - hip, axis=1, keepdims=True)
    out = knee - hip - ((knee - hip) * along).sum(1, keepdims=True) * along
    return out, np.linalg.norm(out, axis=1) / np.linalg.norm(knee - hip, axis=1)


def compare(motion: CanonicalMotion, made: CanonicalMotion, scale: float) -> dict[str, Float64Array]:
    """Centimetres by which standing ankles are misplaced, [n] whether bent knees changed sides, degrees of arms."""
    stands, away, flips = contacts(motion.positions, motion.fps, motion.body_height), [], []
    for at, side in enumerate(SIDES):
        ankle = INDEX[f"{side}_ankle"]
        away.append((made.positions[:, ankle] - scale * motion.positions[:, ankle])[stands[:, at]])
        before, bend = beside(motion, side)
        flips.append(((before * beside(made, side)[0]).sum(1) < 0)[bend > BENT])
    every = np.concatenate(away)
    every[:, 1] -= np.median(every[:, 1]) if len(every) else 0  # how high ankles are over the ground
    one, two = world_rotations(motion.rotations), world_rotations(made.rotations)
    arms = [INDEX[f"{side}_{joint}"] for side in SIDES for joint in ARMS]
    turned = angle(one[:, arms], two[:, arms]).ravel()
    return {"feet": np.linalg.norm(every, axis=1) * 100, "flips": np.concatenate(flips).astype(float), "arms": turned}


def pair(clips: list[tuple[SourceClip, CanonicalMotion, Character]], target: Character) -> dict[str, float]:
    """The figures of the clips of one set on one character."""
    found: dict[str, list[Float64Array]] = {"feet": [], "flips": [], "arms": [], "back": []}
    rig = load_rigs()[target.rig]
    for clip, motion, own in clips:
        put = retarget(motion, target, own)
        made = canonicalise(put, solve(put), rig, metres_per_unit=target.metres_per_unit)
        scale = leg_length(target.rest_offsets) / leg_length(motion.rest_offsets)
        for name, values in compare(motion, made, scale).items():
            found[name].append(values)
        back = solve(retarget(made, own, target)).positions - solve(clip).positions
        rows = list(own.source.values())
        found["back"].append(np.linalg.norm(back[:, rows], axis=-1).ravel() * own.metres_per_unit * 100)
    every = {name: np.concatenate(values) for name, values in found.items()}
    return {
        "frames that stand": float(len(every["feet"])),
        "feet, largest cm": round(float(every["feet"].max(initial=0)), 2),
        "feet, 99 % below cm": round(float(np.quantile(every["feet"], 0.99)), 3) if len(every["feet"]) else 0.0,
        "bent knees": float(len(every["flips"])),
        "knees turned over": float(every["flips"].sum()),
        "arms, largest degrees": round(float(every["arms"].max()), 2),
        "there and back, mean cm": round(float(every["back"].mean()), 3),
        "there and back, 99 % below cm": round(float(np.quantile(every["back"], 0.99)), 2),
    }


def main() -> None:
    folder = recordings()
    sets = {name: list(clips_of(folder / name)) for name in SETS if (folder / name).is_dir()}
    figures: dict[str, dict[str, float]] = {}
    for name, clips in sets.items():
        for other, of_other in sets.items():
            if other != name:
                figures[f"{name} on {other}"] = pair(clips, of_other[0][2])
                print(f"{name} on {other}: {figures[f'{name} on {other}']}", flush=True)
    print(record("retargeting", figures))


if __name__ == "__main__":
    main()
