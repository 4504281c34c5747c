"""The two kinds of errors a user can meet: a mistake in a command, and a clip that cannot be read."""

from __future__ import annotations


class UserError(Exception):
    """A mistake the user can mend: one line that says what, where, and what to do (exit status 2)."""


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
