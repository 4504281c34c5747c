"""Stage "moves": the joints of clips at 12 frames a second, by whose moves clips are aligned."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array, Float64Array
from motionlake.deephums.sequence import clip_sequence
from motionlake.lake import frames
from motionlake.lake.catalog import Connection, fetch, remembered
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.motion.moves import Track, at_12
from motionlake.motion.moves_of_clips import moves_of_clips
from motionlake.stages.descriptor_network import sequence_of
from motionlake.stages.mapped_part import MappedStage, lists_of, read_rows, rows_of_clips
from motionlake.stages.part_clips import by_file, clips_of_shard
from motionlake.stages.reader import LakeReader
from motionlake.stages.stage import Part, Shard, clips_of
from motionlake.threads import in_threads

MANY: Final = 20_000  # frames of clips from which their moves are worked out at once
THREADS: Final = 2  # that share this
STEP: Final = 2.0**-14  # body lengths; less than a tenth of a millimetre
JOINTS: Final = "joints"  # a column: x, y and z of each


class Moves(MappedStage):
    """Joints seen from the body, in body lengths."""

    name = "moves"
    about = "joints at 12 frames a second, by whose moves clips are aligned"
    folder = "moves"
    version = 3  # parts that are mapped into memory

    def spec(self, at: LakeReader, part: Part) -> Mapping[str, Any]:
        return {"clips": clips_of(at.con, part.part)}

    def rows(self, lake: Lake, shard: Shard) -> Iterator[pa.Table]:
        for clip in clips_of_shard(lake, shard, rotations=False):
            joints = _joints(sequence_of(clip))
            yield pa.table([pa.repeat(clip.clip, len(joints)), lists_of(joints)], names=["clip", JOINTS])


MOVES: Final = Moves()


def joints_of(positions: Float64Array, fps: float) -> Float32Array:
    """[N, 45] joints of a motion [F, 21, 3], as the stage keeps them. Raises `ValueError` as `clip_sequence`."""
    return _joints(clip_sequence(positions, fps))


def _joints(sequence: Float32Array) -> Float32Array:
    return frames.quantise(at_12(sequence), STEP)


class Tracks(Mapping[str, Track]):
    """The tracks of clips by name, each made of its joints [N, 45] when it is asked for."""

    def __init__(self, joints: Mapping[str, Float32Array]) -> None:
        self._joints, self._made = joints, dict[str, Track]()

    def __getitem__(self, clip: str) -> Track:
        if clip not in self._made:
            self._made[clip] = Track.of(self._joints[clip])
        return self._made[clip]

    def __contains__(self, clip: object) -> bool:
        return clip in self._joints

    def __iter__(self) -> Iterator[str]:
        return iter(self._joints)

    def __len__(self) -> int:
        return len(self._joints)

    def joints(self, clip: str) -> Float32Array:
        """[N, 45] of a clip."""
        return self._joints[clip]

    def moves(self, clips: Sequence[str]) -> list[Float32Array]:
        """[m, 135] of some: of many those of `Track.moves` to rounding, by a kernel that takes a fifth of the time."""
        lengths = [len(self._joints[clip]) for clip in clips]
        if sum(lengths) < MANY:
            return [self[clip].moves() for clip in clips]
        edges = np.searchsorted(np.cumsum(lengths), np.linspace(0, sum(lengths), THREADS + 1)[1:-1]).tolist()
        shares = [clips[start:stop] for start, stop in pairwise([0, *edges, len(clips)])]
        return [moves for share in in_threads(self._of_many, shares, THREADS) for moves in share]

    def _of_many(self, clips: Sequence[str]) -> list[Float32Array]:
        if not clips:
            return []
        joints = [self._joints[clip] for clip in clips]
        moves, first = moves_of_clips(np.concatenate(joints), np.cumsum([0, *map(len, joints)]))
        return [moves[start:stop] for start, stop in pairwise(first.tolist())]


def read_tracks(lake: Lake, parts: Mapping[str, str]) -> Tracks:
    """Of some clips, by the frames part of each, those that the stage has made.

    Raises:
        DamagedError: a part is not as it was written.
    """
    made = remembered(lake, "moves made", _made)
    files = {part: file for part, file in MOVES.files_of(lake, parts.values(), ()).items() if file in made}
    return Tracks(rows_of_clips(lake, by_file(lake, files, parts), JOINTS))


def joints_in(lake: Lake, file: str) -> Iterator[tuple[str, Float32Array]]:
    """Clips of a part with their joints [N, 45]. Raises `DamagedError` where it is not as it was written."""
    yield from read_joints(sound(lake, file))


def read_joints(path: Path) -> Iterator[tuple[str, Float32Array]]:
    """The same of the file of a part."""
    yield from read_rows(path, JOINTS)


def tracks_in(lake: Lake, file: str) -> Iterator[tuple[str, Track]]:
    """The same with their tracks."""
    for clip, joints in joints_in(lake, file):
        yield clip, Track.of(joints)


def _made(con: Connection) -> set[str]:
    return {MOVES.file(row["key"]) for row in fetch(con, "done_keys", {"stage": MOVES.name})}
