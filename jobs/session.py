"""What every job of one command shares: the lake, its configuration, and how shards are run and entered."""

from __future__ import annotations

import errno
import json
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from datetime import datetime
from importlib.util import find_spec
from typing import TYPE_CHECKING, Protocol

import pyarrow as pa
from motionlake import memory
from motionlake.errors import FULL
from motionlake.jobs.shards import run_here, run_on, with_inputs
from motionlake.lake.catalog import bring_macros, collect_garbage, create_catalog, load_rows, table_of, writing
from motionlake.lake.config import LakeConfig, load_config
from motionlake.lake.integrity import check_files, list_files
from motionlake.lake.layout import Lake
from motionlake.lake.lock import locked
from motionlake.lake.records import keep_records
from motionlake.lake.run_progress import SharedProgress
from motionlake.lake.settings import changed_settings, keep_settings
from motionlake.lake.working import deferred, serve
from motionlake.names import typed
from motionlake.stages.stage import Shard, ShardResult, ShardStage

if TYPE_CHECKING:
    from distributed import Client

_S, _I = pa.string(), pa.int64()
PLAN_ROWS = pa.schema({"stage": _S, "key": _S, "part": _S, "dataset": _S, "spec": _S})
FINISH_ROWS = pa.schema(
    {
        "stage": _S, "key": _S, "part": _S, "state": _S, "reason": _S, "rows": _I, "bytes": _I,
        "files": pa.list_(_S), "seconds": pa.float64(),
    }
)  # fmt: skip
FEW = 4  # shards that are made again sooner in this process than a cluster starts
FEW_CLIPS = 64  # of which the same holds, where what their shards read of parts is no more than `FEW_BYTES`
FEW_BYTES = 16 << 20
NO_FAULT_OF_SHARDS = (*FULL, errno.EROFS)  # all of them would fail
LOAD_EVERY = 5.0  # seconds; what a killed run has done since its catalog was last served is done again


class Progress(Protocol):
    """Told of finished clips: (stage, done, all)."""

    def __call__(self, stage: str, done: int, total: int) -> None: ...


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


