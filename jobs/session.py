"""What every job of one command shares: the lake, its configuration, and how shards are run and entered."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from datetime import datetime
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Protocol

from motionlake import memory
from motionlake.jobs.results import Outcome, Results, planned_rows
from motionlake.jobs.shards import Bundle, OnCluster, bundled, clips_in, run_here, with_inputs
from motionlake.lake.catalog import bring_macros, create_catalog, load_rows, writing
from motionlake.lake.config import LakeConfig, load_config
from motionlake.lake.garbage import collect_garbage
from motionlake.lake.integrity import check_files
from motionlake.lake.layout import Lake
from motionlake.lake.lock import locked
from motionlake.lake.records import keep_records
from motionlake.lake.run_progress import SharedProgress
from motionlake.lake.settings import changed_settings, keep_settings
from motionlake.lake.working import Version, deferred, serve, version
from motionlake.stages.reader import LakeReader, lake_reader
from motionlake.stages.stage import Shard, ShardResult, ShardStage

if TYPE_CHECKING:
    from distributed import Client

FEW = 4  # shards that are made again sooner in this process than a cluster starts
FEW_CLIPS = 64  # of which the same holds, where what their shards read of parts is no more than `FEW_BYTES`
FEW_BYTES = 16 << 20


class Progress(Protocol):
    """Told of finished clips: (stage, done, all)."""

    def __call__(self, stage: str, done: int, total: int) -> None: ...


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
    _version: Version | None = None
    _found: dict[tuple[str, str], Any] = field(default_factory=dict)

    @contextmanager
    def reader(self) -> Iterator[LakeReader]:
        """The lake to plan on. What was found in it stands until this command writes: no other may meanwhile."""
        now = version(self.lake)
        if now != self._version:
            self._version, self._found = now, {}
        with lake_reader(self.lake, self.config, self._found) as at:
            yield at

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
        """`execute_together` for one stage."""
        return self.execute_together([(stage, shards)], here=here, at_once=[stage.name] * at_once)[stage.name]

    def execute_together(
        self,
        planned: Sequence[tuple[ShardStage, Sequence[Shard]]],
        *,
        here: bool = False,
        at_once: Collection[str] = (),
    ) -> dict[str, Outcome]:
        """Run shards of stages, those of one part in one task, and load results every few seconds in a transaction a
        stage, of the stages `at_once` at the end; record failures and reasons.

        They run on the cluster, which starts if there are any; or `here`, in this process, one after the other. So do
        few clips where nobody asked for workers: the workers of a cluster take longer to start and to import what they
        need. Source files are left to workers, which one of them may end.
        """
        outcomes = {stage.name: Outcome() for stage, _ in planned}
        entered = [(stage, shards) for stage, shards in planned if shards]
        bundles = bundled([(stage, with_inputs(self.lake, shards)) for stage, shards in entered])
        if not bundles:
            return outcomes
        total = sum(clips_in(bundle) for bundle in bundles)
        client = None if here or self._soon_done(bundles, total) else self.client(len(bundles), total)
        for stage, shards in entered:
            if stage.cut_is_kept:
                with writing(self.lake) as con:
                    load_rows(con, "plan_shards", planned_rows(shards))
        if client is not None and any(stage.reads_catalog for stage, _ in entered):
            serve(self.lake)
        results = Results(self.lake, [stage for stage, _ in entered], outcomes, at_once)
        name, done = ", ".join(stage.name for stage, _ in entered), 0
        self.progress(name, 0, total)
        root = self.lake.root
        on_cluster = None if client is None else OnCluster(root, bundles, client)
        try:
            for ended in on_cluster or run_here(root, bundles):
                results.add(ended)
                done += clips_in([task for task, _ in ended])
                self.progress(name, done, total)
                results.load_now_and_then()
        except BaseException:
            # A signal, a full disk or a lost cluster ends it: what is done stays, what failed is tried again.
            with suppress(Exception):
                for ended in on_cluster.finished() if on_cluster else ():
                    results.add(ended)
            with suppress(Exception):
                results.load_done()
            if on_cluster is not None and self.scheduler is not None:
                on_cluster.give_up()
            raise
        results.load_all()
        return outcomes

    def _soon_done(self, bundles: Sequence[Bundle], clips: int) -> bool:
        """Whether shards are done sooner in this process than a cluster has started, which does not run yet."""
        if (self.workers, self.scheduler, self._client) != (None, None, None):
            return False
        tasks = [task for bundle in bundles for task in bundle]
        if any(stage.cut_is_kept for stage, _ in tasks):
            return False
        read = {
            file.file: file.size for _, shard in tasks for file in shard.inputs if not file.file.startswith("models/")
        }
        few = clips <= FEW_CLIPS and sum(read.values()) <= FEW_BYTES
        return few or len(bundles) == 1

    def remade(self, stage: ShardStage, shards: Sequence[Shard]) -> Iterator[tuple[Shard, ShardResult | BaseException]]:
        """Run shards for the files that they write, and load nothing: their rows are in the catalog."""
        total, done = sum(s.items for s in shards), 0
        if not shards:
            return
        root = self.lake.root
        few, bundles = len(shards) <= FEW, bundled([(stage, shards)])
        run = run_here(root, bundles) if few else OnCluster(root, bundles, self.client(len(shards), total))
        for (((_, shard), found),) in run:
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
        before = version(lake)
        try:
            with ExitStack() as stack, nullcontext() if damaged else deferred(lake):
                shared = SharedProgress(lake, progress)
                stack.callback(shared.end)
                yield Session(lake, config, shared, notice, workers, scheduler, _stack=stack)
        except BaseException:
            with suppress(Exception):  # what has gone wrong is told, not what came of it
                collect_garbage(lake, FOLDERS)
            raise
        if version(lake) != before:  # nothing is left behind without being entered, be it as failed
            collect_garbage(lake, FOLDERS)
        keep_records(lake)
