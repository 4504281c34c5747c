"""Changes of class, paths and cost of motion matching, on clips left out: `python -m bench.matching`.

The clips of every class are dealt to three folds; a motion goes on from a clip of one fold, and the database holds the
clips of the others. Classes beside their recordings are measured by `bench.made`.
"""

from __future__ import annotations

import resource
import time
from dataclasses import asdict
from functools import cache
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.evaluation.synthesis.contact import Footing, footing
from motionlake.matching.building import build_database
from motionlake.matching.generator import MatchingGenerator
from motionlake.matching.recordings import longest_range
from motionlake.motion.generation import FPS, Control, GeneratedMotion, MotionRequest
from motionlake.motion.ground import Ground, ground_of
from motionlake.motion.paths import GroundPath, shape_path
from motionlake.motion.resampling import resample
from motionlake.training import on_threads

from bench.canonical_sets import LabelledClip, read
from bench.classes import GOING
from bench.matching_clips import database_of, matching_clip, seed_of
from bench.record import hash_files, record, recordings

SETS: Final = GOING
FOLDS: Final = 3
CHANGES: Final = 100  # motions that walk, run and walk
CHANGE_SECONDS: Final = 9.0
SOON: Final = 1.5  # seconds in which a class has its speed
USUAL: Final = (0.1, 0.9)  # quantiles of the speeds of a class's recordings over half a second
EIGHTS: Final = 6  # motions along a figure of eight
EIGHT_SECONDS: Final = 60.0


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
        build_database([matching_clip(c, label) for label in labels for c in parted(label, fold)[0]])
    )


def recorded(clip: LabelledClip) -> Float64Array:
    """[F, 21, 3] at 30 frames a second, without calibration poses."""
    start, stop = longest_range(clip.positions, clip.rotations, clip.fps)
    return resample(clip.positions[start:stop], clip.fps, FPS)


def ground_under(made: GeneratedMotion, clip: LabelledClip) -> Ground:
    """A level ground, as high as that of a clip where the motion goes on from it."""
    return ground_of(recorded(clip)).level_at(clip.positions[made.seed_stop - 1, 0])


def stands(made: GeneratedMotion, clip: LabelledClip) -> Footing:
    """How a motion that goes on from a clip stands."""
    return footing(made.positions, FPS, ground_under(made, clip))


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
    clips = clips_of("salsa")
    started = time.process_time()
    database = database_of(clips, "salsa")
    found["database"] = {"frames": len(database), "seconds": time.process_time() - started}
    found["memory_gib"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return found


def main() -> None:
    figures: dict[str, Any] = {"folds": FOLDS}
    with on_threads(1):
        figures["cost"], figures["changes"], figures["eights"] = cost(), changes(), eights()
    for name in ("changes", "eights", "cost"):
        print(name, figures[name])
    sets = [recordings() / name for name in ("cmu_bvh", "cmu_dance")]
    data = hash_files([p for folder in sets for p in folder.rglob("*") if p.is_file()], recordings())
    print(record("matching", figures, data))


if __name__ == "__main__":
    main()
