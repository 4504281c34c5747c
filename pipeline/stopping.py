"""Signals that end a command: Ctrl-C, SIGTERM, and SIGHUP where its terminal is closed.

The first of them raises `Stopped` in the main thread, or at the end of what is `held` there, so that nothing is left
half-made. The second ends the process at once.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Timer
from types import FrameType
from typing import Final

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
ONE: Final = 0.2  # seconds in which signals count as one: `timeout` and a terminal that closes send theirs twice
_SOON: Final = 0.01  # seconds
_HELD: Final = b"motionlake: ends as soon as what it writes is whole; a second signal ends it at once\n"


class Stopped(KeyboardInterrupt):
    """A signal has asked the command to end."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


@dataclass
class _State:
    """What is asked of this process, when, and how many blocks put it off."""

    asked: int | None = None
    at: float = 0.0
    raised: bool = False
    held: int = 0


_state = _State()


@contextmanager
def obeying() -> Iterator[None]:
    """Signals stop what this block does, in the main thread; those that are ignored, as under `nohup`, stay so."""
    global _state
    if not _in_main_thread():
        yield
        return
    _state = _State()
    before = {n: h for n in SIGNALS if (h := signal.getsignal(n)) not in (signal.SIG_IGN, None)}
    hook = sys.unraisablehook
    for number in before:
        signal.signal(number, _obey)
    sys.unraisablehook = lambda swallowed: _again() if isinstance(swallowed.exc_value, Stopped) else hook(swallowed)
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for number, handler in before.items():
            signal.signal(number, handler)


def end_at_once() -> None:
    """Have a signal end the process at once, by 128 and its number, before and after a block that is `obeying`: what
    the block did is done, and nobody is told that it was killed. Signals that are ignored stay so."""
    for number in SIGNALS:
        if signal.getsignal(number) not in (signal.SIG_IGN, None):
            signal.signal(number, _end_now)


def _end_now(number: int, _: FrameType | None) -> None:
    os._exit(128 + number)


@contextmanager
def held() -> Iterator[None]:
    """A block that is done whole: a signal waits for its end, which may be that it fails."""
    if not _in_main_thread():
        yield
        return
    _state.held += 1
    failed: Exception | None = None
    try:
        yield
    except Exception as error:
        failed = error
        raise
    finally:
        _state.held -= 1
        if asked() and not _state.held and not _state.raised:
            _raise(failed)


def asked() -> bool:
    """Whether a signal has asked this process to end."""
    return _state.asked is not None


def signal_asked() -> int | None:
    """The signal that has asked this process to end."""
    return _state.asked


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


def _obey(number: int, _: FrameType | None) -> None:
    now = time.monotonic()
    if asked():
        if now - _state.at > ONE:
            os._exit(128 + number)
        return
    _state.asked, _state.at = number, now
    if _state.held:
        os.write(2, _HELD)
    else:
        _raise()


def _again() -> None:
    """Ask once more, in a moment, where `Stopped` was raised in code whose exceptions Python drops, such as `__del__`
    and what is called at garbage collections."""
    number, _state.asked, _state.raised = _state.asked, None, False
    if number is not None:
        Timer(_SOON, signal.pthread_kill, (threading.main_thread().ident, number)).start()


def _raise(cause: Exception | None = None) -> None:
    _state.raised = True
    assert _state.asked is not None
    raise Stopped(_state.asked) from cause
