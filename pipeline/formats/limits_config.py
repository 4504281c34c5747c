"""What one file may ask for: table [limits] of config.toml, and how readers keep to it.

Limits shape no result: they are part of no key. A file that one of them turned away says so in its reason, by which it
is known when that limit has been raised.
"""

from __future__ import annotations

import re
from contextlib import AbstractContextManager
from contextvars import ContextVar
from dataclasses import dataclass, fields
from typing import Final

from motionlake.errors import ClipError

MIB: Final = 2**20
# Measured over all formats (docs/measurements.md): what a frame costs from its reading to its place in the lake.
FRAME_BYTES: Final = 4096
JOINT_BYTES: Final = 256
# Larger numbers of a text file are damage: no recording turns a joint 2,000 times round or goes so many units.
MOST_DEGREES: Final = 1e6
FARTHEST: Final = 1e8
_NAMED: Final = re.compile(r"\[limits\] (\w+) = (\d+)")


@dataclass(frozen=True)
class Limits:
    """What one file may ask for.

    Attributes:
        file_megabytes: MiB of the file as it lies there, and of its content once decompressed.
        frames: of a body.
        joints: of a body, as the file has them.
        bodies: in a file.
        memory_megabytes: MiB that reading it is reckoned to take, by its size, frames and joints.
        seconds: that a worker reads and solves it; 0 is without end.
    """

    file_megabytes: int = 512
    frames: int = 1_000_000
    joints: int = 1_000
    bodies: int = 100
    memory_megabytes: int = 2_048
    seconds: int = 600

    def __post_init__(self) -> None:
        low = next((f.name for f in fields(self) if getattr(self, f.name) < (f.name != "seconds")), None)
        if low is not None:
            raise ValueError(
                f"{low} = {getattr(self, low)}: must be {'0 or more' if low == 'seconds' else '1 or more'}"
            )

    @property
    def file_bytes(self) -> int:
        return self.file_megabytes * MIB

    def check(self, name: str, asked: float, what: str, line: int | None = None) -> None:
        """Raise `LimitError` where a file asks for more than the limit of a name; `what` it asks for, for people."""
        if asked > getattr(self, name):
            raise LimitError(name, getattr(self, name), what, line)

    def check_memory(self, size: int, line: int | None = None) -> None:
        """The same for so many bytes of memory."""
        self.check("memory_megabytes", size / MIB, f"needs {size / MIB:.0f} MiB of memory", line)

    def check_body(self, frames: int, joints: int, size: int = 0, line: int | None = None) -> None:
        """The same for a body of so many frames and joints that is in `size` bytes, before room is made for it."""
        memory = size + frames * (FRAME_BYTES + JOINT_BYTES * joints)
        if joints <= self.joints and frames <= self.frames and memory <= self.memory_megabytes * MIB:
            return
        self.check("joints", joints, f"has {joints} joints", line)
        self.check("frames", frames, f"has {frames} frames", line)
        self.check_memory(memory, line)

    def most_frames(self, joints: int) -> int:
        """Frames of so many joints that `check_body` lets pass, and one more."""
        room = self.memory_megabytes * MIB // (FRAME_BYTES + JOINT_BYTES * joints)
        return min(self.frames, room) + 1


class LimitError(ClipError):
    """A file that asks for more than a limit allows; the reason names the limit and what it was."""

    def __init__(self, name: str, limit: int, what: str, line: int | None = None) -> None:
        super().__init__(f"{what}; [limits] {name} = {limit} in config.toml", line)


def raised(reason: str, limits: Limits) -> bool:
    """Whether a file that was turned away with such a reason was so by a limit that is higher now."""
    named = _NAMED.search(reason)
    now = getattr(limits, named[1], 0) if named else 0
    if named and named[1] == "seconds" and now == 0:
        return True
    return named is not None and now > int(named[2])


DEFAULT: Final = Limits()
_current: Final[ContextVar[Limits]] = ContextVar("limits", default=DEFAULT)


def limits() -> Limits:
    """Those that hold for the file that is being read."""
    return _current.get()


def within(chosen: Limits) -> AbstractContextManager[None]:
    """Have other limits hold."""
    return _Within(chosen)


class _Within(AbstractContextManager[None]):
    """Much of what a small file takes to read would be a generator's way in and out."""

    def __init__(self, chosen: Limits) -> None:
        self._chosen = chosen

    def __enter__(self) -> None:
        self._token = _current.set(self._chosen)

    def __exit__(self, *_: object) -> None:
        _current.reset(self._token)


TABLE: Final = "limits"
CONFIG: Final = Limits
