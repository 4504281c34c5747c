"""What came of shards, entered into the catalog every few seconds."""

from __future__ import annotations

import errno
import json
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import pyarrow as pa
from motionlake.errors import FULL
from motionlake.jobs.shards import Ended
from motionlake.lake.catalog import load_rows, table_of, writing
from motionlake.lake.file_list import list_files
from motionlake.lake.layout import Lake
from motionlake.names import typed
from motionlake.stages.stage import Shard, ShardResult, ShardStage

_S, _I = pa.string(), pa.int64()
PLAN_ROWS = pa.schema({"stage": _S, "key": _S, "part": _S, "dataset": _S, "spec": _S})
FINISH_ROWS = pa.schema(
    {
        "stage": _S, "key": _S, "part": _S, "state": _S, "reason": _S, "rows": _I, "bytes": _I,
        "files": pa.list_(_S), "seconds": pa.float64(),
    }
)  # fmt: skip
NO_FAULT_OF_SHARDS = (*FULL, errno.EROFS)  # all of them would fail
LOAD_EVERY = 5.0  # seconds; what a killed run has done since its catalog was last served is done again


@dataclass
class Outcome:
    """What came of a stage: shards done and failed, clips in them, source files rejected."""

    ok: int = 0
    failed: int = 0
    clips: int = 0
    rejected: int = 0
    rows: int = 0
    bytes: int = 0
    reason: str = ""  # of the last failure

    def __iadd__(self, other: Outcome) -> Outcome:
        for name in ("ok", "failed", "clips", "rejected", "rows", "bytes"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.reason = other.reason or self.reason
        return self


class Results:
    """What came of shards of some stages, until it is entered into the catalog."""

    def __init__(
        self, lake: Lake, stages: Sequence[ShardStage], outcomes: dict[str, Outcome], at_once: Collection[str]
    ) -> None:
        self._lake, self._outcomes, self._at_once = lake, outcomes, at_once
        self._stages = {stage.name: stage for stage in stages}
        self._waiting: dict[str, list[ShardResult]] = {name: [] for name in self._stages}
        self._failures: dict[str, list[tuple[Shard, str]]] = {name: [] for name in self._stages}
        self._loaded_at, self._patience = time.monotonic(), LOAD_EVERY

    def add(self, ended: Ended) -> None:
        """Take in what came of the shards of a bundle. Raises `OSError` for what would fail every shard."""
        stopping: OSError | None = None
        for (stage, shard), found in ended:
            if isinstance(found, ShardResult):
                self._waiting[stage.name].append(found)
            elif isinstance(found, OSError) and found.errno in NO_FAULT_OF_SHARDS:
                stopping = OSError(found.errno, found.strerror, found.filename or str(self._lake.root))
            else:
                reason = typed(f"{type(found).__name__}: {found}").splitlines()[0][:500]
                self._failures[stage.name].append((shard, reason))
        if stopping is not None:
            raise stopping

    def load_now_and_then(self) -> None:
        """Load what is done where the last time is long ago, by how long loading takes."""
        if time.monotonic() - self._loaded_at <= self._patience:
            return
        started = time.monotonic()
        if self.load_done():
            self._loaded_at = time.monotonic()
            self._patience = max(LOAD_EVERY, 10 * (self._loaded_at - started))

    def load_done(self) -> bool:
        """Load what is done of stages that need not be loaded at once; whether there was any."""
        loaded = False
        for name, results in self._waiting.items():
            if results and name not in self._at_once:
                self._waiting[name], loaded = [], True
                self._outcomes[name] += _load(self._lake, self._stages[name], results)
        return loaded

    def load_all(self) -> None:
        """Load what is left, and what failed."""
        for name, stage in self._stages.items():
            results, self._waiting[name] = self._waiting[name], []
            self._outcomes[name] += _load(self._lake, stage, results, self._failures[name])


def _load(
    lake: Lake, stage: ShardStage, results: Sequence[ShardResult], failures: Sequence[tuple[Shard, str]] = ()
) -> Outcome:
    if not results and not failures:
        return Outcome()
    ordered = sorted(results, key=lambda r: (r.shard.dataset, r.shard.key))
    rows = [_row(r.shard, "ok", rows=r.rows, bytes=r.size, files=list(r.files), seconds=r.seconds) for r in ordered]
    rows += [_row(shard, "failed", reason=reason) for shard, reason in failures]
    with writing(lake) as con:
        if not stage.cut_is_kept:
            shards = [*(result.shard for result in ordered), *(shard for shard, _ in failures)]
            load_rows(con, "plan_shards", planned_rows(shards))
        if ordered:
            stage.load(con, lake.root, ordered)
        load_rows(con, "finish_shards", table_of(rows, FINISH_ROWS))
        list_files(con, [file for result in ordered for file in result.sums])
    return Outcome(
        ok=len(ordered), failed=len(failures), clips=sum(r.shard.items - r.rejected for r in ordered),
        rejected=sum(r.rejected for r in ordered), rows=sum(r.rows for r in ordered),
        bytes=sum(r.size for r in ordered), reason=failures[-1][1] if failures else "",
    )  # fmt: skip


def planned_rows(shards: Sequence[Shard]) -> pa.Table:
    """Rows of the manifest before shards have run."""
    rows = [
        {"stage": s.stage, "key": s.key, "part": s.part, "dataset": s.dataset, "spec": json.dumps(s.spec)}
        for s in shards
    ]
    return table_of(rows, PLAN_ROWS)


def _row(shard: Shard, state: str, **result: object) -> dict[str, object]:
    """A row of the manifest."""
    nothing: dict[str, object] = {"reason": None, "rows": 0, "bytes": 0, "files": [], "seconds": None}
    return {"stage": shard.stage, "key": shard.key, "part": shard.part, "state": state, **nothing, **result}
