"""How far a run is, for others to see: a small file in the lake, which is there while a command works in stages."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from motionlake.lake.layout import Lake
from motionlake.lake.lock import writes_now

_EVERY: Final = 0.5  # seconds between two writes
_LONGEST: Final = 4096


class SharedProgress:
    """Tells `told` what it is told of finished clips, and writes it down for others."""

    def __init__(self, lake: Lake, told: Callable[[str, int, int], None]) -> None:
        self._path, self._told = _file(lake), told
        self._wrote, self._stage, self._started = 0.0, "", 0.0

    def __call__(self, stage: str, done: int, total: int) -> None:
        self._told(stage, done, total)
        now = time.monotonic()
        if stage != self._stage:
            self._stage, self._started, self._wrote = stage, now, 0.0
        if now - self._wrote < _EVERY and done < total:
            return
        self._wrote = now
        left = (now - self._started) / done * (total - done) if done else None
        row = {"stage": stage, "done": done, "total": total, "seconds_left": None if left is None else round(left, 1)}
        with suppress(OSError):  # a run does not fail for want of a few bytes that only tell how far it is
            temporary = self._path.with_name(f"{self._path.name}.tmp")
            temporary.write_text(json.dumps(row), encoding="utf-8")
            temporary.replace(self._path)

    def end(self) -> None:
        """Remove the file."""
        with suppress(OSError):
            self._path.unlink(missing_ok=True)


def progress_now(lake: Lake) -> dict[str, Any] | None:
    """stage, clips done, total and seconds left of the run that writes to a lake now; None where none does."""
    if not writes_now(lake):
        return None
    try:
        with _file(lake).open("rb") as handle:
            row = json.loads(handle.read(_LONGEST))
        return {name: row[name] for name in ("stage", "done", "total", "seconds_left")}
    except (OSError, ValueError, KeyError, TypeError):
        return {"stage": "", "done": 0, "total": 0, "seconds_left": None}


def _file(lake: Lake) -> Path:
    return lake.root / ".progress"
