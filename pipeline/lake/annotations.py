"""What people decided about clips: tags, labels, segments, verdicts on what was suggested. Their own layer of a lake.

A log of lines of JSON, `annotations.jsonl`, which no stage, ingest or run touches: what is entered or taken back is one
more line. A transaction of the catalog copies all of it, gigabytes in a large lake, which a click must not wait for.
"""

from __future__ import annotations

import fcntl
import json
import os
import uuid
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from threading import Lock
from typing import Any, Final

from motionlake.errors import UserError, explained
from motionlake.lake.layout import Lake
from motionlake.names import printable

KINDS: Final = ("tag", "label", "segment", "accept", "reject", "duplicate", "fault")
LONGEST: Final = 1000  # characters of a value


@dataclass(frozen=True)
class Annotation:
    """What a person decided about a clip, or frames [start, stop) of it at its own rate.

    Attributes:
        id: of no other one.
        clip: by its full name; it may have left the lake, and come back.
        kind: of `KINDS`.
        value: the tag, label or what else was decided.
        start, stop: None: the whole clip.
        who: decided it.
        made_at: when, ISO 8601, UTC.
        undone_at: when it was taken back; None: it holds.
    """

    id: str
    clip: str
    kind: str
    value: str
    start: int | None
    stop: int | None
    who: str
    made_at: str
    undone_at: str | None = None

    def as_row(self) -> dict[str, Any]:
        """For JSON: its range is called from and to, as everywhere over HTTP."""
        row = asdict(self)
        row["from"], row["to"] = row.pop("start"), row.pop("stop")
        return row


def new_annotation(
    clip: str, kind: str, value: str, start: int | None = None, stop: int | None = None, who: str = ""
) -> Annotation:
    """One that is made now.

    Raises:
        UserError: there is no such kind, the value is empty or too long, or frames are no range.
    """
    if kind not in KINDS:
        raise UserError(f"annotation: its kind is one of {', '.join(KINDS)}, not {kind[:40]}")
    if not value.strip() or len(value) > LONGEST or len(who) > LONGEST:
        raise UserError(f"annotation: its value has 1 to {LONGEST} characters, and its person's name as many at most")
    if (start is None) != (stop is None) or (start is not None and stop is not None and not 0 <= start < stop):
        raise UserError(f"annotation: frames {start} to {stop} are no range")
    if kind == "segment" and start is None:
        raise UserError("annotation: a segment has a first frame and one after its last")
    return Annotation(uuid.uuid4().hex, clip, kind, value.strip(), start, stop, who, _now())


class Annotations:
    """The annotations of a lake, read again where somebody else has entered some."""

    def __init__(self, lake: Lake) -> None:
        self.path: Path = lake.annotations
        self._lock = Lock()
        self._seen: tuple[int, int] | None = None  # file and bytes of it that were read
        self._known: dict[str, Annotation] = {}

    def all(self) -> list[Annotation]:
        """Every annotation in the order in which they were made, those that were taken back too.

        Raises:
            UserError: the file cannot be read.
        """
        with self._lock:
            self._read()
            return list(self._known.values())

    def current(self, clip: str | None = None, kind: str | None = None) -> list[Annotation]:
        """Those that hold, of a clip and of a kind."""
        return [
            each
            for each in self.all()
            if each.undone_at is None and clip in (None, each.clip) and kind in (None, each.kind)
        ]

    def tags(self) -> dict[str, set[str]]:
        """The tags of every clip that has some."""
        found: dict[str, set[str]] = {}
        for each in self.current(kind="tag"):
            found.setdefault(each.clip, set()).add(each.value)
        return found

    def add(self, new: Sequence[Annotation]) -> None:
        """Enter annotations, all or none. Raises `UserError` where they cannot be written."""
        self._append([asdict(each) for each in new])

    def undo(self, ids: Sequence[str]) -> None:
        """Take annotations back; they stay in the file.

        Raises:
            UserError: there is none of such an id, or it was taken back already.
        """
        with self._lock:
            self._read()
            for each in ids:
                if each not in self._known or self._known[each].undone_at is not None:
                    raise UserError(f"annotation {each[:40]}: there is none, or it was taken back already")
        self._append([{"undo": each, "undone_at": _now()} for each in ids])

    def _append(self, rows: Sequence[dict[str, Any]]) -> None:
        text = "".join(json.dumps(row, ensure_ascii=True) + "\n" for row in rows).encode()
        with self._lock, _told(self.path), self.path.open("ab") as handle:
            fcntl.flock(handle, fcntl.LOCK_EX)
            end = os.fstat(handle.fileno()).st_size
            if end and _last_byte(self.path, end) != b"\n":
                text = b"\n" + text  # a process that was killed left half a line, which says nothing
            try:
                handle.write(text)
                handle.flush()
                os.fsync(handle.fileno())
            except OSError:
                os.ftruncate(handle.fileno(), end)
                raise

    def _read(self) -> None:
        """Read what was entered since."""
        try:
            with _told(self.path), self.path.open("rb") as handle:
                found = os.fstat(handle.fileno())
                inode, start = self._seen or (found.st_ino, 0)
                if inode != found.st_ino or found.st_size < start:
                    self._known, start = {}, 0
                handle.seek(start)
                text = handle.read()
        except FileNotFoundError:
            self._known, self._seen = {}, None
            return
        whole = text[: text.rfind(b"\n") + 1]
        for line in whole.splitlines():
            self._take(line)
        self._seen = found.st_ino, start + len(whole)

    def _take(self, line: bytes) -> None:
        try:
            row = json.loads(line)
            if "undo" in row:
                self._known[row["undo"]] = replace(self._known[row["undo"]], undone_at=row["undone_at"])
            else:
                self._known[row["id"]] = Annotation(**row)
        except (ValueError, KeyError, TypeError):
            return  # half a line, or one of a later motionlake


def _last_byte(path: Path, end: int) -> bytes:
    with path.open("rb") as handle:
        handle.seek(end - 1)
        return handle.read(1)


@contextmanager
def _told(path: Path) -> Iterator[None]:
    try:
        yield
    except FileNotFoundError:
        raise
    except OSError as error:
        raise UserError(printable(explained(error, path))) from error


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
