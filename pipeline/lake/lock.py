"""Who writes and who reads: advisory locks, which the system frees when their holder dies.

One command writes at a time: it holds `.lock`, in which it says who it is. Readers share a lock of the folder itself,
which needs no file and no right to write; files that no catalog names any more stay while there are any.
"""

from __future__ import annotations

import fcntl
import json
import os
import socket
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Final

from motionlake.errors import UserError, explained, user_name
from motionlake.lake.layout import Lake

_LONGEST: Final = 4096  # bytes that are read of a lock file; what a command writes there is shorter
_PATIENCE: Final = 0.5  # seconds for a command that has just taken the lock to say who it is
_DELETING: Final = 1.0  # seconds that a reader gives a command which is deleting files; then it goes on unseen


@dataclass(frozen=True)
class Holder:
    """A command that writes."""

    command: str
    process: int
    user: str
    host: str
    since: str

    @classmethod
    def here(cls, command: str) -> Holder:
        now = datetime.now().isoformat(sep=" ", timespec="seconds")
        return cls(command, os.getpid(), user_name(os.geteuid()), socket.gethostname(), now)

    @classmethod
    def read(cls, handle: int) -> Holder | None:
        """What a lock file says; None where that is nothing that a command would write there."""
        try:
            found: Any = json.loads(os.pread(handle, _LONGEST, 0))
            holder = cls(**found)
        except (OSError, ValueError, TypeError, RecursionError):
            return None
        words = (holder.command, holder.user, holder.host, holder.since)
        plain = all(isinstance(word, str) and 0 < len(word) <= 200 and word.isprintable() for word in words)
        return holder if plain and type(holder.process) is int and 0 < holder.process < 1 << 31 else None

    def lives(self) -> bool:
        """Whether it may be there still: one that was killed leaves what it wrote."""
        return self.host != socket.gethostname() or Path(f"/proc/{self.process}").exists()

    def told(self) -> str:
        how = f"with `kill {self.process}`" if self.host == socket.gethostname() else f"on {self.host}"
        return (
            f"{self.command}, process {self.process} of {self.user} on {self.host}, since {self.since}; "
            f"wait for it to end, or stop it {how}, then try again"
        )


@contextmanager
def locked(lake: Lake, command: str) -> Iterator[None]:
    """Hold the lake for writing; its folder is made if it is not there.

    Raises:
        UserError: another command holds it, by name; the lock file cannot be opened or locked.
    """
    lake.root.mkdir(parents=True, exist_ok=True)
    path = lake.root / ".lock"
    handle = _opened(path)
    try:
        _take(handle, lake, path)
        with suppress(OSError):  # on a full disk it is held without a word
            os.ftruncate(handle, 0)
            os.pwrite(handle, json.dumps(asdict(Holder.here(command))).encode(), 0)
        try:
            yield
        finally:
            with suppress(OSError):
                os.ftruncate(handle, 0)
    finally:
        os.close(handle)


def writes_now(lake: Lake) -> bool:
    """Whether a command says that it writes to the lake, and lives; without waiting for it, nor in its way."""
    try:
        handle = os.open(lake.root / ".lock", os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        holder = Holder.read(handle)
    finally:
        os.close(handle)
    return holder is not None and holder.lives()


def _opened(path: Path) -> int:
    """The lock file, and no other one that a link leads to."""
    try:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, 0o666)
    except OSError as error:
        raise UserError(f"{explained(error, path)}; a command that writes to a lake needs its lock file") from error
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise UserError(f"{path}: is no plain file; remove it, and the next command makes it anew")
    return handle


def _take(handle: int, lake: Lake, path: Path) -> None:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        holder, until = Holder.read(handle), time.monotonic() + _PATIENCE
        while (holder is None or not holder.lives()) and time.monotonic() < until:
            time.sleep(0.02)
            holder = Holder.read(handle)
        told = (
            f"another program, which {path.name} does not name; wait for it to end (`lsof {path}` may tell which it is)"
            if holder is None
            else holder.told()
        )
        raise UserError(f"{lake.root}: the lake is being written by {told}") from None
    except OSError as error:
        raise UserError(
            f"{path}: cannot be locked ({error.strerror}): its file system has no locks; keep the lake on a local disk "
            "or on NFS 4"
        ) from error


def share(lake: Lake) -> int | None:
    """Be seen to read, until the handle is closed; None where that cannot be: on some network file systems."""
    try:
        handle = os.open(lake.root, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError:
        return None
    until = time.monotonic() + _DELETING
    while True:
        try:
            fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() < until:
                time.sleep(0.005)
                continue
        except OSError:
            pass
        else:
            return handle
        os.close(handle)
        return None


@contextmanager
def unread(lake: Lake) -> Iterator[bool]:
    """Whether nobody reads the lake; then nobody begins to while the block lasts (a moment: readers wait for it)."""
    handle = os.open(lake.root, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
            return
        except OSError:
            pass  # a file system without such locks
        yield True
    finally:
        os.close(handle)
