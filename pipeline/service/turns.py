"""Whose turn it is: most searches run alone, and some that do one another no harm run at once."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from threading import Lock, Semaphore
from typing import Final

from motionlake.service.errors import ServiceError

TOGETHER: Final = 2  # as many as keep two cores busy: more would only make one another late


class Turns:
    """Turns to search, in about the order in which they were asked for.

    Args:
        seconds: that one waits for a turn.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._door = Lock()  # whoever holds it is next, or searches alone
        self._seats = Semaphore(TOGETHER)

    @contextmanager
    def turn(self, *, alone: bool = True) -> Iterator[None]:
        """A turn, alone or beside others that need not be alone. Raises `ServiceError` where it does not come."""
        end = time.monotonic() + self._seconds
        with ExitStack() as held, ExitStack() as door:
            _take(self._door, end, door)
            for _ in range(TOGETHER if alone else 1):
                _take(self._seats, end, held)
            if not alone:
                door.close()
            yield


def _take(lock: Lock | Semaphore, end: float, held: ExitStack) -> None:
    if not lock.acquire(timeout=max(0.0, end - time.monotonic())):
        raise ServiceError(503, "others are searching; try again in a moment")
    held.callback(lock.release)
