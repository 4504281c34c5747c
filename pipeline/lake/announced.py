"""The service of a lake that runs on this machine: `service.json` in the lake says where it is asked.

It holds the token, so nobody but its owner may read it. A service that was killed leaves it: readers look whether the
process is there still, and since when the machine runs.
"""

from __future__ import annotations

import json
import os
import socket
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

from motionlake.lake.layout import Lake

_LONGEST: Final = 4096  # bytes that are read; what a service writes is shorter
_BOOT: Final = Path("/proc/sys/kernel/random/boot_id")
_NEAR: Final = frozenset(("127.0.0.1", "localhost", "::1"))


@dataclass(frozen=True)
class Announcement:
    """Where a service is asked.

    Attributes:
        host, port: on which it listens, of this machine.
        token: that requests bring.
        process: which it is.
        machine: this one, since it was started last.
    """

    host: str
    port: int
    token: str
    process: int
    machine: str

    @classmethod
    def of(cls, address: str, token: str) -> Announcement:
        """Of this process, which answers at an address such as "http://127.0.0.1:8765/"."""
        where = urlsplit(address)
        return cls(where.hostname or "", where.port or 80, token, os.getpid(), _machine())

    def lives(self) -> bool:
        """Whether the process may be there still, on this machine."""
        return self.machine == _machine() and _runs(self.process)


def _machine() -> str:
    with suppress(OSError):
        return f"{socket.gethostname()} {_BOOT.read_text(encoding='ascii').strip()}"
    return socket.gethostname()


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True  # of another user
    return True


@contextmanager
def announcing(lake: Lake, made: Announcement) -> Iterator[None]:
    """Say in the lake where its service is asked, until the block ends; a lake that is only read says nothing."""
    with suppress(OSError):
        _write(lake.service, json.dumps(asdict(made)))
    try:
        yield
    finally:
        with suppress(OSError):
            if _read(lake.service) == made:  # another service may have come since
                lake.service.unlink()


def announced(lake: Lake) -> Announcement | None:
    """The service of a lake that this user may ask; None where none is told of, or it is gone."""
    try:
        found = _read(lake.service)
    except OSError:
        return None
    return found if found is not None and found.lives() else None


def _write(path: Path, text: str) -> None:
    """Write a file that its owner alone can read, from its first moment on."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.unlink(missing_ok=True)
    try:
        handle = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o600)
        with os.fdopen(handle, "w", encoding="ascii") as file:
            file.write(text)
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def _read(path: Path) -> Announcement | None:
    """What a file says; None where this user did not write it, others can read it, or it is no announcement."""
    handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        told = os.fstat(handle)
        if not stat.S_ISREG(told.st_mode) or told.st_uid != os.geteuid() or told.st_mode & 0o077:
            return None
        found: Any = json.loads(os.read(handle, _LONGEST))
        made = Announcement(**found)
    except (ValueError, TypeError, RecursionError):
        return None
    finally:
        os.close(handle)
    words = (made.host, made.token, made.machine)
    plain = all(isinstance(word, str) and word.isascii() and word.isprintable() for word in words)
    numbers = all(type(number) is int and 0 < number < 1 << 31 for number in (made.port, made.process))
    near = plain and (made.host in _NEAR or made.host == socket.gethostname().lower())
    return made if plain and numbers and near and made.port < 1 << 16 else None
