"""Canonical frames as Parquet parts, one column a channel, with a footer that says what these are; back to arrays."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from motionlake.columns import matrix_of
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.integrity import sound_while
from motionlake.lake.layout import Lake
from motionlake.motion.calibration import held, recorded_range
from motionlake.motion.skeleton import JOINTS, PARENTS
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from motionlake.motion.canonicalise import CanonicalMotion
    from motionlake.motion.rig_joints import RigJoint

ROOT_CHANNELS: Final = ("root_x", "root_y", "root_z")
ROTATION_CHANNELS: Final = tuple(f"{j}_q{c}" for j in JOINTS for c in "wxyz")
POSITION_CHANNELS: Final = tuple(f"{j}_{c}" for j in JOINTS[1:] for c in "xyz")
PLACES: Final = ROOT_CHANNELS + POSITION_CHANNELS
CHANNELS: Final = ROOT_CHANNELS + ROTATION_CHANNELS + POSITION_CHANNELS
_KEYS: Final = (("clip", pa.string()), ("part", pa.string()), ("frame", pa.int32()), ("fps", pa.float64()))
SCHEMA: Final = pa.schema([*_KEYS, *((name, pa.float32()) for name in CHANNELS)])

# What a frames part says of itself: JSON below this key of its footer, as docs/lake-format.md describes it. With it a
# part can be read alone: which joints the columns are of, what rotations turn, and each clip's rate and bones.
KEY: Final = "motion"
RIGS: Final = "rigs"  # likewise: which joint of their files is which
VERSION: Final = 1  # of frames parts: their columns and this footer
_CONVENTIONS: Final[Mapping[str, Any]] = {
    "version": VERSION,
    "unit": "metre",
    "up": "y",
    "handedness": "right",
    "joints": JOINTS,
    "parents": PARENTS,
    "rest_pose": "T-pose facing +z, the body's left towards +x",
    "rotations": {
        "order": "wxyz",
        "of": "local: a joint relative to its parent, in the rest pose the identity",
        "position": "of the parent + rest offset of the joint turned by the parent's world rotation",
    },
    "columns": {
        "root": ["root_x", "root_y", "root_z"],
        "rotation": ["{joint}_qw", "{joint}_qx", "{joint}_qy", "{joint}_qz"],
        "position": ["{joint}_x", "{joint}_y", "{joint}_z"],
    },
}


@dataclass(frozen=True)
class Frames:
    """The canonical motion of one clip at its own rate.

    Attributes:
        clip: the clip's name in the lake.
        fps: frames a second.
        rotations: [F, 21, 4] local rotations (w, x, y, z) relative to the canonical rest pose; [F, 0, 4] where only
            positions were read.
        positions: [F, 21, 3] joints in the world, metres, y up; joint 0 is the root.
    """

    clip: str
    fps: float
    rotations: NDArray[np.floating]
    positions: NDArray[np.floating]

    def recorded(self) -> Frames:
        """The same, where frames of calibration poses at its ends hold the pose of the motion next to them.

        As many frames as before, so that each keeps its number.
        """
        kept = recorded_range(self.positions, self.fps)
        if kept == (0, len(self.positions)):
            return self
        return replace(self, rotations=held(self.rotations, kept), positions=held(self.positions, kept))


def quantise(values: NDArray[np.floating], step: float) -> NDArray[np.float32]:
    """Round to multiples of a power of two: exact in float32, and its zero bits compress away."""
    return (np.round(values / step) * step).astype(np.float32)


def key_columns(clip: str, part: str, count: int) -> list[pa.Array]:
    """The three columns every per-frame part begins with: clip, part, frame."""
    return [
        pa.repeat(pa.scalar(clip), count),
        pa.repeat(pa.scalar(part), count),
        pa.array(np.arange(count, dtype=np.int32)),
    ]


def columns_of(matrix: NDArray[np.float32]) -> list[pa.Array]:
    """The columns of [F, C], as slices of one array: C arrays of their own take twice the time."""
    every = pa.array(np.ascontiguousarray(matrix.T).reshape(-1))
    return [every.slice(column * len(matrix), len(matrix)) for column in range(matrix.shape[1])]


def to_table(frames: Frames, part: str, position_step: float, rotation_step: float) -> pa.Table:
    """The rows of one clip, quantised (steps in metres and quaternion units)."""
    count = len(frames.positions)
    positions = quantise(frames.positions, position_step).reshape(count, -1)
    rotations = quantise(frames.rotations, rotation_step).reshape(count, -1)
    matrix = np.concatenate([positions[:, :3], rotations, positions[:, 3:]], axis=1)
    keys = [*key_columns(frames.clip, part, count), pa.repeat(pa.scalar(float(frames.fps)), count)]
    return pa.Table.from_arrays([*keys, *columns_of(matrix)], schema=SCHEMA)


def from_table(clip: str, table: pa.Table) -> Frames:
    """The arrays of one clip's rows (sorted by frame), of the columns there are; rotations are normalised again."""
    positions = matrix_of(table, PLACES).reshape(table.num_rows, -1, 3)
    fps = table.column("fps")[0].as_py()
    if ROTATION_CHANNELS[0] not in table.column_names:
        return Frames(clip, fps, np.empty((table.num_rows, 0, 4), dtype=np.float32), positions)
    rotations = matrix_of(table, ROTATION_CHANNELS).reshape(table.num_rows, -1, 4)
    return Frames(clip, fps, rotations / np.linalg.norm(rotations, axis=-1, keepdims=True), positions)


