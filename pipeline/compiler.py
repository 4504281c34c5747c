"""The compilers of kernels: numba's, with the kernels on disk read and written by one process at a time.

numba keeps a kernel in several files that belong together. Two processes that compile it at once would each write some
of them, and from then on every process that calls it crashes.
"""

from __future__ import annotations

import os
import time
from contextlib import suppress
from pathlib import Path
from threading import RLock
from typing import Final

from numba import guvectorize, njit
from numba.core import event
from numba.np import linalg

__all__ = ["guvectorize", "njit"]

_PATIENCE: Final = 60.0  # seconds; a process that was stopped while it compiled holds up no other for good
_PAUSE: Final = 0.01  # seconds


class _OneProcess(event.Listener):  # type: ignore[misc]
    """Holds a lock between processes while numba holds its own between threads: from the look for a kernel on disk
    until it is compiled and written there."""

    def __init__(self) -> None:
        self._thread, self._depth, self._file = RLock(), 0, -1

    def on_start(self, event: event.Event) -> None:
        self._thread.acquire()
        try:
            if self._depth == 0:
                self._file = _locked(Path(__file__))
        except BaseException:  # a signal, while it waits
            self._thread.release()
            raise
        self._depth += 1

    def on_end(self, event: event.Event) -> None:
        self._depth -= 1
        if self._depth == 0 and self._file >= 0:
            _unlock(self._file)
            self._file = -1
        self._thread.release()


def _locked(path: Path) -> int:
    """A descriptor of a file that is locked; -1 where the system cannot, or another holds it for too long."""
    try:
        import fcntl
    except ImportError:  # Windows
        return -1
    try:
        file = os.open(path, os.O_RDONLY)
    except OSError:
        return -1
    until = time.monotonic() + _PATIENCE
    try:
        while time.monotonic() < until:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                time.sleep(_PAUSE)
            else:
                return file
    except OSError:  # a file system without locks
        pass
    except BaseException:
        os.close(file)
        raise
    os.close(file)
    return -1


def _unlock(file: int) -> None:
    """Give up a lock, also where a process forked meanwhile has the file open."""
    import fcntl

    with suppress(OSError):
        fcntl.flock(file, fcntl.LOCK_UN)
    os.close(file)


def _without_blas() -> None:
    """Have numba load its functions of arrays without importing scipy.linalg, which takes longer than all of them.

    It only asks whether BLAS is there, and asks again where a kernel multiplies matrices.
    """
    asked, linalg.ensure_blas = linalg.ensure_blas, lambda: None
    try:
        import numba.np.arraymath  # noqa: F401
    finally:
        linalg.ensure_blas = asked


event.register("numba:compiler_lock", _OneProcess())
_without_blas()
