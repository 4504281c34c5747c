"""Whether `--style-from` moves motion towards a clip: `python -m bench.style`.

Walks of bandai1 in 15 styles, two takes each. The database holds the second takes; motions go on from the first neutral
walk, with no style and in the manner of the first take of each other style. How near a motion is to that take: the mean
distance, body lengths, of joints seen from the body from the nearest of its poses, which motion matching does not use.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.matching.generator import MatchingGenerator
from motionlake.motion.generation import FPS, Control, GeneratedMotion, MotionRequest
from motionlake.motion.resampling import resample
from motionlake.motion.skeleton import body_length, body_poses
from motionlake.training import on_threads

from bench.canonical_sets import LabelledClip, LabelledSet, read
from bench.matching_clips import database_of, offsets_of, seed_of
from bench.record import hash_files, record, recordings

NEUTRAL: Final = "normal"
SEEDS: Final = (0, 1, 2)
SECONDS: Final = 8.0
LATER: Final = 30  # frames of a motion before it is compared: it begins with the neutral walk
EVERY: Final = 4  # of frames, that are compared
STYLES: Final = 14


def takes() -> dict[str, tuple[LabelledClip, LabelledClip]]:
    """Of every style its two walks; twice the one there is in a small set."""
    found: dict[str, list[LabelledClip]] = {}
    for clip in read(LabelledSet("bandai1", "style", lambda row: row["label"] == "walk")):
        found.setdefault(clip.label, []).append(clip)
    return {style: (clips[0], clips[-1]) for style, clips in found.items()}


def poses(positions: Float64Array, fps: float, size: float) -> Float64Array:
    return np.asarray(body_poses(resample(positions.astype(float), fps, FPS))[::EVERY] / size)


def apart(one: Float64Array, other: Float64Array) -> float:
    """Mean distance of poses from the nearest of others."""
    return float(np.linalg.norm(one[:, None] - other[None], axis=-1).mean(axis=-1).min(axis=1).mean())


def of_clip(clip: LabelledClip) -> Float64Array:
    return poses(clip.positions, clip.fps, body_length(offsets_of(clip)))


def figures() -> dict[str, Any]:
    walks = takes()
    generator = MatchingGenerator(database_of((second for _, second in walks.values()), "walk"))
    style_of = {f"walk/{second.name}": style for style, (_, second) in walks.items()}
    rows: dict[str, dict[str, Any]] = {}
    for style in [name for name in walks if name != NEUTRAL][:STYLES]:
        first, second = walks[style]
        wanted = of_clip(first)
        own: dict[str, list[float]] = {"none": [], "style": []}
        shares: dict[str, list[float]] = {"none": [], "style": []}
        for name, control in (("none", None), ("style", Control(style=seed_of(first)))):
            for seed in SEEDS:
                start = seed_of(walks[NEUTRAL][0])
                (made,) = generator.generate([MotionRequest(("walk",), SECONDS, seed, start, control=control)])
                later = poses(made.positions[LATER:], FPS, body_length(made.rest_offsets))
                own[name].append(apart(later, wanted))
                shares[name].append(_share(made, style, style_of))
        rows[style] = {
            "other_take": apart(of_clip(second), wanted),
            **{name: float(np.mean(values)) for name, values in own.items()},
            **{f"{name}_share": float(np.mean(values)) for name, values in shares.items()},
        }
    mean = {name: float(np.mean([row[name] for row in rows.values()])) for name in next(iter(rows.values()))}
    nearer = sum(row["style"] < row["none"] for row in rows.values())
    return {"mean": mean, "nearer": nearer, "styles": rows, "seeds": list(SEEDS)}


def _share(made: GeneratedMotion, style: str, style_of: dict[str, str]) -> float:
    """Of the frames of a motion, the share that was recorded in a style."""
    frames = sum(source.stop - source.start for source in made.sources)
    return sum((s.stop - s.start) * (style_of[s.clip] == style) for s in made.sources) / frames


def main() -> None:
    with on_threads(1):
        found = figures()
    print({name: round(value, 4) for name, value in found["mean"].items()}, found["nearer"], "of", len(found["styles"]))
    data = hash_files([p for p in (recordings() / "bandai1").rglob("*") if p.is_file()], recordings())
    print(record("style", found, data))


if __name__ == "__main__":
    main()
