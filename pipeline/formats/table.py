"""Tables of joint positions, a row a frame: CSV and Parquet, of motionlake and of other programs."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.limits_config import LimitError, limits
from motionlake.formats.parse.keys import whole_rate
from motionlake.formats.parse.parquet_table import ParquetTable
from motionlake.formats.parse.table_columns import columns_of, header_of
from motionlake.formats.parse.table_map import MAP, TableMap, map_file, table_map
from motionlake.formats.parse.text_table import TextTable
from motionlake.formats.positions_npz import parents_first
from motionlake.formats.registry import COMPRESSED_SUFFIX, first_bytes, load_bytes
from motionlake.formats.repair import all_three, fill_missing, missing_samples, repair_note
from motionlake.motion.clip import Hierarchy, SourceClip
from motionlake.motion.rigs import RigMap, identify, joints_by_name, load_rigs
from motionlake.motion.skeleton import INDEX, JOINTS, PARENTS

PARQUET: Final = ".parquet"
# A table with fewer such columns may be of anything; one that a map is written for is what the map says.
FEWEST_JOINTS: Final = 5
UNEVEN: Final = 0.1  # of a frame: how far from even times frames may be and still be taken for even
# Of the parts of a lake (docs/lake-format.md): many clips in one table.
LAKE_COLUMNS: Final = frozenset({"clip", "part"})
_HELP: Final = f"write a {MAP} beside it (docs/tables.md)"


class TableReader:
    """Joint positions in CSV and Parquet; a table of anything else is no clip."""

    name = "table"
    suffixes = (".csv", PARQUET)

    def recognises(self, path: Path) -> bool:
        """Whether the names of the table's columns are those of joints, or it is one that a map beside it may be of."""
        try:
            names = _names(path)
        except LimitError:
            return False
        except ClipError:  # what calls itself Parquet and is not is rejected with that reason
            return _is_parquet(path)
        if LAKE_COLUMNS.issubset(names):
            return False
        file = map_file(path)
        if file is None:
            return len(columns_of(names).joints) >= FEWEST_JOINTS
        return file.name != MAP or len(names) >= 3 * FEWEST_JOINTS or _fits(file, names)

    def companions(self, path: Path) -> list[Path]:
        """The file that says what the columns are, if there is one."""
        file = map_file(path)
        return [] if file is None else [file]

    def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
        """Read one body, at `fps` in place of the table's times.

        Raises:
            ClipError: no columns of joints, no times or no tree of joints that is known, or rows that are no numbers.
        """
        file = map_file(path)
        said = table_map(file)
        table = ParquetTable(data) if _is_parquet(path) else TextTable(data)
        columns = columns_of(table.names, said.position, said.time)
        joints, parents = _tree(columns.joints, said, "" if file is None else file.name)
        limits().check_body(table.rows, len(joints), len(data))
        timed = fps is None and said.fps is None
        if timed and columns.time is None:
            raise ClipError(f"has no column of time: say --fps, or {_HELP} with fps")
        places = [column for joint in joints for column in columns.joints[joint]]
        numbers = table.read([*places, *([columns.time] if timed and columns.time is not None else [])])
        if len(numbers) < 2:
            raise ClipError(f"has {len(numbers)} frame(s); a motion needs at least two")
        positions = np.ascontiguousarray(numbers[:, : len(places)]).reshape(len(numbers), -1, 3)
        missing = missing_samples(positions) if said.gaps else ~all_three(np.isfinite(positions))
        filled, repaired = fill_missing(positions, missing, joints)
        rate, notes = (fps or said.fps or 0.0), repair_note(repaired, len(filled))
        if timed:
            filled, rate, resampled = _at_even_times(filled, numbers[:, -1] * columns.seconds)
            notes += resampled
        left_out = len(columns.joints) - len(joints)
        return [
            SourceClip(
                Hierarchy.of_positions(joints, parents),
                filled.reshape(len(filled), -1),
                rate,
                metres_per_unit=said.metres_per_unit,
                up=said.up,
                repaired=repaired,
                notes=(*notes, *((f"{left_out} joints that the map does not name are left out",) if left_out else ())),
            )
        ]


