"""Stage "moves": the joints of clips at 12 frames a second, by whose moves clips are aligned."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

import pyarrow as pa
from motionlake.arrays import Float32Array, Float64Array
from motionlake.deephums.sequence import clip_sequence
from motionlake.lake import frames
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.motion.moves import Track, at_12
from motionlake.motion.skeleton import COMMON
from motionlake.stages.reader import LakeReader
from motionlake.stages.stage import PART_KEYS, Part, PartStage, Shard, clips_of, clips_of_shard, part_keys
from motionlake.stages.words import read_features

STEP: Final = 2.0**-14  # body lengths; less than a tenth of a millimetre
ROWS: Final = pa.schema([*PART_KEYS, *((f"{joint}_{axis}", pa.float32()) for joint in COMMON for axis in "xyz")])


class Moves(PartStage):
    """Joints seen from the body, in body lengths."""

    name = "moves"
    about = "joints at 12 frames a second, by whose moves clips are aligned"
    folder = "moves"
    schema = ROWS
    version = 2  # without calibration poses

    def spec(self, at: LakeReader, part: Part) -> Mapping[str, Any]:
        return {"clips": clips_of(at.con, part.part)}

    def rows(self, lake: Lake, shard: Shard) -> Iterator[pa.Table]:
        for clip in clips_of_shard(lake, shard, rotations=False):
            joints = joints_of(clip.positions.astype(float), clip.fps)
            columns = [*part_keys(clip.clip, shard, len(joints)), *frames.columns_of(joints)]
            yield pa.Table.from_arrays(columns, schema=ROWS)


MOVES: Final = Moves()


def joints_of(positions: Float64Array, fps: float) -> Float32Array:
    """[N, 45] joints of a motion [F, 21, 3], as the stage keeps them. Raises `ValueError` as `clip_sequence`."""
    return frames.quantise(at_12(clip_sequence(positions, fps)), STEP)


def read_tracks(at: LakeReader, parts: Mapping[str, str]) -> dict[str, Track]:
    """Of some clips, by the frames part of each, those that the stage has made.

    Raises:
        DamagedError: a part is not as it was written.
    """
    wanted = set(parts.values())
    return {clip: track for part in made_parts(at) if part.part in wanted
            for clip, track in tracks_in(at.lake, MOVES.file(part.key)) if parts.get(clip) == part.part}  # fmt: skip


def made_parts(at: LakeReader) -> list[Part]:
    """The live parts that the stage has made."""
    done = at.done(MOVES.name)
    return [part for part in MOVES.parts(at) or [] if part.key in done]


def tracks_in(lake: Lake, file: str) -> Iterator[tuple[str, Track]]:
    """Clips of a part with their tracks. Raises `DamagedError` where it is not as it was written."""
    for clip, joints in read_features(sound(lake, file)):
        yield clip, Track.of(joints)
