"""A JSON text as objects, within the memory that its file may ask for."""

from __future__ import annotations

import json
from typing import Any, Final

from motionlake.errors import ClipError
from motionlake.formats.limits_config import limits

VALUE_BYTES: Final = 80  # the most that one value of a document takes as an object, with its place in a list


def json_document(data: bytes) -> Any:
    """The value that a JSON text holds.

    Raises:
        ClipError: it is no JSON, or would take more memory than `limits` allow.
    """
    objects = sum(data.count(mark) for mark in (b",", b"[", b"{"))
    limits().check_memory(len(data) + objects * VALUE_BYTES)
    try:
        return json.loads(data)
    except json.JSONDecodeError as error:
        raise ClipError(f"is not JSON: {error.msg}", error.lineno) from error
    except (UnicodeDecodeError, RecursionError, ValueError) as error:
        raise ClipError(f"is not JSON: {error}") from error
