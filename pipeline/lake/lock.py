"""One run at a time: an advisory lock on the lake, freed by the system when its holder dies."""

from __future__ import annotations

import fcntl
import json
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime

from motionlake.errors import UserError
from motionlake.lake.layout import Lake


@contextmanager
def locked(lake: Lake, command: str) -> Iterator[None]:
    """Hold the lake for writing. Raises `UserError` naming the holder if another run has it."""
    with (lake.root / ".lock").open("a+", encoding="utf-8") as handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            handle.seek(0)
            raise UserError(f"{lake.root}: {_holder(handle.read())}; wait for it to end, then try again") from None
        handle.truncate(0)
        holder = {
            "pid": os.getpid(),
            "host": socket.gethostname(),
            "command": command,
            "since": datetime.now().isoformat(timespec="seconds"),
        }
        handle.write(json.dumps(holder))
        handle.flush()
        try:
            yield
        finally:
            handle.truncate(0)


def _holder(text: str) -> str:
    try:
        holder = json.loads(text)
    except ValueError:
        return "another run is using this lake"
    return (
        f"another run is using this lake ({holder['command']}, process {holder['pid']} on {holder['host']}, "
        f"since {holder['since']})"
    )
