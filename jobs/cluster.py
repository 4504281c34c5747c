"""Where shards run: a local Dask cluster, or a running one that sees the lake's folder."""

from __future__ import annotations

import logging
import multiprocessing
import os
import sys
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import forkserver
from pathlib import Path

import dask
from distributed import Client, LocalCluster
from motionlake.errors import UserError
from motionlake.lake.layout import Lake

# Workers hold one shard a thread, and a shard's mathematics runs on that one thread.
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
# Workers are forks of a process without threads that has imported what each of them needs; macOS does not fork well.
_METHOD = "forkserver" if sys.platform == "linux" else "spawn"
_PRELOAD = ["distributed", "motionlake.jobs.session"]
_CONNECT = "10s"


@contextmanager
def cluster(lake: Lake, workers: int, scheduler: str | None = None) -> Iterator[Client]:
    """A Dask client: `workers` local processes, or the cluster at `scheduler`.

    Raises:
        UserError: the scheduler does not answer, has no workers, or a worker cannot see the lake's folder.
    """
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    settings = {
        "distributed.worker.multiprocessing-method": _METHOD,
        "distributed.nanny.pre-spawn-environ": _ONE_THREAD,
        "distributed.comm.timeouts.connect": _CONNECT,
        "distributed.scheduler.allowed-failures": 3,
        "distributed.worker.memory.terminate": False,
    }
    with dask.config.set(settings):
        if scheduler is None:
            _serve_forks()
            with (
                LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address="127.0.0.1:0") as local,
                Client(local) as client,
            ):
                yield client
            return
        try:
            client = Client(scheduler, timeout=_CONNECT)
        except (OSError, TimeoutError, ValueError) as error:
            raise UserError(f"--scheduler {scheduler}: no Dask scheduler answers there ({error})") from error
        with client:
            _check_workers(client, scheduler, lake)
            yield client


def _serve_forks() -> None:
    """Start the process that workers are forked of, unless it runs; Dask would, with less imported."""
    if _METHOD != "forkserver":
        return
    os.environ.update(_ONE_THREAD)  # as Dask does before it starts a worker
    safe = os.environ.get("PYTHONSAFEPATH", "")
    os.environ["PYTHONSAFEPATH"] = "1"  # modules in the folder where the command runs are not to be imported
    multiprocessing.set_forkserver_preload(_PRELOAD)
    forkserver.ensure_running()
    os.environ["PYTHONSAFEPATH"] = safe


def grow(client: Client, workers: int) -> None:
    """Have a local cluster start more workers, up to so many."""
    if len(client.cluster.worker_spec) < workers:
        client.cluster.scale(workers)
        client.wait_for_workers(workers)


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
