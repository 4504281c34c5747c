"""An S3 server on loopback (moto's), which can be told to fail as real ones do."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from moto.server import DomainDispatcherApplication, create_backend_app
from werkzeug.serving import make_server

BUCKET = "lakes"
_ERROR = b"<?xml version='1.0'?><Error><Code>SlowDown</Code><Message>Reduce your request rate.</Message></Error>"


@dataclass
class Faults:
    """What goes wrong, and how often it did.

    Attributes:
        throttled: whether the nth request is refused for their number.
        lost: whether the answer to a request that was carried out is lost, by method and path.
        seen: requests.
    """

    throttled: Callable[[int], bool] = lambda number: False
    lost: Callable[[str, str], bool] = lambda method, path: False
    seen: int = 0
    failed: int = 0
    lock: threading.Lock = field(default_factory=threading.Lock)


class ObjectStore:
    """A server of one bucket, and its faults."""

    def __init__(self, port: int, faults: Faults) -> None:
        self.address = f"http://127.0.0.1:{port}"
        self.faults = faults

    def environment(self) -> dict[str, str]:
        """What a program needs to ask it."""
        return {
            "AWS_ENDPOINT_URL_S3": self.address,
            "AWS_ACCESS_KEY_ID": "a",
            "AWS_SECRET_ACCESS_KEY": "b",
            "AWS_DEFAULT_REGION": "us-east-1",
            "NO_PROXY": "127.0.0.1",
            "no_proxy": "127.0.0.1",
        }


@contextmanager
def object_store() -> Iterator[ObjectStore]:
    """Serve while the block lasts."""
    import boto3

    faults = Faults()
    server = make_server(
        "127.0.0.1", 0, _failing(DomainDispatcherApplication(create_backend_app), faults), threaded=True
    )
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    store = ObjectStore(server.server_port, faults)
    try:
        client = boto3.client(
            "s3", endpoint_url=store.address, region_name="us-east-1", aws_access_key_id="a", aws_secret_access_key="b"
        )
        client.create_bucket(Bucket=BUCKET)
        yield store
    finally:
        server.shutdown()
        thread.join()


def _failing(application: Any, faults: Faults) -> Callable[[dict[str, Any], Any], Iterable[bytes]]:
    def answer(environ: dict[str, Any], start: Any) -> Iterable[bytes]:
        with faults.lock:
            faults.seen += 1
            throttled = faults.throttled(faults.seen)
        lost = faults.lost(environ["REQUEST_METHOD"], environ["PATH_INFO"])
        if lost:
            list(application(environ, lambda *_: None))
        if throttled or lost:
            faults.failed += 1
            start("503 Slow Down", [("Content-Type", "application/xml"), ("Content-Length", str(len(_ERROR)))])
            return [_ERROR]
        answered: Iterable[bytes] = application(environ, start)
        return answered

    return answer
