"""Who may ask the service: token, Host and Origin of a request, and how long and slow it may be.

A page of another site cannot read what the service answers, and must not be able to change a lake either: its requests
bring the browser's Origin, and a name that it has made point at this machine comes as Host.
"""

from __future__ import annotations

import asyncio
import hashlib
import secrets
from http.cookies import CookieError, SimpleCookie
from typing import Final
from urllib.parse import parse_qsl, urlencode

from motionlake.service.errors import ServiceError, refused
from motionlake.service.options import Options
from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_READS: Final = frozenset(("GET", "HEAD"))
_UPLOADS: Final = "/api/uploads"
POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; font-src 'self'; "
    "connect-src 'self'; worker-src 'self' blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS: Final = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "X-Frame-Options": "DENY",
}
_NO_TOKEN: Final = (
    '<!doctype html><html lang="en"><meta charset="utf-8"><title>motionlake</title>'
    "<p>Open the address that <code>motionlake browse</code> printed: it holds the token.</p></html>"
)


def cookie_name(token: str) -> str:
    """The cookie of a service: cookies of one machine are shared by all of its ports."""
    return f"motionlake-{hashlib.sha256(token.encode()).hexdigest()[:12]}"


class Guard:
    """Lets through the requests that may be answered."""

    def __init__(self, app: ASGIApp, options: Options) -> None:
        self._app, self._options = app, options

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self._app(scope, receive, send)
            return  # no WebSocket is spoken

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
                if not scope["path"].startswith("/assets/"):
                    headers.setdefault("Cache-Control", "no-store")
            await send(message)

        try:
            answer = self._refusal(scope)
        except ServiceError as error:
            answer = refused(error.status, str(error))
        if answer is not None:
            await answer(scope, receive, with_headers)
            return
        body = _Body(receive, self._most(scope["path"]), self._options.body_seconds)

        async def or_refused(message: Message) -> None:
            if body.refused is None:
                await with_headers(message)
            elif message["type"] == "http.response.start":  # what reads a body has errors of its own for this
                await refused(body.refused.status, str(body.refused))(scope, receive, with_headers)

        await self._app(scope, body.receive, or_refused)

    def _refusal(self, scope: Scope) -> Response | None:
        """The answer to a request that goes no further; None where it may."""
        headers, options = Headers(scope=scope), self._options
        if len(scope["query_string"]) > options.most_query:
            raise ServiceError(413, f"the query of the address is longer than {options.most_query >> 10} KiB")
        host = headers.get("host", "").lower()
        if options.hosts and host not in options.hosts:
            raise ServiceError(403, f"Host {host[:80]!r} is not what this service is called")
        if headers.get("sec-fetch-site") == "cross-site" and scope["path"].startswith("/api/"):
            raise ServiceError(403, "a page of another site may not ask this service")
        if scope["path"] == "/" and (way := self._signed_in(scope)) is not None:
            return way
        by_header = _bearer(headers)
        if not _same(by_header or _cookie(headers, cookie_name(options.token)), options.token):
            if scope["path"].startswith("/api/"):
                raise ServiceError(401, "no token, or a wrong one: `motionlake browse` prints the address with it")
            return HTMLResponse(_NO_TOKEN, 401)
        if scope["method"] not in _READS:
            origin = headers.get("origin")
            if (origin is None and by_header is None) or origin not in (None, f"{scope['scheme']}://{host}"):
                raise ServiceError(403, f"Origin {(origin or 'of nothing')[:80]!r} is not this service")
        length = headers.get("content-length", "0")
        if not length.isdecimal() or len(length) > 12 or int(length) > self._most(scope["path"]):
            raise ServiceError(413, _too_long(self._most(scope["path"])))
        return None

    def _signed_in(self, scope: Scope) -> Response | None:
        """For `/?token=T`, a cookie and the same address without the token."""
        given = parse_qsl(scope["query_string"].decode("latin-1"), keep_blank_values=True)
        token = next((value for name, value in given if name == "token"), None)
        if token is None or scope["method"] not in _READS:
            return None
        if not _same(token, self._options.token):
            return HTMLResponse(_NO_TOKEN, 401)
        rest = urlencode([(name, value) for name, value in given if name != "token"])
        answer = RedirectResponse(f"/?{rest}" if rest else "/", 303)
        answer.set_cookie(cookie_name(token), token, httponly=True, samesite="strict", path="/")
        return answer

    def _most(self, path: str) -> int:
        return self._options.most_upload if path == _UPLOADS else self._options.most_body


class _Body:
    """The body of a request, which must not be too long and must have come in time."""

    def __init__(self, receive: Receive, most: int, seconds: float) -> None:
        self._receive, self._most, self._seconds = receive, most, seconds
        self._read, self._ended = 0, False
        self.refused: ServiceError | None = None

    async def receive(self) -> Message:
        if self._ended:  # now the end of the connection alone is waited for
            return await self._receive()
        try:
            async with asyncio.timeout(self._seconds):
                message = await self._receive()
        except TimeoutError:
            self.refused = ServiceError(408, f"the request took longer than {self._seconds:g} s to come")
            raise self.refused from None
        if message["type"] == "http.request":
            self._read += len(message.get("body", b""))
            self._ended = not message.get("more_body", False)
            if self._read > self._most:
                self.refused = ServiceError(413, _too_long(self._most))
                raise self.refused
        return message


def _too_long(most: int) -> str:
    return f"the request is longer than {most / (1 << 20):g} MiB"


def _bearer(headers: Headers) -> str | None:
    kind, _, token = headers.get("authorization", "").partition(" ")
    return token.strip() if kind.lower() == "bearer" else None


def _cookie(headers: Headers, name: str) -> str | None:
    try:
        found = SimpleCookie(headers.get("cookie", "")).get(name)
    except CookieError:
        return None
    return None if found is None else found.value


def _same(given: str | None, token: str) -> bool:
    return given is not None and secrets.compare_digest(given.encode("utf-8", "replace"), token.encode())
