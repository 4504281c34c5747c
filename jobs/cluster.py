"""Where shards run: a local Dask cluster, or a running one that sees the lake's folder."""

from __future__ import annotations

import json
import logging
import multiprocessing
import os
import signal
import sys
import uuid
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import forkserver, resource_tracker
from pathlib import Path
from threading import Event, Thread

import dask
from distributed import Client, LocalCluster
from distributed.client import AllExit
from distributed.gc import disable_gc_diagnosis
from motionlake.errors import UserError
from motionlake.lake.layout import Lake
from motionlake.stopping import asked, held

# Workers hold one shard a thread, and a shard's mathematics runs on that one thread.
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
# Workers are forks of a process without threads that has imported what each of them needs; macOS does not fork well.
_METHOD = "forkserver" if sys.platform == "linux" else "spawn"
_PRELOAD = ["distributed", "motionlake.jobs.session"]
_CONNECT = "10s"
_GROW = 30  # seconds
_STARTS = 3  # of local workers, where one was killed before it was ready
_LOOK_AGAIN = 5.0  # seconds
# A worker that Dask finds near its share of memory takes no more shards; with networks loaded it never falls below.
_UNWATCHED = 0


@contextmanager
def cluster(lake: Lake, workers: int, scheduler: str | None = None) -> Iterator[Client]:
    """A Dask client: `workers` local processes, or the cluster at `scheduler`.

    Raises:
        UserError: the scheduler does not answer, has no workers, or a worker cannot see the lake's folder.
    """
    for name in ("distributed", "distributed.client"):  # Dask gives both a level of their own
        logging.getLogger(name).setLevel(logging.CRITICAL)
    logging.getLogger("asyncio").addFilter(_is_told)
    settings = {
        "distributed.worker.multiprocessing-method": _METHOD,
        "distributed.nanny.pre-spawn-environ": _ONE_THREAD,
        "distributed.comm.timeouts.connect": _CONNECT,
        "distributed.scheduler.allowed-failures": 3,
        "distributed.worker.memory.terminate": False,
        "distributed.worker.profile.enabled": False,  # it takes a tenth of a worker's time
    }
    with dask.config.set(settings):
        if scheduler is None:
            with ExitStack() as stack:
                with held():
                    local = stack.enter_context(_started(workers))
                    stack.enter_context(_kept(local))
                    client = stack.enter_context(Client(local))
                yield client
            return
        try:
            client = Client(_address(scheduler), timeout=_CONNECT)
        except (OSError, TimeoutError, ValueError) as error:
            raise UserError(f"--scheduler {scheduler}: no Dask scheduler answers there ({error})") from error
        with client:
            _check_workers(client, scheduler, lake)
            yield client


def _is_told(record: logging.LogRecord) -> bool:
    """Whether a log shows it: not how Dask leaves off waiting for shards, which a stopped command may make an error."""
    return not (record.exc_info and record.exc_info[0] is AllExit)


def _address(scheduler: str) -> str:
    """The address of a scheduler, which may be named by the file that it wrote (`dask scheduler --scheduler-file`).

    Raises:
        UserError: there is no such file, or no scheduler wrote it.
    """
    file = Path(scheduler)
    if file.suffix != ".json" and not file.is_file():
        return scheduler
    try:
        return str(json.loads(file.read_text(encoding="utf-8"))["address"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        said = error.strerror if isinstance(error, OSError) else "it holds no address of a scheduler"
        raise UserError(f"--scheduler-file {scheduler}: {said}; give the file that the Dask scheduler wrote") from error


def _started(workers: int) -> LocalCluster:
    """A cluster of its own. Raises `UserError` where workers will not start."""
    for _ in range(_STARTS):
        _serve_forks()
        try:
            local = LocalCluster(
                n_workers=workers, threads_per_worker=1, dashboard_address="127.0.0.1:0",
                memory_limit=_UNWATCHED, silence_logs=logging.CRITICAL,
            )  # fmt: skip
        except (OSError, RuntimeError) as error:
            reason = str(error).splitlines()[0]
        else:
            disable_gc_diagnosis()  # a signal in its midst would make it fail at the next collection
            return local
        if asked():  # what killed them, by a signal to the whole group, is to end the driver too
            break
    raise UserError(
        f"no worker processes could be started ({reason}); were they killed, for want of memory? Try --workers 1"
    )


@contextmanager
def _kept(local: LocalCluster) -> Iterator[None]:
    """Have workers started that are missing: Dask gives up one that takes 15 s to be back, as on a busy machine."""
    stopped = Event()

    def keep() -> None:
        while not stopped.wait(_LOOK_AGAIN):
            local.loop.add_callback(local._correct_state)  # what `scale` ends with

    Thread(target=keep, daemon=True).start()
    try:
        yield
    finally:
        stopped.set()


def _serve_forks() -> None:
    """Start the process that workers are forked of, unless it runs; Dask would, with less imported."""
    if _METHOD != "forkserver":
        return
    os.environ.update(_ONE_THREAD)  # as Dask does before it starts a worker
    # Modules in the folder where the command runs are not to be imported, nor where Dask starts that process again.
    os.environ["PYTHONSAFEPATH"] = "1"
    multiprocessing.set_forkserver_preload(_PRELOAD)
    # Terminals send Ctrl-C and their end to these processes too, where the driver alone is to obey.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGHUP,))
    resource_tracker.ensure_running()  # it lets Ctrl-C through again
    signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
    forkserver.ensure_running()
    signal.pthread_sigmask(signal.SIG_SETMASK, before)


def grow(client: Client, workers: int) -> None:
    """Have a local cluster start more workers, up to so many."""
    if len(client.cluster.worker_spec) < workers:
        client.cluster.scale(workers)
        with suppress(TimeoutError):  # those that are there do the work of one that was killed as it started
            client.wait_for_workers(workers, timeout=_GROW)


def _check_workers(client: Client, scheduler: str, lake: Lake) -> None:
    try:
        client.wait_for_workers(1, timeout=30)
    except TimeoutError:
        raise UserError(f"--scheduler {scheduler}: it has no workers; start some with `dask worker`") from None
    token = uuid.uuid4().hex
    probe = lake.root / f".probe-{token}"
    probe.write_text(token, encoding="utf-8")
    try:
        seen = client.run(_sees, str(probe), token)
    except ImportError as error:
        raise UserError(f"--scheduler {scheduler}: motionlake is not installed on its workers ({error})") from error
    finally:
        probe.unlink(missing_ok=True)
    blind = sorted(address for address, sees in seen.items() if not sees)
    if blind:
        raise UserError(
            f"--scheduler {scheduler}: worker {blind[0]} cannot see the lake's folder {lake.root} "
            f"({len(blind)} of {len(seen)} workers); put the lake on storage that all of them share"
        )


def _sees(probe: str, token: str) -> bool:
    try:
        return Path(probe).read_text(encoding="utf-8") == token
    except OSError:
        return False
