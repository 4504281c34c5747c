"""A service within the process of a test."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from motionlake.lake.layout import open_lake
from motionlake.service.application import application
from motionlake.service.options import Options

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from starlette.testclient import TestClient

TOKEN = "a token of tests"
HOST = "127.0.0.1:8765"


@contextmanager
def serving(lake: Path, *, token: str | None = TOKEN, **options: Any) -> Iterator[TestClient]:
    """A client of the service of a lake; it brings the token, or `None`: no token."""
    own = Options(token=TOKEN, hosts=frozenset({HOST}), **options)
    headers = {} if token is None else {"Authorization": f"Bearer {token}"}
    with TestClient(
        application(open_lake(lake), own), base_url=f"http://{HOST}", headers=headers, follow_redirects=False,
        raise_server_exceptions=False,
    ) as client:  # fmt: skip
        yield client
