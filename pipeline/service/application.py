"""The application: every endpoint, behind the guard that says who may ask."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Final

from anyio.to_thread import current_default_thread_limiter
from fastapi import FastAPI
from fastapi.middleware.gzip import GZipMiddleware
from motionlake.lake.annotations import Annotations
from motionlake.lake.layout import Lake
from motionlake.service import (
    annotating,
    calls,
    clip_map,
    clips,
    commands,
    events,
    making,
    motion,
    pages,
    review,
    search,
    timeline,
)
from motionlake.service.errors import handle_errors
from motionlake.service.options import Options
from motionlake.service.security import Guard
from motionlake.service.served import Serving, threads
from starlette.types import ASGIApp

_ROUTERS: Final = (
    clips.router, motion.router, timeline.router, search.router, annotating.router, clip_map.router, review.router,
    making.router, events.router, calls.router, commands.router, pages.router,
)  # fmt: skip
_WORTH: Final = 1000  # bytes that are worth being compressed


def application(lake: Lake, options: Options) -> ASGIApp:
    """The service of a lake.

    Args:
        lake: what is shown; it must have been opened (`open_lake`).
        options: who may ask, and how much a request may take.

    Raises:
        UserError: the lake is of another version, or damaged.
    """
    serving = Serving(lake, options)
    uploads = search.Uploads()

    @asynccontextmanager
    async def running(_: FastAPI) -> AsyncIterator[None]:
        current_default_thread_limiter().total_tokens = threads()
        try:
            yield
        finally:
            uploads.close()
            serving.close()

    app = FastAPI(
        title="motionlake", openapi_url="/api/openapi.json", docs_url=None, redoc_url=None, lifespan=running,
        description=f"The lake {lake.root.name}.",
    )  # fmt: skip
    app.state.serving, app.state.uploads = serving, uploads
    app.state.annotations = Annotations(lake)
    app.state.bundle = pages.Bundle(options.bundle)
    app.state.thumbnails = motion.Thumbnails()
    app.state.made, app.state.exports, app.state.listeners = making.Made(), making.formats(), 0
    for router in _ROUTERS:
        app.include_router(router)
    handle_errors(app)
    return Guard(GZipMiddleware(app, minimum_size=_WORTH, compresslevel=5), options)
