"""Searches that a service of the lake answers, where one runs: it has read already what they need."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from typing import Annotated, Any, Final

import typer
from motionlake.cli._output import notice
from motionlake.cli.common import FrameOrSeconds
from motionlake.lake.announced import announced
from motionlake.lake.layout import Lake

SECONDS: Final = 20.0  # that an answer is waited for
MOST: Final = 256 << 20  # bytes of an answer
NoServiceOption = Annotated[
    bool,
    typer.Option("--no-service", help="Search here, even where `motionlake browse` serves the lake and would answer."),
]


@dataclass(frozen=True)
class Answers:
    """What a service found.

    Attributes:
        rows: for each clip that was asked for, or once for a text alone.
        notices: why methods were left out.
    """

    rows: list[list[dict[str, Any]]]
    notices: list[str]


def ask_service(
    lake: Lake,
    finds: str,
    names: Sequence[str],
    start: FrameOrSeconds | None,
    stop: FrameOrSeconds | None,
    scope: Mapping[str, Any],
    **asked: Any,
) -> Answers | None:
    """What a service of the lake answers; None where none runs, or it cannot, and the search is to be made here.

    Whatever is wrong with a question is told by the search that is made here then. Files are read here alone.
    """
    service = announced(lake)
    if service is None or any(name.startswith(("/", "./", "../")) for name in names):
        return None
    from http.client import HTTPConnection, HTTPException

    places = {name: place and asdict(place) for name, place in (("start", start), ("stop", stop))}
    try:
        catalog = lake.served()
        body = {"catalog": catalog, "finds": finds, "clips": list(names), **places, "scope": dict(scope), **asked}
        headers = {"Authorization": f"Bearer {service.token}", "Content-Type": "application/json"}
        with closing(HTTPConnection(service.host, service.port, timeout=SECONDS)) as connection:
            connection.request("POST", "/api/command", json.dumps(body), headers)
            answer = connection.getresponse()
            content = answer.read(MOST)
        if answer.status != 200 or lake.served() != catalog:
            return None
        told = json.loads(content)
        found = Answers([[dict(row) for row in rows] for rows in told["answers"]], [str(n) for n in told["notices"]])
        meant = [str(clip) for clip in told["clips"]]
    except (OSError, HTTPException, ValueError, KeyError, TypeError, RecursionError):
        return None
    if len(found.rows) != max(1, len(names)) or len(meant) != len(names):
        return None
    for name, clip in zip(names, meant, strict=True):
        _tell_hidden_file(name, clip)
    return found


def _tell_hidden_file(name: str, clip: str) -> None:
    """The notice of a clip that is called like a file; what knows files is imported only where there is one."""
    if os.path.exists(name):  # noqa: PTH110 - a name that is no path is none
        from motionlake.lake.resolve import hidden_file

        line = hidden_file(name, clip)
        if line is not None:
            notice(line)
