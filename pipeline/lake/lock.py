"""One run at a time: an advisory lock on the lake, freed by the system when its holder dies."""

from __future__ import annotations

import fcntl
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
            text = handle.read()
            holder = f" ({text})" if text else ""
            raise UserError(
                f"{lake.root}: another run is using this lake{holder}; wait for it to end, then try again"
            ) from None
        handle.truncate(0)
        since = datetime.now().isoformat(timespec="seconds")
        handle.write(f"{command}, process {os.getpid()} on {socket.gethostname()}, since {since}")
        handle.flush()
        try:
            yield
        finally:
            handle.truncate(0)
