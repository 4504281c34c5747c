"""The browser application, file by file, and a page of the endpoints; nothing outside of the bundle is read."""

from __future__ import annotations

import mimetypes
from html import escape
from pathlib import Path
from typing import Any, Final

from fastapi import APIRouter, Request, Response
from fastapi.responses import HTMLResponse
from motionlake.service.errors import ServiceError
from motionlake.service.security import POLICY

router = APIRouter(include_in_schema=False)
_NO_BUNDLE: Final = (
    '<!doctype html><html lang="en"><meta charset="utf-8"><title>motionlake</title><p>This copy of motionlake has no '
    'browser application. The service runs: <a href="/api/docs">its endpoints</a>.</p></html>'
)
_STYLED: Final = POLICY.replace("style-src 'self'", "style-src 'unsafe-inline'")
_FOREVER: Final = "public, max-age=31536000, immutable"
# Not what the machine's own table says: that of some makes scripts plain text, which no browser runs.
_TYPES: Final = {
    ".js": "text/javascript", ".mjs": "text/javascript", ".css": "text/css", ".html": "text/html",
    ".svg": "image/svg+xml", ".json": "application/json", ".woff2": "font/woff2", ".wasm": "application/wasm",
    ".png": "image/png", ".ico": "image/x-icon", ".txt": "text/plain",
}  # fmt: skip


class Bundle:
    """The files of the application by the path in their address, read once."""

    def __init__(self, folder: Path) -> None:
        root = folder.resolve()
        paths = [path for path in root.rglob("*") if path.is_file() and path.resolve().is_relative_to(root)]
        self._files = {path.relative_to(root).as_posix(): path for path in paths}

    def file(self, name: str) -> Response:
        """A file of the bundle. Raises `ServiceError` where there is none."""
        path = self._files.get(name)
        if path is None:
            raise ServiceError(404, f"{name[:200]}: no such page")
        kind = _TYPES.get(path.suffix) or mimetypes.guess_type(path.name)[0] or "application/octet-stream"
        caching = {"Cache-Control": _FOREVER} if name.startswith("assets/") else {}
        return Response(path.read_bytes(), media_type=kind, headers=caching)

    def __contains__(self, name: str) -> bool:
        return name in self._files


@router.get("/")
def index(request: Request) -> Response:
    """The application, whatever the view that the address names."""
    bundle: Bundle = request.app.state.bundle
    return bundle.file("index.html") if "index.html" in bundle else HTMLResponse(_NO_BUNDLE)


@router.get("/api/docs")
def docs(request: Request) -> Response:
    """The endpoints as a page, without a script."""
    return HTMLResponse(_page(request.app.openapi()), headers={"Content-Security-Policy": _STYLED})


@router.get("/{name:path}")
def file(request: Request, name: str) -> Response:
    """Any other file of the application."""
    bundle: Bundle = request.app.state.bundle
    return bundle.file(name)


def _page(schema: dict[str, Any]) -> str:
    parts = [
        f"<section><h2><code>{method.upper()} {escape(path)}</code></h2><p>{escape(about.get('description', ''))}</p>"
        f"{_parameters(about)}</section>"
        for path, methods in sorted(schema["paths"].items())
        for method, about in methods.items()
    ]
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        "<title>motionlake: endpoints</title><style>body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:"
        "2rem auto;padding:0 1rem}h2{font-size:1rem;margin-top:2rem}table{border-collapse:collapse}td{padding:.1rem "
        "1rem .1rem 0;vertical-align:top}"
        "@media(prefers-color-scheme:dark){body{background:#111;color:#ddd}a{color:#8cf}}"
        '</style></head><body><h1>Endpoints</h1><p>As a schema: <a href="/api/openapi.json">openapi.json</a></p>'
        f"{''.join(parts)}</body></html>"
    )


def _parameters(about: dict[str, Any]) -> str:
    rows = [
        f"<tr><td><code>{escape(each['name'])}</code></td><td>{'needed' if each.get('required') else ''}</td>"
        f"<td>{escape(each.get('description', ''))}</td></tr>"
        for each in about.get("parameters", [])
    ]
    return f"<table>{''.join(rows)}</table>" if rows else ""