@dataclass
class Session:
    """One writing command on one lake.

    Attributes:
        progress: told of finished clips.
        notice: told, in one line, what a person should know while it runs.
        outcomes: by stage, in the order they ran.
    """

    lake: Lake
    config: LakeConfig
    progress: Progress
    notice: Callable[[str], None]
    workers: int | None = None
    scheduler: str | None = None
    outcomes: dict[str, Outcome] = field(default_factory=dict)
    started: datetime = field(default_factory=datetime.now)
    _stack: ExitStack = field(default_factory=ExitStack)
    _client: Client | None = None

    def client(self, shards: int, clips: int | None = None) -> Client:
        """The cluster: one of its own has a worker for each shard, up to `workers` (default: one a core, if there is
        memory for so many, and one for every `FEW_CLIPS` clips where it is known how many there are)."""
        from motionlake.jobs.cluster import cluster, grow  # Dask takes half a second to import

        cores = os.cpu_count() or 1
        worth = cores if clips is None else max(1, -(-clips // FEW_CLIPS))
        wanted = min(self.workers or min(memory.workers_that_fit(cores), worth), shards)
        if (
            self._client is None
            and self.scheduler is None
            and (told := memory.warning(self.workers, min(cores, shards)))
        ):
            self.notice(told)
        if self._client is None:
            self._client = self._stack.enter_context(cluster(self.lake, wanted, self.scheduler))
            if find_spec("bokeh"):  # without it Dask has no dashboard
                self.notice(f"dashboard of the workers: {self._client.dashboard_link}")
        elif self.scheduler is None:
            grow(self._client, wanted)
        return self._client

    def execute(
        self, stage: ShardStage, shards: Sequence[Shard], *, here: bool = False, at_once: bool = False
    ) -> Outcome:
        """Run shards, load results every few seconds in one transaction, or `at_once`; record failures and reasons.

        They run on the cluster, which starts if there are any; or `here`, in this process, one after the other. So do
        few clips where nobody asked for workers: the workers of a cluster take longer to start and to import what they
        need. Source files are left to workers, which one of them may end.
        """
        outcome = Outcome()
        if not shards:
            return outcome
        planned, shards = shards, with_inputs(self.lake, shards)
        client = (
            None if here or self._soon_done(stage, shards) else self.client(len(shards), sum(s.items for s in shards))
        )
        if stage.cut_is_kept:
            with writing(self.lake) as con:
                load_rows(con, "plan_shards", _planned(planned))
        if stage.reads_catalog and client is not None:
            serve(self.lake)
        total = sum(s.items for s in shards)
        self.progress(stage.name, 0, total)
        waiting: list[ShardResult] = []
        failures: list[tuple[Shard, str]] = []
        loaded_at, done, patience = time.monotonic(), 0, LOAD_EVERY
        root = self.lake.root
        running = run_here(root, stage, shards) if client is None else run_on(root, stage, shards, client)
        try:
            for shard, found in running:
                if isinstance(found, ShardResult):
                    waiting.append(found)
                elif isinstance(found, OSError) and found.errno in NO_FAULT_OF_SHARDS:
                    raise OSError(found.errno, found.strerror, found.filename or str(root))
                else:
                    failures.append((shard, typed(f"{type(found).__name__}: {found}").splitlines()[0][:500]))
                done += shard.items
                self.progress(stage.name, done, total)
                if waiting and not at_once and time.monotonic() - loaded_at > patience:
                    started, loading, waiting = time.monotonic(), waiting, []
                    outcome += _load(self.lake, stage, loading)
                    loaded_at = time.monotonic()
                    patience = max(LOAD_EVERY, 10 * (loaded_at - started))
        except BaseException:
            # A signal, a full disk or a lost cluster ends it: what is done stays, what failed is tried again.
            if not at_once:
                with suppress(Exception):
                    _load(self.lake, stage, waiting)
            raise
        outcome += _load(self.lake, stage, waiting, failures)
        return outcome

    def _soon_done(self, stage: ShardStage, shards: Sequence[Shard]) -> bool:
        """Whether shards are done sooner in this process than a cluster has started, which does not run yet."""
        if stage.cut_is_kept or (self.workers, self.scheduler, self._client) != (None, None, None):
            return False
        read = {
            file.file: file.size for shard in shards for file in shard.inputs if not file.file.startswith("models/")
        }
        few = sum(shard.items for shard in shards) <= FEW_CLIPS and sum(read.values()) <= FEW_BYTES
        return few or len(shards) == 1

    def remade(self, stage: ShardStage, shards: Sequence[Shard]) -> Iterator[tuple[Shard, ShardResult | BaseException]]:
        """Run shards for the files that they write, and load nothing: their rows are in the catalog."""
        total, done = sum(s.items for s in shards), 0
        if not shards:
            return
        root = self.lake.root
        few = len(shards) <= FEW
        run = run_here(root, stage, shards) if few else run_on(root, stage, shards, self.client(len(shards), total))
        for shard, found in run:
            done += shard.items
            self.progress(stage.name, done, total)
            yield shard, found


@contextmanager
def session(
    lake: Lake,
    command: str,
    progress: Progress,
    notice: Callable[[str], None],
    workers: int | None = None,
    scheduler: str | None = None,
    *,
    create: bool = False,
    damaged: bool = False,
) -> Iterator[Session]:
    """Hold the lake for one command.

    Args:
        lake: its folder.
        command: for people.
        progress: told of finished clips.
        notice: told what a person should know.
        workers: local processes.
        scheduler: of a running cluster.
        create: make it where there is none.
        damaged: go on where files of the lake are missing or damaged.

    Raises:
        UserError: another command writes to the lake, its config.toml is at fault, a file of it is missing or damaged,
            or there is no room to run in.
    """
    from motionlake.stages.registry import FOLDERS  # workers import this module, and one stage alone

    memory.check_addresses()
    config = load_config(lake.config_file)
    with locked(lake, command):
        if create and not lake.catalog.exists():
            create_catalog(lake)
        if not damaged:
            check_files(lake)
        for file, what in changed_settings(lake):
            notice(f"{lake.root / file}: {what}, since the last run")
        keep_settings(lake)
        collect_garbage(lake, FOLDERS)
        if not damaged:
            bring_macros(lake)
        try:
            with ExitStack() as stack, nullcontext() if damaged else deferred(lake):
                shared = SharedProgress(lake, progress)
                stack.callback(shared.end)
                yield Session(lake, config, shared, notice, workers, scheduler, _stack=stack)
        except BaseException:
            with suppress(Exception):  # what has gone wrong is told, not what came of it
                collect_garbage(lake, FOLDERS)
            raise
        collect_garbage(lake, FOLDERS)
        keep_records(lake)


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
            load_rows(con, "plan_shards", _planned([*(r.shard for r in ordered), *(shard for shard, _ in failures)]))
        if ordered:
            stage.load(con, lake.root, ordered)
        load_rows(con, "finish_shards", table_of(rows, FINISH_ROWS))
        list_files(con, [file for result in ordered for file in result.sums])
    return Outcome(
        ok=len(ordered), failed=len(failures), clips=sum(r.shard.items - r.rejected for r in ordered),
        rejected=sum(r.rejected for r in ordered), rows=sum(r.rows for r in ordered),
        bytes=sum(r.size for r in ordered), reason=failures[-1][1] if failures else "",
    )  # fmt: skip


def _planned(shards: Sequence[Shard]) -> pa.Table:
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
