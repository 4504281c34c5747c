"""Several Parquet parts as one: the rows of each clip as they were, clip after clip in a given order."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
from motionlake.columns import read_parquet
from motionlake.errors import DamagedError
from motionlake.lake.frames import KEY, RIGS, clip_tables, motion_footer, rigs_footer, runs_of
from motionlake.lake.parts import PartWriter, check_part, replacing

Order = Sequence[tuple[str, str]]  # clips, and the part that holds each


def clips_in(path: Path) -> list[str]:
    """The clips of a part, in its order."""
    return [clip for clip, _ in runs_of(read_parquet(path, ["clip"]).column("clip"))]


def merge_parts(
    parts: Mapping[str, Path], order: Order, target: Path, part: str, key: str, schema: pa.Schema | None = None
) -> int:
    """Write the rows of clips that several parts hold as one part, whole or not at all.

    Each part must hold its clips in the given order; clips that a part lacks have no rows, others that it holds are
    left out. Memory holds a batch of each part that is being read, and one row group.

    Args:
        parts: by name; all have the same columns.
        order: the clips.
        target: to write.
        part, key: of the new part, for the columns of these names; the footer says `key`, and of frames what the
            footers of the parts say of the clips.
        schema: as the parts were written by; None: as they are read, which spells lists otherwise.

    Returns:
        Rows that were written.

    Raises:
        DamagedError: the parts do not have the same columns.
    """
    footers = [pq.read_metadata(path) for path in parts.values()]
    schemas = [footer.schema.to_arrow_schema() for footer in footers]
    read = schemas[0].remove_metadata()
    schema = schema or read
    if any(not other.equals(read) for other in schemas) or read.names != schema.names:
        raise DamagedError(f"{target}: the parts that it is to be made of do not have the same columns")
    columns = {name: value for name, value in (("part", part), ("key", key)) if name in schema.names}
    with replacing(target) as temporary:
        writer = PartWriter(temporary, schema, {"key": key})
        for rows in _in_order(parts, order):
            for name, value in columns.items():
                at = read.get_field_index(name)
                rows = rows.set_column(at, read.field(at), pa.repeat(pa.scalar(value), rows.num_rows))
            writer.append(rows if schema is read else rows.cast(schema))
        writer.close(_footer([footer.metadata or {} for footer in footers], order))
    check_part(target, writer.rows)
    return writer.rows


def _in_order(parts: Mapping[str, Path], order: Order) -> Iterator[pa.Table]:
    """The rows of each clip that its part has rows of; a part is opened when its first clip is wanted."""
    left = {name: sum(part == name for _, part in order) for name in parts}
    wanted = {name: {clip for clip, part in order if part == name} for name in parts}
    reading: dict[str, Iterator[tuple[str, pa.Table]]] = {}
    ahead: dict[str, tuple[str, pa.Table] | None] = {}
    for clip, part in order:
        if part not in parts:
            continue
        if part not in reading:
            reading[part] = clip_tables(pq.ParquetFile(parts[part], page_checksum_verification=True), wanted[part])
            ahead[part] = next(reading[part], None)
        found, left[part] = ahead[part], left[part] - 1
        if found is not None and found[0] == clip:
            yield found[1]
            ahead[part] = next(reading[part], None)
        if not left[part]:
            ahead[part] = None
            reading[part] = iter(())


def _footer(footers: Sequence[Mapping[bytes, bytes]], order: Order) -> dict[str, str]:
    """What frames parts say of their clips, of all together; nothing for other parts."""
    said: dict[str, Any] = {}
    rigs: dict[str, tuple[str, str]] = {}
    for found in footers:
        said |= json.loads(found.get(KEY.encode(), b'{"clips": {}}'))["clips"]
        for each in json.loads(found.get(RIGS.encode(), b"[]")):
            rigs |= {clip: (each["rig"], json.dumps(each["joints"])) for clip in each["clips"]}
    if not said:
        return {}
    of_maps: dict[tuple[str, str], list[str]] = {}
    for clip, _ in order:
        if clip in rigs:
            of_maps.setdefault(rigs[clip], []).append(clip)
    entries = [{"rig": rig, "clips": clips, "joints": json.loads(joints)} for (rig, joints), clips in of_maps.items()]
    clips = {clip: said[clip] for clip, _ in order if clip in said}
    return {**motion_footer(clips), **(rigs_footer(entries) if rigs else {})}
