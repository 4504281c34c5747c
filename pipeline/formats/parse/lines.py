"""Where in a text file something is, for messages."""

from __future__ import annotations


def line_of(data: bytes, offset: int) -> int:
    """1-based line of the byte at `offset`."""
    return data.count(b"\n", 0, offset) + 1


def token_at(data: bytes, offset: int) -> str:
    """The token that starts at `offset`, cut to 40 characters, for a message."""
    words = data[offset : offset + 40].split(maxsplit=1)
    return words[0].decode("latin-1") if words else ""
