"""What a request is told that cannot be answered: one plain line, never a traceback."""

from __future__ import annotations

import logging
from typing import Final

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from motionlake.errors import ClipError, DamagedError, UserError, explained
from motionlake.memory import shortage
from motionlake.names import printable
from starlette.exceptions import HTTPException

_LOG: Final = logging.getLogger("motionlake.service")


class ServiceError(Exception):
    """A request that is refused: the status of the answer, and one line."""

    def __init__(self, status: int, reason: str) -> None:
        super().__init__(reason)
        self.status = status


def refused(status: int, reason: str) -> JSONResponse:
    """The answer to a request that is refused."""
    return JSONResponse({"error": printable(" ".join(reason.split()))[:1000]}, status)


def handle_errors(app: FastAPI) -> None:
    """Let an application answer errors in one line."""

    def answer(request: Request, error: Exception) -> JSONResponse:
        status, reason = told(error)
        root = request.app.state.serving.lake.root
        return refused(status, reason.replace(str(root), root.name))  # where it lies is nobody's business

    for kind in (ServiceError, UserError, ClipError, RequestValidationError, HTTPException, Exception):
        app.add_exception_handler(kind, answer)


def told(error: Exception) -> tuple[int, str]:
    """The status of the answer to an error, and its line."""
    if isinstance(error, ServiceError):
        return error.status, str(error)
    if isinstance(error, RequestValidationError):
        return 422, "; ".join(f"{'.'.join(map(str, each['loc'][1:]))}: {each['msg']}" for each in error.errors()[:4])
    if isinstance(error, HTTPException):
        return error.status_code, str(error.detail)
    if isinstance(error, DamagedError):
        return 503, str(error)
    if isinstance(error, UserError | ClipError):
        return 400, str(error)
    short = shortage(error)
    if short:
        return 503, short
    if isinstance(error, OSError):
        return 503, explained(error)
    _LOG.error("a request failed", exc_info=error)
    return 500, f"the service failed ({type(error).__name__}); its terminal shows where"
