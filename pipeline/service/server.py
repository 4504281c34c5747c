"""The process that serves: uvicorn on a socket, with patience for slow clients that ends."""

from __future__ import annotations

import asyncio
import signal
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from threading import current_thread, main_thread
from types import FrameType
from typing import Any, Final
from urllib.parse import quote

import uvicorn
from motionlake.errors import UserError
from motionlake.lake.layout import Lake
from motionlake.service.application import application
from motionlake.service.options import Options
from motionlake.threads import limited
from uvicorn.protocols.http.h11_impl import H11Protocol

PORT: Final = 8765
HEAD_SECONDS: Final = 10.0  # in which the head of a request must have come
_CONNECTIONS: Final = 200  # at once; a browser opens six
_LOOPBACK: Final = frozenset(("127.0.0.1", "localhost", "::1"))


def is_loopback(host: str) -> bool:
    """Whether only programs of this machine reach an address."""
    return host in _LOOPBACK


def listening(host: str, port: int | None) -> socket.socket:
    """A socket that listens; without a port the usual one, or any that is free where that is taken.

    Raises:
        UserError: it cannot listen there.
    """
    for number in (PORT, 0) if port is None else (port,):
        try:
            family = socket.getaddrinfo(host, number, type=socket.SOCK_STREAM)[0][0]
            return socket.create_server((host, number), family=family, backlog=128)
        except OSError as error:
            failed = error
    raise UserError(f"--host {host} --port {port or PORT}: cannot listen there ({failed.strerror or failed})")


def hosts_of(sock: socket.socket, named: str) -> frozenset[str]:
    """What requests may call a service that listens on a socket: a name that another site has made point here is
    none of it."""
    port = sock.getsockname()[1]
    names = {*_LOOPBACK, named} if is_loopback(named) else {named, socket.gethostname().lower(), sock.getsockname()[0]}
    found = {f"{f'[{name}]' if ':' in name else name}:{port}" for name in names if name not in ("0.0.0.0", "::")}
    return frozenset(found | (names if port == 80 else set()))


def address(sock: socket.socket, host: str, token: str = "") -> str:
    """What a person opens in a browser."""
    name = {"0.0.0.0": socket.gethostname(), "::": socket.gethostname()}.get(host, host)
    shown = f"[{name}]" if ":" in name else name
    return f"http://{shown}:{sock.getsockname()[1]}/" + (f"?token={quote(token)}" if token else "")


def serve(lake: Lake, sock: socket.socket, host: str, options: Options, started: Callable[[], None]) -> None:
    """Serve a lake until a signal ends it; `started` is called when it answers.

    Raises:
        UserError: as `application`.
    """
    own = replace(options, hosts=options.hosts | hosts_of(sock, host))
    config = uvicorn.Config(
        application(lake, own), http=_Http, ws="none", log_level="critical", access_log=False, server_header=False,
        proxy_headers=False, limit_concurrency=_CONNECTIONS, timeout_keep_alive=15, timeout_graceful_shutdown=3,
        h11_max_incomplete_event_size=64 << 10,
    )  # fmt: skip
    with limited(1):  # for all requests: where many are answered at once, threads of one are in the way of others
        _Server(config, own, started).run(sockets=[sock])


class _Server(uvicorn.Server):
    def __init__(self, config: uvicorn.Config, options: Options, started: Callable[[], None]) -> None:
        super().__init__(config)
        self._options, self._when_started = options, started

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        self._options.ending.set()
        super().handle_exit(sig, frame)

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self._when_started()

    async def on_tick(self, counter: int) -> bool:
        return await super().on_tick(counter) or self._options.ending.is_set()

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """A signal is how people end a service: no failure."""
        if current_thread() is not main_thread():
            yield
            return
        before = {number: signal.signal(number, self.handle_exit) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)


class _Http(H11Protocol):
    """HTTP in which the head of a request must have come in time: uvicorn itself waits for it forever."""

    _until: asyncio.TimerHandle | None = None

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        self._wait()

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if self.cycle is None or self.cycle.response_complete:
            self._wait()
        else:
            self._stop_waiting()

    def connection_lost(self, exc: Exception | None) -> None:
        self._stop_waiting()
        super().connection_lost(exc)

    def _wait(self) -> None:
        if self._until is None:
            self._until = self.loop.call_later(HEAD_SECONDS, self._give_up)

    def _stop_waiting(self) -> None:
        if self._until is not None:
            self._until.cancel()
            self._until = None

    def _give_up(self) -> None:
        self._until = None
        if (self.cycle is None or self.cycle.response_complete) and not self.transport.is_closing():
            self.transport.close()
