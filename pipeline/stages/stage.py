"""What every stage has, shards of work, and the base of stages that follow the frames part by part.

A stage plans shards, runs each of them in a worker, and loads what came of them into the catalog. The key of a shard
covers stage, version, configuration and input; what is not recorded under its key is due.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import pyarrow as pa
from motionlake.lake.catalog import Connection, fetch, remembered, run_sql
from motionlake.lake.config import canonical_json, plain
from motionlake.lake.file_list import FileSums
from motionlake.lake.layout import Lake
from motionlake.lake.merging import Order, merge_parts
from motionlake.lake.parts import PartWriter, check_part, replacing
from motionlake.stages.key_cache import PartKeys, keys_of_parts
from motionlake.stages.model_kind import ModelKind
from motionlake.stages.reader import LakeReader

PART_KEYS = [("clip", pa.string()), ("part", pa.string()), ("key", pa.string())]
STAGING = "staging"  # parts that are of no use once they are loaded


@dataclass(frozen=True)
class Shard:
    """Work for seconds to a minute, independent of every other shard.

    Attributes:
        stage: name of the stage.
        key: sha256 over stage, version, configuration and inputs.
        part: the frames part it makes or is derived from.
        dataset: for people.
        spec: JSON-able; all that `run` needs beside the lake's folder.
        items: clips in it, for the progress bar.
        inputs: the files of the lake that it reads, as they were written.
    """

    stage: str
    key: str
    part: str
    dataset: str
    spec: Mapping[str, Any]
    items: int
    inputs: tuple[FileSums, ...] = ()


@dataclass(frozen=True)
class ShardResult:
    """What a worker gives back; bulk data lies in `files` already.

    Attributes:
        rows: rows written to the stage's own Parquet part.
        size: bytes of all files.
        files: relative to the lake.
        seconds: the worker's time.
        sums: of the files, as they were written; a stage gives those of files that it has taken over.
        rejected: source files that gave no clip.
        tables: rows for the catalog.
    """

    shard: Shard
    rows: int = 0
    size: int = 0
    files: tuple[str, ...] = ()
    seconds: float = 0.0
    sums: tuple[FileSums, ...] = ()
    rejected: int = 0
    tables: Mapping[str, pa.Table] = field(default_factory=dict)


class Stage(ABC):
    """One stage; `motionlake.stages.registry` lists them all. One that is no `ShardStage` only has its model made.

    Attributes:
        name: of its shards; keys cover it.
        version: of its results; keys cover it.
        about: what it does, for people.
        model: kind of model that it needs, and that is made for it; None: none.
        tables: of the catalog that it fills.
        by_name: made when it is asked for by name, not by `run all`.
    """

    name: ClassVar[str]
    version: ClassVar[int] = 1
    about: ClassVar[str]
    model: ClassVar[ModelKind[Any] | None] = None
    tables: ClassVar[tuple[str, ...]] = ()
    by_name: ClassVar[bool] = False

    @property
    def upstream(self) -> tuple[str, ...]:
        """The stages whose results it reads."""
        return ("frames",)

    @property
    def folders(self) -> tuple[str, ...]:
        """Of the lake that it writes to."""
        return ()

    @abstractmethod
    def due(self, at: LakeReader) -> int:
        """How many parts it still lacks, whether their input is there or not."""


class ShardStage(Stage):
    """A stage whose work is done in shards.

    Attributes:
        cut_is_kept: shards are entered before any runs, in a transaction more: what is cut into shards changes, and a
            run that goes on must make the same parts.
        reads_catalog: shards read the catalog that is served, and not only what they are given.
    """

    cut_is_kept: ClassVar[bool] = False
    reads_catalog: ClassVar[bool] = False

    def alongside(self, at: LakeReader) -> bool:
        """Whether it needs the frames of a part alone, and so may run on it together with others of which that holds:
        in one task, which reads the part once."""
        return False

    @abstractmethod
    def plan(self, at: LakeReader) -> list[Shard]:
        """Shards for what is due and whose input is there."""

    def lacking(self, at: LakeReader) -> str | None:
        """What must be made before it can plan, for people; None where nothing is missing."""
        return None

    def again(self, at: LakeReader, key: str) -> Shard | None:
        """The shard with this key, done or not; None where the lake as it stands needs none such."""
        return None

    def at_once(self, at: LakeReader) -> bool:
        """Whether all shards must be loaded in one transaction, because they are of use only together."""
        return False

    @abstractmethod
    def run(self, root: Path, shard: Shard, /) -> ShardResult:
        """Make one shard of the lake in the folder `root`; it writes files and changes no catalog."""

    @abstractmethod
    def load(self, con: Connection, root: Path, results: Sequence[ShardResult], /) -> None:
        """Enter finished shards into the catalog, within the caller's transaction."""


