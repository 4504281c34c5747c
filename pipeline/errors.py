"""The two kinds of errors a user can meet: a mistake in a command, and a clip that cannot be read."""

from __future__ import annotations

import errno
import os
import re
from pathlib import Path
from typing import Final

FULL: Final = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # no more can be written
_TO_DO: Final = {
    errno.EROFS: "it lies where nothing can be written: a lake there can be searched, and not changed",
    **dict.fromkeys(FULL, "make room there, or raise the limit; then the same command goes on"),
}


class UserError(Exception):
    """A mistake the user can mend: one line that says what, where, and what to do (exit status 2)."""


class DamagedError(UserError):
    """A file of the lake is not as it was written; nothing is answered from it."""


class ClipError(Exception):
    """A clip that cannot be taken in; it is rejected with this reason and the run goes on.

    Args:
        reason: one line, without the file's name.
        line: 1-based line of the (decompressed) file, where the fault has one.
    """

    def __init__(self, reason: str, line: int | None = None) -> None:
        super().__init__(reason if line is None else f"line {line}: {reason}")
        self.reason = reason
        self.line = line


def user_name(number: int) -> str:
    """The name of a user of this system, else the number."""
    import pwd

    try:
        return pwd.getpwuid(number).pw_name
    except KeyError:
        return f"user {number}"


def explained(error: OSError, path: str | Path | None = None) -> str:
    """What is at fault with a file, and what to do or whose the file is, in one line.

    Args:
        error: what the system said.
        path: the file, where the error does not name it.
    """
    reason = error.strerror or str(error)
    file = error.filename2 or error.filename or path or _named(reason)
    named = f"{os.fsdecode(file)}: " if file else ""
    if error.errno in (errno.EACCES, errno.EPERM) and file:
        return f"{named}{os.strerror(error.errno)}; {_whose(Path(os.fsdecode(file)))}"
    todo = _TO_DO.get(error.errno or 0)
    return f"{named}{reason}" + (f"; {todo}" if todo else "")


def denied(text: str) -> str | None:
    """What a library says of a file that may not be opened, as `explained` says it; None of another message."""
    file = _named(text)
    if file is None or os.strerror(errno.EACCES) not in text:
        return None
    return explained(PermissionError(errno.EACCES, os.strerror(errno.EACCES), file))


def told_by_sql(text: str) -> str:
    """What DuckDB says, in words of this program where it has them: a mistake in a function's argument, a file that is
    damaged or may not be opened."""
    own = re.search(r"\b(?:UserError|DamagedError): (.+)", text, re.DOTALL)
    return denied(text) or (own[1] if own else text)


def _named(text: str) -> str | None:
    """The file that a message of DuckDB or Arrow names."""
    found = re.search(r"""(['"])(/.+?)\1""", text)
    return found[2] if found else None


def _whose(path: Path) -> str:
    """Who may open a file: of the file itself, or of the nearest folder above it that can be seen."""
    for place in (path, *path.absolute().parents):
        try:
            found = place.stat()
        except OSError:
            continue
        which = "it" if place == path else f"its folder {place}"
        mine = user_name(os.geteuid())
        return f"{which} belongs to {user_name(found.st_uid)} (mode {found.st_mode & 0o7777:o}), and you are {mine}"
    return f"you are {user_name(os.geteuid())}"
