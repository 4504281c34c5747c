"""Functions that make motion: the frames of one that nobody recorded.

What they need is imported at the first call: a connection that asks for none of it opens as fast.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import duckdb
import numpy as np
import pyarrow as pa
from duckdb.func import ARROW, SPECIAL
from duckdb.sqltypes import BIGINT, DOUBLE, FLOAT, INTEGER, VARCHAR
from motionlake.lake.catalog import Connection, reading
from motionlake.lake.frames import CHANNELS, Frames, to_table
from motionlake.lake.layout import Lake

if TYPE_CHECKING:
    from motionlake.glogen.generator import TrainedGenerator
    from motionlake.lake.config import LakeConfig
    from motionlake.lake.models import Model
    from motionlake.stages.synthesis_wishes import Made, Request

FRAME = {"frame": INTEGER, "time": DOUBLE, "class": VARCHAR, "seed_clip": VARCHAR} | dict.fromkeys(CHANNELS, FLOAT)
FIELDS = [
    pa.field("frame", pa.int32()), pa.field("time", pa.float64()), pa.field("class", pa.string()),
    pa.field("seed_clip", pa.string()), *(pa.field(name, pa.float32()) for name in CHANNELS),
]  # fmt: skip


def register(con: Connection, lake: Lake) -> None:
    """Make `synthesized_frames` known to a connection.

    `synthesized_frames(classes VARCHAR[], seconds DOUBLE, seed BIGINT, start VARCHAR, split VARCHAR, pace DOUBLE,
    temperature DOUBLE) -> STRUCT(frame, time, class, seed_clip, the channels of `frames`)[]`: the frames of the first
    motion that `motionlake synthesize` makes for the same request. NULL for `start` or `split` leaves them open.
    """
    served = _Served(lake)

    def frames(  # DuckDB counts the parameters
        classes: pa.ChunkedArray,
        seconds: pa.ChunkedArray,
        seed: pa.ChunkedArray,
        start: pa.ChunkedArray,
        split: pa.ChunkedArray,
        pace: pa.ChunkedArray,
        temperature: pa.ChunkedArray,
    ) -> pa.Array:
        columns = (classes, seconds, seed, start, split, pace, temperature)
        rows = zip(*(column.to_pylist() for column in columns), strict=True)
        return _lists([served.frames(*row) for row in rows])

    kind: Any = {"type": ARROW, "null_handling": SPECIAL}
    arguments: Any = [duckdb.list_type(VARCHAR), DOUBLE, BIGINT, VARCHAR, VARCHAR, DOUBLE, DOUBLE]
    found = duckdb.list_type(duckdb.struct_type(FRAME))
    con.create_function("synthesized_frames", frames, arguments, found, **kind)


def _lists(motions: list[pa.StructArray]) -> pa.ListArray:
    """One list a motion."""
    offsets = np.cumsum([0, *(len(motion) for motion in motions)]).astype(np.int32)
    return pa.ListArray.from_arrays(pa.array(offsets), pa.concat_arrays([pa.array([], pa.struct(FIELDS)), *motions]))


class _Served:
    """The generator that a connection serves, read at first use by another (a function must not query its own)."""

    def __init__(self, lake: Lake) -> None:
        self.lake = lake

    @cached_property
    def config(self) -> LakeConfig:
        from motionlake.lake.config import load_config

        return load_config(self.lake.config_file)

    @cached_property
    def model(self) -> Model:
        from motionlake.stages.synthesis import served_generator

        with reading(self.lake) as con:
            return served_generator(con, self.lake, self.config)

    @cached_property
    def generator(self) -> TrainedGenerator:
        from motionlake.stages.synthesis import open_generator

        return open_generator(self.lake, self.model)

    def frames(
        self,
        classes: list[str] | None,
        seconds: float | None,
        seed: int | None,
        start: str | None,
        split: str | None,
        pace: float | None,
        temperature: float | None,
    ) -> pa.StructArray:
        """Frames of one motion, a row each; none where no class or no length is given."""
        from motionlake.lake.resolve import resolve_clip
        from motionlake.stages.synthesis import check_classes
        from motionlake.stages.synthesis_wishes import Request, check_request, find_starts, make, motions_of

        if classes is None or seconds is None:
            return pa.array([], pa.struct(FIELDS))
        with reading(self.lake) as con:
            clip = None if start is None else resolve_clip(con, start)
            request = Request(
                tuple(classes), seconds, seed or 0, clip, split=split, pace=1.0 if pace is None else pace,
                temperature=1.0 if temperature is None else temperature,
            )  # fmt: skip
            check_request(request)
            check_classes(self.model, request.classes)
            starts = find_starts(con, self.lake, request)
        made = make(self.generator, self.lake, request, starts, motions_of(request, starts, [1]))
        return self._rows(request, made[0])

    def _rows(self, request: Request, made: Made) -> pa.StructArray:
        from motionlake.stages.synthetic_motion import canonical_motion

        motion, steps = canonical_motion(made.motion), self.config.frames
        table = to_table(
            Frames("", motion.fps, motion.rotations, motion.positions), "", steps.position_step, steps.rotation_step
        ).combine_chunks()
        count = len(motion.positions)
        current = np.searchsorted(made.motion.class_starts, np.arange(count), side="right") - 1
        columns = [
            table.column("frame").chunk(0),
            pa.array(np.arange(count) / motion.fps),
            pa.array([request.classes[i] for i in current], pa.string()),
            pa.array([made.start.clip] * count, pa.string()),
            *(table.column(name).chunk(0) for name in CHANNELS),
        ]
        return pa.StructArray.from_arrays(columns, fields=FIELDS)