def _is_parquet(path: Path) -> bool:
    return path.name.lower().removesuffix(COMPRESSED_SUFFIX).endswith(PARQUET)


def _names(path: Path) -> tuple[str, ...]:
    if not _is_parquet(path):
        return header_of(first_bytes(path)).names
    compressed = path.name.lower().endswith(COMPRESSED_SUFFIX)
    return ParquetTable(load_bytes(path) if compressed else path).names


def _fits(file: Path, names: Sequence[str]) -> bool:
    """Whether a map says of columns that they are joints."""
    try:
        said = table_map(file)
    except ClipError:
        return False
    return said.position is not None and bool(columns_of(names, said.position).joints)


def _tree(
    columns: Mapping[str, tuple[int, int, int]], said: TableMap, map_name: str
) -> tuple[tuple[str, ...], tuple[int, ...]]:
    """The joints to be read, the root first, and their parents."""
    if not columns:
        wrong = (
            f"no columns fit position in {map_name}" if said.position is not None else "no columns of joints: " + _HELP
        )
        raise ClipError(f"has {wrong}")
    limits().check("joints", len(columns), f"has {len(columns)} joints")
    above = said.parents if said.parents is not None else _known(tuple(columns))
    for joint in above:
        if joint not in columns:
            raise ClipError(f"{map_name} names the joint {joint!r:.40}, which has no columns of x, y and z")
    names = list(above)
    place = {name: number for number, name in enumerate(names)} | {"": -1}
    for joint, parent in above.items():
        if parent not in place:
            raise ClipError(
                f"{map_name}: the parent of {joint!r:.40} is {parent!r:.40}, which it does not name as a joint"
            )
    parents = [place[parent] for parent in above.values()]
    order = parents_first(parents)
    rank = {joint: number for number, joint in enumerate(order)} | {-1: -1}
    return tuple(names[joint] for joint in order), tuple(rank[parents[joint]] for joint in order)


@functools.lru_cache(maxsize=64)
def _known(joints: tuple[str, ...]) -> Mapping[str, str]:
    """The parent of each joint where the names are those of a known rig; what it does not name hangs from the root."""
    try:
        rig = identify(joints, _rigs())
    except ClipError as error:
        raise ClipError(
            f"its joints are of no known rig, and a table names no parents: {_HELP} with [parents]"
        ) from error
    index = joints_by_name(joints)
    own = {
        name: joints[index[of.casefold()]] for name in JOINTS if (of := rig.joints.get(name, "\0")).casefold() in index
    }
    root = own[next(name for name in JOINTS if name in own)]
    parents = dict.fromkeys(joints, root) | {root: ""}
    for name, joint in own.items():
        here = PARENTS[INDEX[name]]
        while here >= 0 and JOINTS[here] not in own:
            here = PARENTS[here]
        if here >= 0:
            parents[joint] = own[JOINTS[here]]
    return parents


@functools.cache
def _rigs() -> dict[str, RigMap]:
    return load_rigs()


def _at_even_times(positions: Float64Array, times: Float64Array) -> tuple[Float64Array, float, tuple[str, ...]]:
    """Positions at even times, their rate, and a note where they had to be resampled."""
    steps = np.diff(times)
    if not (steps > 0).all():
        row = int((~(steps > 0)).argmax()) + 2
        raise ClipError(f"its times do not grow: frame {row} is at {times[row - 1]:g} s; say --fps")
    span = times[-1] - times[0]
    rate = whole_rate((len(times) - 1) / float(span))
    even = times[0] + np.arange(len(times)) * (span / (len(times) - 1))
    if (np.abs(times - even) * rate <= UNEVEN).all():
        return positions, rate, ()
    rate = whole_rate(1 / float(np.median(steps)))
    count = int(span * rate) + 1
    limits().check_body(count, positions.shape[1])
    at = times[0] + np.arange(count) / rate
    flat = positions.reshape(len(positions), -1)
    resampled = np.stack([np.interp(at, times, column) for column in flat.T], axis=1)
    note = f"frames last {steps.min():.4g} to {steps.max():.4g} s: resampled to {rate:.4g} frames a second"
    return resampled.reshape(count, -1, 3), rate, (note,)


READER: Final = TableReader()