def footer_clip(fps: float, rest_offsets: ArrayLike) -> dict[str, Any]:
    """What a footer says of one clip; `rest_offsets` [21, 3], metres, are rounded to micrometres."""
    offsets = np.asarray(rest_offsets, dtype=np.float32).astype(float)  # first as the catalog has them
    offsets = offsets.reshape(len(JOINTS), 3).round(6) + 0.0  # no -0.0
    return {"fps": float(fps), "rest_offsets": offsets.tolist()}


def motion_footer(clips: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """The footer's key and text for a part of clips as `footer_clip` gives them."""
    return {KEY: _json({**_CONVENTIONS, "clips": clips})}


class RigsFooter:
    """What the joints of the clips of a part are to their rigs, as its footer says it: clips of one map together."""

    def __init__(self) -> None:
        self._clips: dict[tuple[str, str], list[str]] = {}

    def add(self, clip: str, rig: str, joints: Sequence[RigJoint]) -> None:
        """Add a clip by the name of its rig."""
        self._clips.setdefault((rig, _json([_said(joint) for joint in joints])), []).append(clip)

    def metadata(self) -> dict[str, str]:
        """The footer's key and text."""
        found = [{"rig": rig, "clips": clips, "joints": json.loads(said)} for (rig, said), clips in self._clips.items()]
        return rigs_footer(found)


def rigs_footer(maps: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """The footer's key and text for rig maps: `rig`, `clips` and `joints` of each."""
    return {RIGS: _json(maps)}


def _said(joint: RigJoint) -> dict[str, Any]:
    return {name: value for name, value in vars(joint).items() if value not in (None, {})}


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"))


def open_frames(path: Path) -> pq.ParquetFile:
    """Open a frames part.

    Raises:
        UserError: the file is damaged, or its footer is of another version.
    """
    try:
        part = pq.ParquetFile(path, page_checksum_verification=True)
        version = _version_in((part.metadata.metadata or {}).get(KEY.encode(), b'{"version": 0}'))
    except (pa.ArrowInvalid, ValueError, KeyError, TypeError) as error:
        reason = str(error).splitlines()[0]
        raise UserError(f"{path}: is a damaged frames part ({reason}); put back a copy, or make a new lake") from error
    if version != VERSION:
        todo = "update motionlake" if version > VERSION else "`motionlake migrate` brings a lake up to date"
        raise UserError(f"{path}: is a frames part of version {version}, and version {VERSION} is read here; {todo}")
    return part


def _version_in(footer: bytes) -> int:
    """The version that a footer says; what it says of its clips takes some milliseconds to read."""
    first = re.match(rb'\{"version": ?(\d+)[,}]', footer)
    return int(first[1] if first else json.loads(footer)["version"])


def frame_range(name: str, start: int | None, stop: int | None, frames: int) -> tuple[int, int]:
    """Frames [start, stop) of a clip of so many; None for its first and its last.

    Raises:
        UserError: the clip has no such frames.
    """
    first, last = start or 0, frames if stop is None else stop
    if not 0 <= first < last <= frames:
        raise UserError(f"{name}: has frames 0 to {frames}; frames {first} to {last} are not a range of them")
    return first, last


def read_part(path: Path, clips: Collection[str] | None = None, *, rotations: bool = True) -> Iterator[Frames]:
    """Every clip of a frames part, or those of `clips`, in order; memory holds one row group and one clip.

    Without `rotations`, whose columns are most of a part, it takes half the time.
    """
    columns = None if rotations else ["clip", "fps", *PLACES]
    yield from (from_table(clip, rows) for clip, rows in clip_tables(open_frames(path), clips, columns))


def clip_tables(
    part: pq.ParquetFile, clips: Collection[str] | None = None, columns: Sequence[str] | None = None
) -> Iterator[tuple[str, pa.Table]]:
    """(clip, its rows) of every clip of an open part, or of those of `clips`, in order; all columns or some."""
    wanted = None if clips is None else frozenset(clips)
    batches = (pa.Table.from_batches([batch]) for batch in part.iter_batches(batch_size=65_536, columns=columns))
    found = ((clip, rows) for batch in batches for clip, rows in runs(batch) if wanted is None or clip in wanted)
    for clip, pieces in groupby(found, key=itemgetter(0)):
        yield clip, pa.concat_tables([rows for _, rows in pieces])


def runs(table: pa.Table) -> Iterator[tuple[str, pa.Table]]:
    """(clip, its rows) for rows clip by clip."""
    for clip, found in runs_of(table.column("clip")):
        yield clip, table.slice(found.start, found.stop - found.start)


def runs_of(column: pa.ChunkedArray) -> Iterator[tuple[str, slice]]:
    """(value, its rows) of every run of equal values."""
    import pyarrow.compute as pc  # takes longer to import than all else here, and who only plans needs none of it

    encoded = pc.run_end_encode(column.combine_chunks())
    stops = encoded.run_ends.to_pylist()
    yield from zip(encoded.values.to_pylist(), map(slice, [0, *stops[:-1]], stops), strict=True)


def lengths(path: Path) -> dict[str, tuple[float, int]]:
    """(frames a second, number of frames) of every clip of a frames part."""
    table = open_frames(path).read(columns=["clip", "fps"])
    return {clip: (rows.column("fps")[0].as_py(), rows.num_rows) for clip, rows in runs(table)}


def read_clips(path: Path, clips: Sequence[str], *, rotations: bool = True) -> Iterator[Frames]:
    """Some clips of a frames part, in its order, or their joints alone."""
    columns = ("fps", *(CHANNELS if rotations else PLACES))
    yield from (from_table(clip, rows) for clip, rows in read_rows(path, clips, columns))


def read_rows(path: Path, clips: Sequence[str], columns: Sequence[str]) -> Iterator[tuple[str, pa.Table]]:
    """(clip, its rows) of some clips and columns of a frames part; row groups without such clips are not read."""
    part = open_frames(path)
    groups = [i for i in range(part.num_row_groups) if _may_hold(part.metadata.row_group(i).column(0), clips)]
    table = part.read_row_groups(groups, columns=["clip", *columns])
    wanted = frozenset(clips)
    yield from ((clip, rows) for clip, rows in runs(table) if clip in wanted)


def _may_hold(column: pq.ColumnChunkMetaData, clips: Sequence[str]) -> bool:
    bounds = column.statistics
    return bounds is None or not bounds.has_min_max or any(bounds.min <= clip <= bounds.max for clip in clips)


def read_clip(path: Path, clip: str, *, rotations: bool = True) -> Frames:
    """One clip of a frames part, or its joints alone. Raises `UserError` where the part does not hold it."""
    found = next(read_clips(path, [clip], rotations=rotations), None)
    if found is None:
        raise UserError(f"{path}: does not hold {clip}; the catalog and its parts do not belong together")
    return found


def stored_clip(lake: Lake, row: Mapping[str, Any], *, rotations: bool = True) -> Frames:
    """One clip of a lake, or its joints alone, given what the table `clips` says of it.

    Raises:
        UserError: as `read_clip`.
        DamagedError: its part is not as it was written.
    """
    file = lake.frames_part(row["dataset"], row["part"])
    return sound_while(lake, file, lambda path: read_clip(path, row["clip"], rotations=rotations))


def canonical_motion(con: Connection, lake: Lake, clip: str) -> CanonicalMotion:
    """The motion of a clip on the canonical skeleton, from its stored frames."""
    row = fetch(con, "clip", {"clip": clip})[0]
    return motion_of(stored_clip(lake, row), row)


def motion_of(stored: Frames, row: Mapping[str, Any]) -> CanonicalMotion:
    """The motion of stored frames, and of what the table `clips` says of the clip."""
    from motionlake.motion.canonicalise import CanonicalMotion

    positions = stored.positions.astype(float)
    return CanonicalMotion(
        fps=stored.fps, root=positions[:, 0], rotations=stored.rotations.astype(float), positions=positions,
        rest_offsets=np.array(row["rest_offsets"], dtype=float).reshape(-1, 3), body_height=row["body_height"],
        twist=row["twist"], filled=tuple(row["filled"]), up="y", metres_per_unit=1.0, fk_error=row["fk_error"],
        fk_error_mean=row["fk_error"], notes=tuple(row["notes"]),
    )  # fmt: skip
