"""A server on the loopback that serves files as the servers of datasets do, well and badly."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer


@dataclass
class Site:
    """What a server serves, how, and what it was asked.

    Attributes:
        files: content by path.
        ranges: whether it answers requests for a part with that part.
        cut: bytes after which it ends each connection, where it has so many to send.
        busy: how many requests it turns away first, with 503.
        rate: bytes that it sends a second; 0 is all at once.
        tag: of the version of its files.
        unsaid: whether it leaves out how long a file is.
        moved: paths that lead to another address.
        asked: (path, its header Range) of every request.
    """

    url: str = ""
    files: dict[str, bytes] = field(default_factory=dict)
    ranges: bool = True
    cut: int = 0
    busy: int = 0
    rate: int = 0
    tag: str = '"one"'
    unsaid: bool = False
    moved: dict[str, str] = field(default_factory=dict)
    asked: list[tuple[str, str]] = field(default_factory=list)


@contextmanager
def serving() -> Iterator[Site]:
    """A server of its own for one test."""
    site = Site()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            with suppress(ConnectionError):
                _answer(self, site)

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002
            """Say nothing."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
    site.url = f"http://127.0.0.1:{server.server_address[1]}"
    try:
        yield site
    finally:
        server.shutdown()
        server.server_close()


def _answer(request: BaseHTTPRequestHandler, site: Site) -> None:
    asked = request.headers.get("Range", "")
    site.asked.append((request.path, asked))
    if site.busy:
        site.busy -= 1
        _head(request, 503, {"Retry-After": "0", "Content-Length": "0"})
        return
    if request.path in site.moved:
        _head(request, 302, {"Location": site.moved[request.path], "Content-Length": "0"})
        return
    content = site.files.get(request.path)
    if content is None:
        _head(request, 404, {"Content-Length": "0"})
        return
    part = re.fullmatch(r"bytes=(\d+)-", asked)
    start, whole = 0, len(content)
    fits = request.headers.get("If-Range") in (None, site.tag)
    headers = {"ETag": site.tag}
    if part and site.ranges and fits:
        start = int(part[1])
        if start >= whole:
            _head(request, 416, {"Content-Range": f"bytes */{whole}", "Content-Length": "0"})
            return
        headers["Content-Range"] = f"bytes {start}-{whole - 1}/{whole}"
    if not site.unsaid:
        headers["Content-Length"] = str(whole - start)
    _head(request, 206 if "Content-Range" in headers else 200, headers)
    _send(request, content[start:], site)


def _head(request: BaseHTTPRequestHandler, status: int, headers: dict[str, str]) -> None:
    request.send_response(status)
    for name, value in headers.items():
        request.send_header(name, value)
    request.end_headers()


def _send(request: BaseHTTPRequestHandler, content: bytes, site: Site) -> None:
    if site.cut and len(content) > site.cut:
        content = content[: site.cut]
    step = max(1, site.rate // 50) if site.rate else len(content) or 1
    for start in range(0, len(content), step):
        request.wfile.write(content[start : start + step])
        request.wfile.flush()
        if site.rate:
            time.sleep(0.02)
    request.close_connection = True
