"""A shard of work and what came of it: what a stage hands to whoever runs it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import pyarrow as pa


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
    """

    stage: str
    key: str
    part: str
    dataset: str
    spec: Mapping[str, Any]
    items: int


@dataclass(frozen=True)
class ShardResult:
    """What a worker gives back; bulk data lies in `files` already.

    Attributes:
        rows: rows written to the stage's own Parquet part.
        size: bytes of all files.
        files: relative to the lake.
        seconds: the worker's time.
        rejected: source files that gave no clip.
        tables: rows for the catalog.
    """

    shard: Shard
    rows: int
    size: int
    files: tuple[str, ...]
    seconds: float
    rejected: int = 0
    tables: Mapping[str, pa.Table] = field(default_factory=dict)


def tables_of(results: Iterable[ShardResult], name: str) -> pa.Table:
    """The rows of one kind of several results, in shard order."""
    return pa.concat_tables([r.tables[name] for r in results if name in r.tables])
