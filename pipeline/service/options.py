"""How a service runs: who may ask it, and how much one request may take."""

from __future__ import annotations

import secrets
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event
from typing import Final

MEBIBYTE: Final = 1 << 20


@dataclass(frozen=True)
class Options:
    """What the service is started with.

    Attributes:
        token: which every request must bring.
        hosts: what a request may call the service, "name:port"; none: anything, for tests of an application alone.
        read_only: nothing is written, not even annotations.
        bundle: folder of the browser application.
        most_body: bytes of the body of a request.
        most_upload: bytes of a clip file that is searched by.
        most_query: bytes of the query of an address.
        seconds: that a condition in SQL may take.
        memory: that conditions in SQL may use together.
        body_seconds: in which the body of a request must have come.
        search_seconds: that a request waits for its turn to search.
        warm: get ready for the first search before anybody asks.
        ending: set when the service ends: what would go on for ever ends then.
    """

    token: str = field(default_factory=lambda: secrets.token_urlsafe(24), repr=False)
    hosts: frozenset[str] = frozenset()
    read_only: bool = False
    bundle: Path = Path(__file__).parent / "bundle"
    most_body: int = MEBIBYTE
    most_upload: int = 64 * MEBIBYTE
    most_query: int = 16 << 10
    seconds: float = 5.0
    memory: str = "1GB"
    body_seconds: float = 30.0
    search_seconds: float = 30.0
    warm: bool = False
    ending: Event = field(default_factory=Event, compare=False)
