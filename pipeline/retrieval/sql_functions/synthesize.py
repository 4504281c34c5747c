"""New motion in SQL: the frames of one that nobody recorded."""

from __future__ import annotations

from dataclasses import replace
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
    from motionlake.motion.generation import GeneratedMotion, MotionGenerator
    from motionlake.stages.synthesis_control import Request

FRAME = {
    "frame": pa.int32(),
    "time": float,
    "class": str,
    "seed_clip": str,
    "source": str,
    "source_frame": int,
} | dict.fromkeys(CHANNELS, pa.float32())


def _opened(lake: Lake, name: str) -> MotionGenerator:
    from motionlake.stages.synthesis import generators, open_generator

    with reading(lake) as con:
        model = next(one for one in generators(con, lake, served_config(lake)) if one.model == name)
    return open_generator(lake, model)


@sql_function(FRAME)
def synthesize(
    served: Served,
    classes: Names,
    seconds: float | None = None,
    seed: int = 0,
    start: str | None = None,
    split: str | None = None,
    pace: float = 1.0,
    temperature: float = 1.0,
    min_quality: str | None = None,
    path: str | None = None,
    speed: float | None = None,
    facing: float | None = None,
    loop: bool = False,
    continues: str | None = None,
    keyframes: list[str] | None = None,
    edit: str | None = None,
    first: int | None = None,
    last: int | None = None,
    style: str | None = None,
) -> list[object] | pa.StructArray:
    """The frames of the first motion that `motionlake synthesize` makes for the same options.

    A row a frame, with the columns of `frames`, the time, the class, the recorded clip that it goes on from, and of a
    generator that plays recorded frames the clip and the frame that it was made from.
    `classes`: 'walk', or ['walk:3', 'kick:1'] one after the other, with the seconds of each; `start`: that clip;
    `split`: its split; `min_quality`: the worst verdict that it may have; `path`: 'circle', 'eight:2' or points
    'x,z;x,z'; `speed`: metres a second; `facing`: degrees; `loop`: its end meets its beginning; `continues`: a clip
    from the end of which it goes on; `keyframes`: ['clip@120', 'clip@4s=2.5'] are poses that it passes through, and
    `classes` may be [] then; `edit`: a clip of which frames [`first`, `last`) are made anew and the others kept;
    `style`: a clip; recorded frames that look like its frames are preferred.
    """
    from motionlake.stages.synthesis_control import Request
    from motionlake.stages.synthesis_edits import with_edit
    from motionlake.stages.synthesis_keys import marked, style_of, with_keyframes
    from motionlake.stages.synthesis_options import begun, path_text, timed_classes
    from motionlake.stages.synthesis_requests import make, motions_of
    from motionlake.stages.synthesis_settling import settle
    from motionlake.stages.synthesis_starts import find_starts

    named = begun(start, continues)
    clip = None if named is None else str(served.query(named).source)
    names, shares = timed_classes(classes)
    way = None if path is None else path_text(path, files=False)
    asked = Request(
        names, seconds, seed, clip, False, split, pace, temperature, min_quality, shares, way, speed, facing, loop,
        continues is not None,
    )  # fmt: skip
    with reading(served.lake) as con:
        if style is not None:
            asked = replace(asked, style=style_of(con, served.lake, served.query(style).source))
        if edit is not None:
            asked = with_edit(con, served.lake, asked, served.query(edit).source, first, last)
        elif keyframes:
            frames = [marked(text) for text in keyframes]
            named_by = [replace(frame, source=served.query(str(frame.source)).source) for frame in frames]
            asked = with_keyframes(con, served.lake, asked, named_by)
        config = served_config(served.lake)
        chosen, request = settle(con, served.lake, config, asked)
        model = chosen.model
        starts = find_starts(con, served.lake, model, request)
    motions = motions_of(request, starts, [1])
    (made,) = make(served.once(_opened, model.model), served.lake, request, motions)
    return _rows(config, request, made, motions[0].start.clip)


def _rows(config: LakeConfig, request: Request, made: GeneratedMotion, seed_clip: str) -> pa.StructArray:
    from motionlake.stages.synthesis_requests import canonical_motion

    motion, steps = canonical_motion(made), config.frames
    frames = Frames("", motion.fps, motion.rotations, motion.positions)
    table, at = to_table(frames, "", steps.position_step, steps.rotation_step), np.arange(len(motion.positions))
    added = {
        "time": pa.array(at / motion.fps),
        "class": pa.array(_classes(request, made), pa.string()),
        "seed_clip": pa.array([seed_clip] * len(at), pa.string()),
        **_sources(made),
    }
    rows = pa.table({name: added[name] if name in added else table[name] for name in FRAME})
    return rows.to_struct_array().combine_chunks()


def _classes(request: Request, made: GeneratedMotion) -> list[str | None]:
    """The class of every frame; NULL outside of a range that was made anew, and where several lead between poses."""
    count = len(made.positions)
    if request.edited is not None:
        first, stop = request.edited
        return [request.classes[0] if first <= frame < stop else None for frame in range(count)]
    if request.keyframes and len(set(request.classes)) > 1:
        return [None] * count
    return [request.classes[i] for i in np.searchsorted(made.class_starts, np.arange(count), side="right") - 1]


def _sources(made: GeneratedMotion) -> dict[str, pa.Array]:
    """The recorded clip and frame that every frame was made from; NULL where a network made it."""
    clips: list[str | None] = [None] * len(made.positions)
    frames: list[int | None] = [None] * len(made.positions)
    for source in made.sources:
        clips[source.start : source.stop] = [source.clip] * (source.stop - source.start)
        frames[source.start : source.stop] = (
            np.linspace(source.first, source.last, source.stop - source.start).round().astype(int).tolist()
        )
    return {"source": pa.array(clips, pa.string()), "source_frame": pa.array(frames, pa.int64())}
