"""motionlake browse: a lake in the browser, and as a service."""

from __future__ import annotations

from contextlib import ExitStack, closing
from typing import Annotated

import typer
from motionlake.cli._output import notice, tell
from motionlake.cli.common import JsonOption, LakeOption, option, publish_copies
from motionlake.errors import UserError
from motionlake.lake.layout import open_lake


def browse(
    lake: LakeOption,
    port: Annotated[
        int | None, option("--port", min=0, max=65535, help="Port to listen on (default: 8765, or a free one).")
    ] = None,
    host: Annotated[
        str, option("--host", help="Address to listen on (default: 127.0.0.1, this machine alone); needs --token.")
    ] = "127.0.0.1",
    token: Annotated[
        str | None,
        option(
            "--token",
            envvar="MOTIONLAKE_TOKEN",
            help="What requests must bring, 16 characters at least (default: a new one each time).",
        ),
    ] = None,
    named: Annotated[
        list[str] | None, option("--name", help="Further name:port that requests may call the service, behind a proxy.")
    ] = None,
    read_only: Annotated[
        bool, typer.Option("--read-only", help="Let nobody change anything: no tags, no labels.")
    ] = False,
    no_open: Annotated[bool, typer.Option("--no-open", help="Serve without opening a browser.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Look at a lake in the browser, and work on it; or serve it to programs.

    It prints the address with its token and runs until Ctrl-C. Only this machine can ask it, unless --host says
    otherwise. While it runs, `motionlake search` and `find` of the same user ask it and answer sooner.

    Example: motionlake browse --lake mylake

    For others on the network, to look only: motionlake browse --host 0.0.0.0 --token "$TOKEN" --read-only --no-open
    --lake mylake
    """
    target = open_lake(lake)
    import os
    import secrets
    import sys

    from motionlake.lake.announced import Announcement, announcing
    from motionlake.service.background import end_background
    from motionlake.service.options import Options
    from motionlake.service.server import address, is_loopback, listening, serve

    if token is None and not is_loopback(host):
        raise UserError(f"--host {host}: others can reach it; choose a token with --token")
    if token is not None and (len(token) < 16 or not (token.isascii() and token.isprintable()) or " " in token):
        raise UserError("--token: takes 16 characters or more, of ASCII and without blanks")
    sock = listening(host, port)
    options = Options(
        token=token or secrets.token_urlsafe(24), hosts=frozenset(name.lower() for name in named or ()),
        read_only=read_only, warm=True,
    )  # fmt: skip

    running = ExitStack()

    def started() -> None:
        shown = address(sock, host, options.token)
        running.enter_context(announcing(target, Announcement.of(address(sock, host), options.token)))
        tell({"address": shown, "token": options.token}, shown, as_json=as_json)
        sys.stdout.flush()
        notice("serves until Ctrl-C")
        if not no_open:
            _open(shown)

    with closing(sock), running:
        serve(target, sock, host, options, started)
    if not end_background(0):  # what still computes would end the process with an error of its own
        publish_copies()
        sys.stdout.flush()
        os._exit(0)


def _open(shown: str) -> None:
    """Open a browser, where there is one; it may take seconds."""
    import threading
    import webbrowser

    threading.Thread(target=webbrowser.open, args=(shown,), daemon=True).start()
