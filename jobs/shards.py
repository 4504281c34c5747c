"""How shards run: in this process one after the other, or on a cluster; what of the lake each of them reads."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Final

from motionlake.allocation import keep_freed
from motionlake.errors import DamagedError, UserError
from motionlake.lake.catalog import reading
from motionlake.lake.integrity import bring, damage, fault, frames_by_part, given, listed_in, named_files, sums_of
from motionlake.lake.layout import Lake
from motionlake.stages.file_watch import at_fault, replaceable
from motionlake.stages.stage import Shard, ShardResult, ShardStage
from motionlake.threads import limited

if TYPE_CHECKING:
    from distributed import Client, Future

AHEAD: Final = 16  # shards submitted for each worker thread: work while results are loaded
ASK_EVERY: Final = 1.0
AT_ONCE: Final = 2  # of them submitted before results are looked at again: what is done is entered soon


def run_here(root: Path, stage: ShardStage, shards: Sequence[Shard]) -> Iterator[tuple[Shard, ShardResult | Exception]]:
    """Shards with what came of them, one after the other in this process."""
    for shard in shards:
        try:
            yield shard, _run_limited(stage.run, root, shard)
        except Exception as error:
            yield shard, error


def run_on(
    root: Path, stage: ShardStage, shards: Sequence[Shard], client: Client
) -> Iterator[tuple[Shard, ShardResult | BaseException]]:
    """Shards as they finish, with a few a worker thread in the cluster's hands: its memory must not grow with them.

    One whose workers ended again and again runs once more, alone: it may have been another's fault.
    """
    from distributed import KilledWorker, as_completed

    killed: list[Shard] = []
    running: dict[Future, Shard] = {}
    pool = as_completed()
    left = iter(shards)
    threads = _Threads(client)

    def submit() -> None:
        count = threads.count()
        for shard in islice(left, max(0, min(AT_ONCE * count, AHEAD * count - len(running)))):
            future = _submit(client, stage, root, shard)
            running[future] = shard
            pool.add(future)

    submit()
    for future in pool:
        if future.cancelled():
            raise UserError(
                "the Dask cluster does not answer any more; the same command goes on where this one stopped"
            )
        error = future.exception() if future.status != "finished" else None
        shard = running.pop(future)
        if isinstance(error, KilledWorker):
            killed.append(shard)
        else:
            yield shard, future.result() if error is None else error
        future.release()
        submit()
    for shard in killed:
        yield shard, _alone(client, stage, root, shard)


class _Threads:
    """Threads of a cluster's workers, which come and go: the scheduler is asked once in `ASK_EVERY` seconds."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._count, self._until = 1, 0.0

    def count(self) -> int:
        """At least one."""
        if time.monotonic() >= self._until:
            self._count = max(1, sum(self._client.nthreads().values()))
            self._until = time.monotonic() + ASK_EVERY
        return self._count


def _submit(client: Client, stage: ShardStage, root: Path, shard: Shard, again: str = "") -> Future:
    key = f"{stage.name}-{shard.key}{again}"
    return client.submit(_run_in_worker, stage.run, root, shard, key=key, pure=False)


def _alone(client: Client, stage: ShardStage, root: Path, shard: Shard) -> ShardResult | BaseException:
    """Run a shard whose workers ended, again as long as each time tells of one more file that is at fault."""
    from distributed import KilledWorker

    known: set[str] = set()
    while True:
        future = _submit(client, stage, root, shard, f"-{len(known)}-at-fault")
        error: BaseException | None = future.exception()
        if error is None:
            result: ShardResult = future.result()
            return result
        told = at_fault(root, shard)
        if not isinstance(error, KilledWorker) or told <= known:
            return error
        known = told


def _run_in_worker(run: Callable[[Path, Shard], ShardResult], root: Path, shard: Shard) -> ShardResult:
    """Run a shard in a worker of the cluster, which may end where its nanny starts another."""
    from distributed import get_worker

    keep_freed()
    replaceable.set(get_worker().nanny is not None)
    return _run_limited(run, root, shard)


def _run_limited(run: Callable[[Path, Shard], ShardResult], root: Path, shard: Shard) -> ShardResult:
    """Within one worker thread: BLAS and OpenMP on that thread, so that results do not depend on the machine.

    Raises:
        DamagedError: a file that the shard reads is not as it was written.
    """
    lake = Lake(root)
    for file in shard.inputs:
        wrong = fault(lake, file)
        if wrong is not None:
            raise DamagedError(damage(lake, file.file, wrong))
    with limited(1), given(shard.inputs):
        result = run(root, shard)
    known = {one.file: one for one in result.sums}  # of files that were there before
    return replace(result, sums=tuple(known.get(file) or sums_of(lake, file) for file in result.files))


def with_inputs(lake: Lake, shards: Sequence[Shard]) -> list[Shard]:
    """Shards with the files that they read: those of the lake that they name, fetched where they are lacking."""
    with reading(lake) as con:
        listed = listed_in(con)
    by_part = frames_by_part(listed)
    found = []
    for shard in shards:
        names = named_files(listed, by_part, [shard.part, shard.spec])
        found.append(replace(shard, inputs=tuple(listed[name] for name in sorted(names))))
    bring(lake, {file.file: file for shard in found for file in shard.inputs}.values())
    return found
