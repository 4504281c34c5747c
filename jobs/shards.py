"""How shards run: in this process one after the other, or on a cluster; what of the lake each of them reads."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import nullcontext, suppress
from dataclasses import replace
from itertools import islice
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Final, cast

from motionlake.allocation import keep_freed
from motionlake.errors import DamagedError, UserError
from motionlake.lake.catalog import reading
from motionlake.lake.file_list import listed_in, sums_of
from motionlake.lake.integrity import bring, damage, fault, given
from motionlake.lake.layout import Lake
from motionlake.lake.named_files import frames_by_part, named_files
from motionlake.stages.file_watch import at_fault, replaceable
from motionlake.stages.part_clips import read_together
from motionlake.stages.stage import Shard, ShardResult, ShardStage
from motionlake.threads import limited

if TYPE_CHECKING:
    from distributed import Client, Future, Worker

Task = tuple[ShardStage, Shard]
Bundle = Sequence[Task]  # shards that run one after the other in one task
Ended = list[tuple[Task, "ShardResult | BaseException"]]  # a bundle with what came of each shard
Run = tuple[Callable[[Path, Shard], ShardResult], Shard]

AHEAD: Final = 16  # bundles submitted for each worker thread: work while results are loaded
AT_ONCE: Final = 2  # of them submitted before results are looked at again: what is done is entered soon
ASK_EVERY: Final = 1.0  # seconds between two questions how many threads there are
SOON: Final = 2.0  # seconds in which a worker that is there gives a result, or ends most shards
LOOK_AGAIN: Final = 0.05  # seconds


def run_here(root: Path, bundles: Iterable[Bundle]) -> Iterator[Ended]:
    """Bundles with what came of their shards, one after the other in this process."""
    for bundle in bundles:
        yield list(zip(bundle, _run_bundle(root, _runs(bundle)), strict=True))


class OnCluster:
    """Bundles as they finish, with a few a worker thread in the cluster's hands: its memory must not grow with them.

    Shards of one whose workers ended again and again run once more, each alone: it may have been another's fault.
    """

    def __init__(self, root: Path, bundles: Iterable[Bundle], client: Client) -> None:
        self._root, self._client, self._left = root, client, iter(bundles)
        self._threads = _Threads(client)
        self._running: dict[Future, Bundle] = {}

    def __iter__(self) -> Iterator[Ended]:
        from distributed import KilledWorker, as_completed

        killed: list[Bundle] = []
        pool = as_completed()
        pool.update(self._submitted())
        for future in pool:
            if future.cancelled():
                raise UserError(
                    "the Dask cluster does not answer any more; the same command goes on where this one stopped"
                )
            error = future.exception() if future.status != "finished" else None
            found = future.result() if error is None else None
            bundle = self._running.pop(future)
            if isinstance(error, KilledWorker):
                killed.append(bundle)
            else:
                yield list(zip(bundle, found or [error] * len(bundle), strict=True))
            future.release()
            pool.update(self._submitted())
        for bundle in killed:
            yield [(task, _alone(self._client, self._root, task)) for task in bundle]

    def _submitted(self) -> list[Future]:
        """A few more bundles, as many as the cluster is to have ahead."""
        count = self._threads.count()
        some = list(islice(self._left, max(0, min(AT_ONCE * count, AHEAD * count - len(self._running)))))
        futures = [_submit(self._client, self._root, bundle) for bundle in some]
        self._running |= dict(zip(futures, some, strict=True))
        return futures

    def finished(self) -> Iterator[Ended]:
        """Bundles that have ended and were not given out yet, for who stops: no other is waited for."""
        for future, bundle in self._running.items():
            if future.status == "finished":
                with suppress(Exception):  # its worker is gone
                    yield list(zip(bundle, future.result(timeout=SOON), strict=True))

    def give_up(self) -> None:
        """Take back what has not begun, and wait a moment for what runs: workers of another's cluster go on with it,
        and would leave a half-made file behind this command."""
        waiting = Thread(target=self._until_idle, daemon=True)  # a cluster that is gone may not answer
        waiting.start()
        waiting.join(SOON)

    def _until_idle(self) -> None:
        with suppress(Exception):
            self._client.cancel(list(self._running), force=True)
            while any(self._client.run(_runs_any, {future.key for future in self._running}).values()):
                time.sleep(LOOK_AGAIN)


def _runs_any(keys: set[str], dask_worker: Worker) -> bool:
    """Whether a worker runs one of these tasks, be it taken back."""
    return any(task.key in keys for task in dask_worker.state.executing)


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


def _runs(bundle: Bundle) -> list[Run]:
    return [(stage.run, shard) for stage, shard in bundle]


def _submit(client: Client, root: Path, bundle: Bundle, again: str = "") -> Future:
    names = "+".join(stage.name for stage, _ in bundle)
    return client.submit(_run_in_worker, root, _runs(bundle), key=f"{names}-{bundle[0][1].key}{again}", pure=False)


def _alone(client: Client, root: Path, task: Task) -> ShardResult | BaseException:
    """Run a shard whose workers ended, again as long as each time tells of one more file that is at fault."""
    from distributed import KilledWorker

    known: set[str] = set()
    while True:
        future = _submit(client, root, [task], f"-{len(known)}-at-fault")
        error: BaseException | None = future.exception()
        if error is None:
            (found,) = future.result()
            return cast("ShardResult | Exception", found)
        told = at_fault(root, task[1])
        if not isinstance(error, KilledWorker) or told <= known:
            return error
        known = told


def _run_in_worker(root: Path, runs: Sequence[Run]) -> list[ShardResult | Exception]:
    """Run shards in a worker of the cluster, which may end where its nanny starts another."""
    from distributed import get_worker

    keep_freed()
    replaceable.set(get_worker().nanny is not None)
    return _run_bundle(root, runs)


def _run_bundle(root: Path, runs: Sequence[Run]) -> list[ShardResult | Exception]:
    """What came of shards that run one after the other; several of one part read its clips once."""
    with read_together() if len(runs) > 1 else nullcontext():
        return [_tried(run, root, shard) for run, shard in runs]


def _tried(run: Callable[[Path, Shard], ShardResult], root: Path, shard: Shard) -> ShardResult | Exception:
    try:
        return _run_limited(run, root, shard)
    except Exception as error:
        return error


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


def clips_in(bundle: Bundle) -> int:
    """Clips that its shards are of: of one part."""
    return max(shard.items for _, shard in bundle)


def bundled(planned: Sequence[tuple[ShardStage, Sequence[Shard]]]) -> list[Bundle]:
    """Shards of one stage each by itself; of several, those of the same part together, in the order of the stages."""
    if len(planned) == 1:
        return [[(stage, shard)] for stage, shards in planned for shard in shards]
    bundles: dict[str, list[Task]] = {}
    for stage, shards in planned:
        for shard in shards:
            bundles.setdefault(shard.part, []).append((stage, shard))
    return list(bundles.values())


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
