"""Stages derived part by part from the frames: keys chain from stage to stage, and what lacks its key is due."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import pyarrow as pa
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.config import config_hash
from motionlake.stages.shard import Shard

PART_KEYS = [("clip", pa.string()), ("part", pa.string()), ("key", pa.string())]


@dataclass(frozen=True)
class Part:
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


def clips_of(con: Connection, part: str) -> list[str]:
    """The clips of the lake in a frames part; the part may hold more that left since it was written."""
    return [r["clip"] for r in fetch(con, "part_clips", {"part": part})]


def derive(parts: list[Part], stage: str, version: int, *config: Any) -> list[Part]:
    """The same parts one stage further down: the new key covers stage, version, configuration and input."""
    return [replace(p, upstream=p.key, key=config_hash(stage, version, p.key, *config)) for p in parts]


def due(
    con: Connection,
    stage: str,
    upstream_stage: str,
    parts: list[Part],
    spec: Callable[[Part], Mapping[str, Any]],
) -> list[Shard]:
    """Shards for the parts whose input is there and whose result is not."""
    done = {r["key"] for r in fetch(con, "shards", {"stage": stage}) if r["state"] == "ok"}
    ready = {r["key"] for r in fetch(con, "ready_keys", {"stage": upstream_stage})}
    return [
        Shard(stage, p.key, p.part, p.dataset, spec(p), p.clips)
        for p in parts
        if p.key not in done and p.upstream in ready
    ]
