"""Motion matching, measured on clips left out: `python -m bench.matching`.

The clips of every class are dealt to three folds; a motion goes on from a clip of one fold, and the database holds the
clips of the others. Real clips are measured without their calibration poses. Contacts are seen otherwise than by what
plants feet: of all ankles and toes near the ground the slowest bears the body, and a body skates where even that one
travels.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Sequence
from dataclasses import asdict
from functools import cache
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.evaluation.synthesis.contact import Footing, footing
from motionlake.evaluation.synthesis.movement import bone_length_drift, energy, travel_speed
from motionlake.matching.database import build_database
from motionlake.matching.generator import MatchingGenerator
from motionlake.matching.recordings import MatchingClip, sound_ranges
from motionlake.motion.features import body_length
from motionlake.motion.generation import FPS, Control, GeneratedMotion, MotionRequest, SeedClip
from motionlake.motion.ground import Ground, ground_of
from motionlake.motion.paths import GroundPath, shape_path
from motionlake.motion.resampling import resample
from motionlake.motion.skeleton import body_poses
from motionlake.training import on_threads

from bench.canonical_sets import LabelledClip, LabelledSet, Row, read
from bench.record import hash_files, record, recordings

FOLDS: Final = 3
SEEDS: Final = (0, 1, 2)
SECONDS: Final = 10.0
CHANGES: Final = 100  # motions that walk, run and walk
CHANGE_SECONDS: Final = 9.0
SOON: Final = 1.5  # seconds in which a class has its speed
USUAL: Final = (0.1, 0.9)  # quantiles of the speeds of a class's recordings over half a second
EIGHTS: Final = 6  # motions along a figure of eight
EIGHT_SECONDS: Final = 60.0
POSES: Final = 400  # of all motions, for diversity


def described_as(*names: str) -> LabelledSet:
    def chosen(row: Row) -> bool:
        return row["description"].strip().lower() in names

    return LabelledSet("cmu_bvh", "description", chosen)


def dance(name: str) -> LabelledSet:
    return LabelledSet("cmu_dance", "label", lambda row: row["label"] == name)


SETS: Final = {
    "walk": described_as("walk"),
    "run": described_as("run", "run/jog"),
    "salsa": dance("salsa"),
    "indian": dance("indian"),
    "martial": dance("martial"),
}


@cache
def clips_of(label: str) -> list[LabelledClip]:
    return read(SETS[label])


def parted(label: str, fold: int) -> tuple[list[LabelledClip], list[LabelledClip]]:
    """The clips of the other folds, and of this one; takes of one name (partners of a dance) are of one fold."""
    names = sorted({clip.name for clip in clips_of(label)})
    own = {name for i, name in enumerate(names) if i % FOLDS == fold}
    clips = clips_of(label)
    return [clip for clip in clips if clip.name not in own], [clip for clip in clips if clip.name in own]


def left_out(label: str, number: int) -> tuple[LabelledClip, int]:
    """A clip, and the fold that it is of; others for other numbers, from all folds in turn."""
    folds = [(clip, fold) for fold in range(FOLDS) for clip in parted(label, fold)[1]]
    order = np.random.default_rng(0).permutation(len(folds))
    return folds[int(order[number % len(folds)])]


@cache
def generator(labels: tuple[str, ...], fold: int) -> MatchingGenerator:
    return MatchingGenerator(
        build_database(
            [
                MatchingClip(f"{label}/{c.name}", 0, label, c.positions, c.rotations, offsets_of(c), c.fps)
                for label in labels
                for c in parted(label, fold)[0]
            ]
        )
    )


def offsets_of(clip: LabelledClip) -> Float64Array:
    assert clip.rest_offsets is not None
    return clip.rest_offsets


def recorded(clip: LabelledClip) -> Float64Array:
    """[F, 21, 3] at 30 frames a second, without calibration poses."""
    start, stop = max(sound_ranges(clip.positions, clip.rotations, clip.fps), key=lambda pair: pair[1] - pair[0])
    return resample(clip.positions[start:stop], clip.fps, FPS)


def seed_of(clip: LabelledClip) -> SeedClip:
    return SeedClip(clip.name, clip.positions, clip.fps, offsets_of(clip), clip.rotations)


def ground_under(made: GeneratedMotion, clip: LabelledClip) -> Ground:
    """A level ground, as high as that of a clip where the motion goes on from it."""
    return ground_of(recorded(clip)).level_at(clip.positions[made.seed_stop - 1, 0])


def stands(made: GeneratedMotion, clip: LabelledClip) -> Footing:
    """How a motion that goes on from a clip stands."""
    return footing(made.positions, FPS, ground_under(made, clip))


def diversity(motions: Sequence[Float64Array]) -> float:
    """Mean distance of joints, body lengths, between poses of different motions, seen from the body."""
    rng, poses, of = np.random.default_rng(0), [], []
    for i, motion in enumerate(motions):
        at = rng.integers(len(motion), size=max(1, POSES // len(motions)))
        poses.append(body_poses(motion[at]) / body_length(motion))
        of += [i] * len(at)
    joints, owner = np.concatenate(poses), np.array(of)
    apart = np.linalg.norm(joints[:, None] - joints[None], axis=-1).mean(axis=-1)
    return float(apart[owner[:, None] != owner[None]].mean())


def measures(motions: Sequence[Float64Array], grounds: Sequence[Ground]) -> dict[str, float]:
    feet = [asdict(footing(motion, FPS, ground)) for motion, ground in zip(motions, grounds, strict=True)]
    means = {name: float(np.mean([one[name] for one in feet])) for name in ("skates", "slide")}
    most = {name: max(one[name] for one in feet) for name in ("depth", "height", "airborne")}
    return {
        "motions": len(motions),
        "travel": float(np.mean([travel_speed(m, FPS) for m in motions])),
        "energy": float(np.mean([energy(m, FPS) for m in motions])),
        "diversity": diversity(motions),
        **means,
        **most,
    }


def of_class(label: str) -> dict[str, Any]:
    """A class made from every clip left out, by every seed, beside its recordings."""
    real = [recorded(clip) for clip in clips_of(label)]
    found: dict[str, Any] = {"real": measures(real, [ground_of(one) for one in real])}
    rows, drift = [], 0.0
    for seed in SEEDS:
        made: list[Float64Array] = []
        grounds: list[Ground] = []
        for fold in range(FOLDS):
            test = parted(label, fold)[1]
            requests = [MotionRequest((label,), SECONDS, 1000 * seed + i, seed_of(c)) for i, c in enumerate(test)]
            motions = generator((label,), fold).generate(requests)
            made += [motion.positions for motion in motions]
            grounds += [ground_under(one, clip) for one, clip in zip(motions, test, strict=True)]
            drift = max([drift, *(bone_length_drift(m.positions, m.rest_offsets) for m in motions)])
        rows.append(measures(made, grounds))
    found["made"] = {name: float(np.mean([row[name] for row in rows])) for name in rows[0]}
    found["by_seed"] = rows
    found["ratio"] = {
        name: found["made"][name] / found["real"][name]
        for name in ("travel", "energy", "diversity", "skates", "slide")
        if found["real"][name]
    }
    found["bone_drift_percent"] = drift
    return found


def speeds(positions: Float64Array, span: int = 15) -> Float64Array:
    """[F - span] m/s of the hips over half a second from each frame on."""
    hips, wide = positions[:, 0][:, [0, 2]], min(span, len(positions) - 1)
    return np.asarray(np.linalg.norm(hips[wide:] - hips[:-wide], axis=1) * FPS / wide)


def changes() -> dict[str, Any]:
    """Walk, run, walk: how many have the speed of the recordings of their class soon, and when."""
    usual = {
        label: np.quantile(np.concatenate([speeds(recorded(clip)) for clip in clips_of(label)]), USUAL)
        for label in ("walk", "run")
    }
    times: dict[str, list[float]] = {"run": [], "walk": []}
    feet = []
    for i in range(CHANGES):
        clip, fold = left_out("walk", i)
        request = MotionRequest(("walk", "run", "walk"), CHANGE_SECONDS, i, seed_of(clip))
        made = generator(("walk", "run"), fold).generate([request])[0]
        feet.append(stands(made, clip))
        for place, label in ((1, "run"), (2, "walk")):
            low, high = usual[label]
            after = speeds(made.positions)[made.class_starts[place] :]
            fits = np.flatnonzero((after >= low) & (after <= high))
            times[label].append(float(fits[0] / FPS) if len(fits) else np.inf)
    return {
        "motions": CHANGES,
        "usual": {label: [float(v) for v in pair] for label, pair in usual.items()},
        "soon": {label: float(np.mean(np.array(own) <= SOON)) for label, own in times.items()},
        "median_seconds": {label: float(np.median(own)) for label, own in times.items()},
        "skates": float(np.mean([one.skates for one in feet])),
        "depth": max(one.depth for one in feet),
    }


def eights() -> dict[str, Any]:
    """Along a figure of eight: the greatest distance of the hips from it, and how feet stand."""
    path, rows = shape_path("eight"), []
    for i in range(EIGHTS):
        clip, fold = left_out("walk", i)
        request = MotionRequest(("walk",), EIGHT_SECONDS, i, seed_of(clip), control=Control(path=path))
        made = generator(("walk",), fold).generate([request])[0]
        rows.append({"distance": far_from(made, path), **asdict(stands(made, clip))})
    return {
        "radius": 3.0,
        "seconds": EIGHT_SECONDS,
        "motions": EIGHTS,
        "distance": max(row["distance"] for row in rows),
        "skates": float(np.mean([row["skates"] for row in rows])),
        "slide": float(np.mean([row["slide"] for row in rows])),
        "depth": max(row["depth"] for row in rows),
    }


def far_from(made: GeneratedMotion, path: GroundPath) -> float:
    """Greatest metres of the hips from the path, which lies where it is nearest to all of them."""
    from scipy.optimize import minimize
    from scipy.spatial import cKDTree

    hips = made.positions[:, 0][:, [0, 2]]
    first = made.positions[min(9, len(hips) - 1), 0, [0, 2]] - hips[0]

    def off(at: Float64Array) -> Float64Array:
        placed = path.placed(at[:2], float(at[2]), 1.0).points
        return np.asarray(cKDTree(placed).query(hips)[0])

    start = np.array([*hips[0], np.arctan2(first[0], first[1])])
    best = minimize(lambda at: float((off(at) ** 2).mean()), start, method="Nelder-Mead").x
    return float(off(best).max())


def cost() -> dict[str, Any]:
    """Seconds of motion a second on one thread, with and without a path; seconds that the database takes."""
    clip, fold = left_out("walk", 0)
    made = generator(("walk",), fold)
    found: dict[str, Any] = {}
    free = MotionRequest(("walk",), EIGHT_SECONDS, 0, seed_of(clip))
    along = MotionRequest(("walk",), EIGHT_SECONDS, 0, seed_of(clip), control=Control(path=shape_path("eight")))
    for name, request in (("free", free), ("path", along)):
        made.generate([request])
        started = time.process_time()
        made.generate([request])
        found[f"{name}_realtime"] = EIGHT_SECONDS / (time.process_time() - started)
    clips = [
        MatchingClip(c.name, 0, "salsa", c.positions, c.rotations, offsets_of(c), c.fps) for c in clips_of("salsa")
    ]
    started = time.process_time()
    database = build_database(clips)
    found["database"] = {"frames": len(database), "seconds": time.process_time() - started}
    found["memory_gib"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("classes", nargs="*", default=list(SETS), help=f"of {', '.join(SETS)} (default: all)")
    chosen = parser.parse_args().classes
    figures: dict[str, Any] = {"seeds": list(SEEDS), "seconds": SECONDS, "folds": FOLDS, "classes": {}}
    with on_threads(1):
        figures["cost"] = cost()
        for label in chosen:
            figures["classes"][label] = found = of_class(label)
            print(label, *(f"{name} {value:.3f}" for name, value in found["ratio"].items()), flush=True)
            for row in ("made", "real"):
                print(f"  {row}", *(f"{name} {value:.3f}" for name, value in found[row].items()), flush=True)
        figures["changes"], figures["eights"] = changes(), eights()
    for name in ("changes", "eights", "cost"):
        print(name, figures[name])
    sets = [recordings() / name for name in ("cmu_bvh", "cmu_dance")]
    data = hash_files([p for folder in sets for p in folder.rglob("*") if p.is_file()], recordings())
    print(record("matching", figures, data))


if __name__ == "__main__":
    main()
