"""What a command does, a line of JSON an event, for programs that watch it: `motionlake --log-json FILE COMMAND`."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, TextIO

from motionlake.errors import UserError
from motionlake.names import typed

_EVERY: Final = 1.0  # seconds, at least, between two lines that tell how far a stage is
_log: TextIO | None = None
_spoke: Final[dict[str, float]] = {}


def log_to(file: Path) -> None:
    """Append the events of this command to a file, the first of which is that it begins.

    Raises:
        UserError: the file cannot be written.
    """
    global _log
    try:
        _log = file.open("a", buffering=1, encoding="utf-8")
    except OSError as error:
        raise UserError(f"--log-json {file}: {error.strerror}; name a file that can be written") from error
    event("begins", command=typed(" ".join(sys.argv[1:])))


def event(name: str, **fields: Any) -> None:
    """Add a line, where there is a log: the time (UTC), the event's name and its fields.

    A log that cannot be written any more says so once, and stops no command.
    """
    global _log
    if _log is None:
        return
    now = datetime.now(UTC).isoformat(timespec="milliseconds")
    try:
        _log.write(json.dumps({"time": now, "event": name, **fields}) + "\n")
    except OSError as error:
        print(f"--log-json {_log.name}: {error.strerror}; no more is logged", file=sys.stderr)
        with suppress(OSError):
            _log.close()
        _log = None


def stage_event(stage: str, done: int, total: int) -> None:
    """Tell how many clips of a stage are done: its beginning and its end, and between them once a second."""
    now = time.monotonic()
    if 0 < done < total and now - _spoke.get(stage, 0.0) < _EVERY:
        return
    _spoke[stage] = now
    event("progress", stage=stage, done=done, total=total)


@contextmanager
def ending() -> Iterator[None]:
    """Add how the command in this block ends, and close the log."""
    global _log
    status: Any = 0
    try:
        yield
    except SystemExit as end:
        status = end.code or 0
        raise
    finally:
        event("ends", status=status)
        if _log is not None:
            _log.close()
        _log = None
        _spoke.clear()
