"""New motion in SQL: the frames of one that nobody recorded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
from motionlake.lake.catalog import reading
from motionlake.lake.frames import CHANNELS
from motionlake.lake.layout import Lake
from motionlake.retrieval.sql_functions import Names, Served, sql_function

if TYPE_CHECKING:
    from motionlake.glogen.generator import GeneratedMotion, TrainedGenerator
    from motionlake.lake.config import LakeConfig
    from motionlake.lake.models import Model
    from motionlake.stages.synthesis_requests import Request

FRAME = {"frame": pa.int32(), "time": float, "class": str, "seed_clip": str} | dict.fromkeys(CHANNELS, pa.float32())


@dataclass(frozen=True)
class _Generator:
    """The generator that a connection serves."""

    config: LakeConfig
    model: Model
    generator: TrainedGenerator


def _generator(lake: Lake) -> _Generator:
    from motionlake.lake.config import load_config
    from motionlake.stages.synthesis import open_generator, served_generator

    config = load_config(lake.config_file)
    with reading(lake) as con:
        model = served_generator(con, lake, config)
    return _Generator(config, model, open_generator(lake, model))


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
) -> list[object] | pa.StructArray:
    """The frames of the first motion that `motionlake synthesize` makes for the same options.

    A row a frame, with the columns of `frames`, the time, the class and the recorded clip that it goes on from.
    `classes`: 'walk', or ['walk', 'kick'] one after the other; `start`: that clip; `split`: its split.
    """
    from motionlake.stages.synthesis_requests import Request, find_starts, make, motions_of

    if seconds is None:
        return []
    known: _Generator = served.once(_generator)
    clip = None if start is None else str(served.query(start).source)
    request = Request(tuple(classes), seconds, seed, clip, split=split, pace=pace, temperature=temperature)
    with reading(served.lake) as con:
        starts = find_starts(con, served.lake, known.model, request)
    motions = motions_of(request, starts, [1])
    (made,) = make(known.generator, served.lake, request, motions)
    return _rows(known.config, request, made, motions[0].start.clip)


def _rows(config: LakeConfig, request: Request, made: GeneratedMotion, seed_clip: str) -> pa.StructArray:
    from motionlake.lake.frames import Frames, to_table
    from motionlake.stages.synthesis_requests import canonical_motion

    motion, steps = canonical_motion(made), config.frames
    table = to_table(
        Frames("", motion.fps, motion.rotations, motion.positions), "", steps.position_step, steps.rotation_step
    ).combine_chunks()
    count = len(motion.positions)
    current = np.searchsorted(made.class_starts, np.arange(count), side="right") - 1
    columns = [
        table.column("frame").chunk(0),
        pa.array(np.arange(count) / motion.fps),
        pa.array([request.classes[i] for i in current], pa.string()),
        pa.array([seed_clip] * count, pa.string()),
        *(table.column(name).chunk(0) for name in CHANNELS),
    ]
    return pa.StructArray.from_arrays(columns, names=list(FRAME))
