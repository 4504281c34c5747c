"""What a service does beside answering: threads that end with the process, wherever they are."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, Final

NAME: Final = "motionlake-background"


def in_background(work: Callable[..., Any], *given: Any) -> None:
    """Start some work that nobody waits for."""
    threading.Thread(target=work, args=given, name=NAME, daemon=True).start()


def end_background(patience: float) -> bool:
    """Wait some seconds for what was started; whether all of it is done.

    Python may end while such a thread runs, but not while it is in a library such as DuckDB: that ends the process
    with an error of its own.
    """
    until = time.monotonic() + patience
    for thread in threading.enumerate():
        if thread.name == NAME:
            thread.join(max(0.0, until - time.monotonic()))
    return not any(thread.name == NAME for thread in threading.enumerate())