class Part(NamedTuple):
    """One live frames part and the key that a stage's result for it must have.

    Attributes:
        upstream: key of what the stage reads.
        key: key of what the stage makes.
        synthetic: its clips were made by a generator; models are not fitted to them.
    """

    part: str
    dataset: str
    clips: int
    upstream: str
    key: str
    synthetic: bool = False


def frames_parts(con: Connection) -> list[Part]:
    """Every frames part that holds a clip of the lake."""
    rows = fetch(con, "frames_parts")
    return [Part(r["part"], r["dataset"], r["clips"], "", r["key"], r["synthetic"]) for r in rows]


def live_parts(at: LakeReader) -> list[Part]:
    """The same of a lake that is open, asked for once."""
    return at.once("frames_parts", "", lambda: frames_parts(at.con))


def clips_of(con: Connection, part: str) -> list[str]:
    """The clips of the lake in a frames part; the part may hold more that left since it was written."""
    return [r["clip"] for r in fetch(con, "part_clips", {"part": part})]


def part_keys(clip: str, shard: Shard, count: int) -> list[pa.Array]:
    """The columns `PART_KEYS` of so many rows of a clip."""
    return [pa.repeat(pa.scalar(value), count) for value in (clip, shard.part, shard.key)]


class PartStage(ShardStage):
    """A stage derived part by part from the frames: one shard a frames part, one Parquet part of its own a shard.

    Attributes:
        source: the stage whose results it reads; None: the frames.
        folder: of its parts.
        schema: of their rows; None: as the first table has it.
        statement: of SQL that loads staged parts, given `parts`, `files` and what the shards' specs hold of `model`;
            "" where the manifest's row is all that is entered.
    """

    source: ClassVar[PartStage | None] = None
    folder: ClassVar[str] = STAGING
    schema: ClassVar[pa.Schema | None] = None
    statement: ClassVar[str] = ""

    def alongside(self, at: LakeReader) -> bool:
        return self.source is None

    @property
    def upstream(self) -> tuple[str, ...]:
        return ("frames",) if self.source is None else (self.source.name,)

    @property
    def folders(self) -> tuple[str, ...]:
        return (self.folder,)

    def shaping(self, at: LakeReader) -> Sequence[Any] | None:
        """What keys cover beside stage, version and input, by default its model; None where that is not made yet."""
        if self.model is None:
            return ()
        model = self.model.fitting(at)
        return None if model is None else (at.file_hash(model.file),)

    @abstractmethod
    def spec(self, at: LakeReader, part: Part) -> Mapping[str, Any]:
        """What the shard of a part needs, JSON-able."""

    @abstractmethod
    def rows(self, lake: Lake, shard: Shard) -> Iterator[pa.Table]:
        """What the shard makes, a few clips at a time."""

    def count(self, table: pa.Table, shard: Shard) -> int:
        """Rows that a table counts for in `status`."""
        return int(table.num_rows)

    def parts(self, at: LakeReader) -> list[Part] | None:
        """Every live part with the key its result must have; None where a model is not made yet."""
        return at.once("parts", self.name, lambda: self._parts(at))

    def _parts(self, at: LakeReader) -> list[Part] | None:
        above = live_parts(at) if self.source is None else self.source.parts(at)
        shaping = None if above is None else self.shaping(at)
        if above is None or shaping is None:
            return None
        keys = self._keys(shaping)
        return [Part(part, dataset, clips, key, keys[key], made) for part, dataset, clips, _, key, made in above]

    def made(self, at: LakeReader) -> list[Part]:
        """The live parts that it has made."""
        done = at.done(self.name)
        return [part for part in self.parts(at) or [] if part.key in done]

    def key_of(self, upstream: str, shaping: Sequence[Any]) -> str:
        """The key of what the stage makes, given the key of what it reads, and what `shaping` tells."""
        return self._keys(shaping)[upstream]

    def files_of(self, lake: Lake, parts: Iterable[str], shaping: Sequence[Any]) -> dict[str, str]:
        """Of some frames parts what a stage that reads these makes of them, whether it is there yet or not."""
        keys = remembered(lake, "keys of parts", _keys_of_frames)
        return {part: self.file(self.key_of(keys[part], shaping)) for part in set(parts) if part in keys}

    def _keys(self, shaping: Sequence[Any]) -> PartKeys:
        return keys_of_parts(self.name, self.version, canonical_json([plain(value) for value in shaping]))

    def plan(self, at: LakeReader) -> list[Shard]:
        done = at.done(self.name)
        ready = {r["key"] for r in fetch(at.con, "ready_keys", {"stage": self.upstream[0]})}
        return [self._shard(at, p) for p in self.parts(at) or [] if p.key not in done and p.upstream in ready]

    def again(self, at: LakeReader, key: str) -> Shard | None:
        part = next((p for p in self.parts(at) or [] if p.key == key), None)
        return None if part is None else self._shard(at, part)

    def _shard(self, at: LakeReader, part: Part) -> Shard:
        return Shard(self.name, part.key, part.part, part.dataset, self.spec(at, part), part.clips)

    def due(self, at: LakeReader) -> int:
        parts, done = self.parts(at), at.done(self.name)
        return len(live_parts(at)) if parts is None else sum(p.key not in done for p in parts)

    def lacking(self, at: LakeReader) -> str | None:
        return f"what `run {self.upstream[0]}` makes" if self.parts(at) is None else None

    def file(self, key: str) -> str:
        """The part that a shard writes, relative to the lake."""
        name = f"{self.name}-{key[:16]}" if self.folder == STAGING else key[:16]
        return f"{self.folder}/{name}.parquet"

    def merge(self, parts: Mapping[str, Path], order: Order, target: Path, part: str, key: str) -> None:
        """Write the rows of clips that several of its parts hold as one (`merge_parts`)."""
        merge_parts(parts, order, target, part, key, self.schema)

    def entered(self, key: str) -> str:
        """The part whose rows enter the catalog."""
        return self.file(key)

    def files(self, at: LakeReader) -> dict[str, str]:
        """Of every live frames part the part that the stage made of it, whether it is there yet or not."""
        return at.once("files", self.name, lambda: {p.part: self.file(p.key) for p in self.parts(at) or []})

    def run(self, root: Path, shard: Shard, /) -> ShardResult:
        started = time.perf_counter()
        lake, file = Lake(root), self.file(shard.key)
        rows = 0
        with replacing(lake.path(file)) as temporary:
            writer: PartWriter | None = None
            metadata = {} if self.folder == STAGING else {"key": shard.key}
            if self.schema is not None:
                writer = PartWriter(temporary, self.schema, metadata)
            for table in self.rows(lake, shard):
                writer = writer or PartWriter(temporary, table.schema, metadata)
                writer.append(table)
                rows += self.count(table, shard)
            if writer is None:
                raise ValueError(f"part {shard.part} holds no clip of the lake")
            writer.close()
        size = check_part(lake.path(file), writer.rows)
        files = () if self.folder == STAGING else (file,)
        return ShardResult(shard, rows, size, files, time.perf_counter() - started)

    def load(self, con: Connection, root: Path, results: Sequence[ShardResult], /) -> None:
        if self.statement:
            files = [str(root / self.entered(r.shard.key)) for r in results]
            parameters = {"parts": [r.shard.part for r in results], "files": files}
            run_sql(con, self.statement, {"model": results[0].shard.spec.get("model"), **parameters})


def _keys_of_frames(con: Connection) -> dict[str, str]:
    return {row["part"]: row["key"] for row in fetch(con, "keys_of_parts")}
