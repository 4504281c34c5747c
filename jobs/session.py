"""What every job of one command shares: the lake, its configuration, a cluster started when first needed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from typing import TYPE_CHECKING

from motionlake.jobs.execute import Outcome, Progress, execute
from motionlake.lake.catalog import collect_garbage
from motionlake.lake.config import LakeConfig, load_config
from motionlake.lake.layout import Lake
from motionlake.lake.lock import locked
from motionlake.stages.registry import FOLDERS
from motionlake.stages.stage import Shard, ShardStage

if TYPE_CHECKING:
    from distributed import Client


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

    @property
    def client(self) -> Client:
        if self._client is None:
            from motionlake.jobs.cluster import cluster  # Dask takes half a second to import

            self._client = self._stack.enter_context(cluster(self.lake, self.workers, self.scheduler))
        return self._client

    def execute(
        self, stage: ShardStage, shards: Sequence[Shard], *, here: bool = False, at_once: bool = False
    ) -> Outcome:
        """Run shards on the cluster, which starts if there are any; `here`: in this process."""
        client = None if here or not shards else self.client
        return execute(self.lake, stage, shards, client, self.progress, at_once=at_once)


@contextmanager
def session(
    lake: Lake,
    command: str,
    progress: Progress,
    notice: Callable[[str], None],
    workers: int | None = None,
    scheduler: str | None = None,
) -> Iterator[Session]:
    """Hold the lake for one command.

    Raises:
        UserError: another run holds the lake, or its config.toml is at fault.
    """
    config = load_config(lake.config_file)
    with locked(lake, command), ExitStack() as stack:
        collect_garbage(lake, FOLDERS)
        yield Session(lake, config, progress, notice, workers, scheduler, _stack=stack)
        collect_garbage(lake, FOLDERS)
