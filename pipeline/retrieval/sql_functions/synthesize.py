"""New motion in SQL: the frames of one that nobody recorded."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
from motionlake.lake.catalog import reading
from motionlake.lake.config import LakeConfig
from motionlake.lake.frames import CHANNELS, Frames, to_table
from motionlake.lake.layout import Lake
from motionlake.lake.settings import served_config
from motionlake.retrieval.sql_functions import Names, Served, sql_function

if TYPE_CHECKING:
    from motionlake.glogen.generator import GeneratedMotion, TrainedGenerator
    from motionlake.lake.models import Model
    from motionlake.stages.synthesis_requests import Request

FRAME = {"frame": pa.int32(), "time": float, "class": str, "seed_clip": str} | dict.fromkeys(CHANNELS, pa.float32())


def _generator(lake: Lake) -> tuple[Model, TrainedGenerator]:
    from motionlake.stages.synthesis import open_generator, served_generator

    with reading(lake) as con:
        model = served_generator(con, lake, served_config(lake))
    return model, open_generator(lake, model)


@sql_function(FRAME)
def synthesize(
    served: Served,
    classes: Names,
    seconds: float | None = 8.0,
    seed: int = 0,
    start: str | None = None,
    split: str | None = None,
    pace: float = 1.0,
    temperature: float = 1.0,
    min_quality: str | None = None,
) -> list[object] | pa.StructArray:
    """The frames of the first motion that `motionlake synthesize` makes for the same options.

    A row a frame, with the columns of `frames`, the time, the class and the recorded clip that it goes on from.
    `classes`: 'walk', or ['walk', 'kick'] one after the other; `start`: that clip; `split`: its split;
    `min_quality`: the worst verdict that it may have.
    """
    from motionlake.stages.synthesis_requests import Request, find_starts, make, motions_of

    if seconds is None:
        return []
    model, generator = served.once(_generator)
    clip = None if start is None else str(served.query(start).source)
    request = Request(tuple(classes), seconds, seed, clip, False, split, pace, temperature, min_quality)
    with reading(served.lake) as con:
        starts = find_starts(con, served.lake, model, request)
    motions = motions_of(request, starts, [1])
    (made,) = make(generator, served.lake, request, motions)
    return _rows(served_config(served.lake), request, made, motions[0].start.clip)


def _rows(config: LakeConfig, request: Request, made: GeneratedMotion, seed_clip: str) -> pa.StructArray:
    from motionlake.stages.synthesis_requests import canonical_motion

    motion, steps = canonical_motion(made), config.frames
    frames = Frames("", motion.fps, motion.rotations, motion.positions)
    table, at = to_table(frames, "", steps.position_step, steps.rotation_step), np.arange(len(motion.positions))
    current = np.searchsorted(made.class_starts, at, side="right") - 1
    added = {
        "time": pa.array(at / motion.fps),
        "class": pa.array([request.classes[i] for i in current], pa.string()),
        "seed_clip": pa.array([seed_clip] * len(at), pa.string()),
    }
    rows = pa.table({name: added[name] if name in added else table[name] for name in FRAME})
    return rows.to_struct_array().combine_chunks()
