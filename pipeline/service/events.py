"""What happens to the lake meanwhile, as events that the server sends: runs, and catalogs that land."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from typing import Any, Final

from fastapi import APIRouter, Request
from fastapi.responses import StreamingResponse
from motionlake.lake.run_progress import progress_now
from motionlake.service.errors import ServiceError
from motionlake.service.served import Serving, serving_of

router = APIRouter(prefix="/api", tags=["events"])
_EVERY: Final = 0.5  # seconds between two looks
_ALIVE: Final = 30  # looks after which an empty line says that it is still there
MOST: Final = 50  # pages that listen


@router.get("/events", response_class=StreamingResponse)
async def events(request: Request) -> StreamingResponse:
    """Server-sent events: `{generation}` when another catalog is served, `{run}` while one is written, null after."""
    state = request.app.state
    if state.listeners >= MOST:
        raise ServiceError(503, f"{MOST} pages listen already")
    return StreamingResponse(_told(request, serving_of(request)), media_type="text/event-stream")


async def _told(request: Request, serving: Serving) -> AsyncIterator[str]:
    state = request.app.state
    state.listeners += 1
    try:
        said: dict[str, Any] = {}
        quiet = 0
        while not serving.options.ending.is_set() and not await request.is_disconnected():
            now = {"generation": serving.now().generation, "run": progress_now(serving.lake)}
            new = {name: value for name, value in now.items() if name not in said or said[name] != value}
            if not said and now["run"] is None:
                del new["run"]
            said, quiet = now, 0 if new else quiet + 1
            for name, value in new.items():
                yield f"data: {json.dumps({name: value})}\n\n"
            if quiet >= _ALIVE:
                quiet = 0
                yield ": here\n\n"
            await asyncio.sleep(_EVERY)
    finally:
        state.listeners -= 1
