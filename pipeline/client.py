"""A lake that a service serves: the same methods, asked over HTTP (`motionlake.open_lake("http://…")`)."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from http.client import HTTPException
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Unpack
from urllib.error import HTTPError, URLError
from urllib.parse import parse_qs, quote, urlencode, urlsplit
from urllib.request import ProxyHandler, Request, build_opener

import pyarrow as pa
from motionlake.api import Clip, Lake, ScopeOptions
from motionlake.errors import UserError
from motionlake.lake.rows import Rows

if TYPE_CHECKING:
    from motionlake.motion.canonicalise import CanonicalMotion
    from motionlake.pictures.answers import Hits

SECONDS: Final = 120.0  # that an answer is waited for


class RemoteLake(Lake):
    """A lake behind the address that `motionlake browse` prints.

    It answers `clips`, `motion`, `search`, `find`, `align`, `suggest_labels` and `sql`; every other method raises
    `UserError`. A query may be a clip file of this machine, which is sent.
    """

    def __init__(self, address: str) -> None:
        """Raises `UserError` where nobody answers there, or the token is wrong."""
        where = urlsplit(address)
        self._token = next(iter(parse_qs(where.query).get("token", [])), "")
        self._base = f"{where.scheme}://{where.netloc}{where.path.rstrip('/')}"
        near = where.hostname in ("127.0.0.1", "localhost", "::1")  # no proxy leads to this machine itself
        self._opener = build_opener(*([ProxyHandler({})] if near else []))
        self.path = Path(where.netloc)
        self._about = json.loads(self._ask("GET", "/api/lake"))

    def clips(self, where: str | None = None, **equal: str | float | None) -> Rows:
        """As `Lake.clips`."""
        return self._rows("/api/sql", {"where": where, "equal": equal})

    def motion(self, clip: Clip) -> CanonicalMotion:
        """As `Lake.motion`, of a clip of the lake."""
        from motionlake.lake.frames import from_table, motion_of

        table = _table(self._ask("GET", f"/api/clip/frames?{urlencode({'clip': str(clip)})}"))
        facts = json.loads(table.schema.metadata[b"motion"])
        return motion_of(from_table(facts["clip"], table), facts)

    def search(self, query: Clip | None = None, k: int = 10, **how: Any) -> Hits:
        """As `Lake.search`, without an encoder, and among the clips that a method chooses."""
        self._check_chosen(how.pop("exact", False))
        return self._found("search", query, {"k": k, **how})

    def find(
        self,
        query: Clip,
        start: int | None = None,
        stop: int | None = None,
        k: int = 10,
        *,
        method: str = "fused",
        exact: bool = False,
        **scope: Unpack[ScopeOptions],
    ) -> Hits:
        """As `Lake.find`, in the clips that a method chooses."""
        self._check_chosen(exact)
        return self._found("find", query, {"start": start, "stop": stop, "k": k, "method": method, **scope})

    def align(self, query: Clip, start: int | None = None, stop: int | None = None, k: int = 10, **how: Any) -> Hits:
        """As `Lake.align`."""
        return self._found("align", query, {"start": start, "stop": stop, "k": k, **how})

    def suggest_labels(self, dataset: str | None = None, column: str = "label", min_quality: str | None = None) -> Rows:
        """As `Lake.suggest_labels`."""
        return self._call("suggest_labels", None, {"dataset": dataset, "column": column, "min_quality": min_quality})

    def sql(self, text: str, parameters: Mapping[str, Any] | Sequence[Any] | None = None) -> Rows:
        """As `Lake.sql`; the service gives it some seconds and some memory."""
        given = (
            dict(parameters) if isinstance(parameters, Mapping) else None if parameters is None else list(parameters)
        )
        return self._rows("/api/sql", {"text": text, "parameters": given})

    def close(self) -> None:
        """There is nothing to let go of."""

    def __repr__(self) -> str:
        return f"<motionlake.Lake {self._about['name']} at {self._base}>"

    @property
    def _con(self) -> Any:
        raise UserError(f"{self._base}: a service does not answer this; open the folder of the lake")

    @property
    def _lake(self) -> Any:  # type: ignore[override]
        return self._con

    def _check_chosen(self, exact: bool) -> None:
        if exact:
            raise UserError("exact: a service compares the clips that a method chooses; open the folder of the lake")

    def _found(self, method: str, query: Clip | None, arguments: Mapping[str, Any]) -> Hits:
        from motionlake.pictures.answers import Hits

        rows, part = self._call(method, query, arguments), (arguments.get("start"), arguments.get("stop"))
        return Hits(rows.arrow(), self.motion, (query, *part))

    def _call(self, method: str, query: Clip | None, arguments: Mapping[str, Any]) -> Rows:
        asked: dict[str, Any] = {"method": method, "arguments": dict(arguments)}
        if isinstance(query, Path):
            asked["upload"] = self._sent(query)
        elif query is not None:
            asked["arguments"]["query"] = query
        return self._rows("/api/call", asked)

    def _sent(self, file: Path) -> str:
        """The id of a clip file that is sent to the service."""
        try:
            content = file.read_bytes()
        except OSError as error:
            raise UserError(f"{file}: cannot be read ({error.strerror})") from error
        found = json.loads(
            self._ask("POST", f"/api/uploads?name={quote(file.name)}", content, "application/octet-stream")
        )
        return str(found["id"])

    def _rows(self, path: str, asked: Mapping[str, Any]) -> Rows:
        try:
            body = json.dumps(asked).encode()
        except (TypeError, ValueError) as error:
            raise UserError(f"{self._base}: cannot be asked this ({error})") from error
        return Rows(_table(self._ask("POST", path, body, "application/json")))

    def _ask(self, method: str, path: str, body: bytes | None = None, kind: str = "") -> bytes:
        headers = {"Authorization": f"Bearer {self._token}"} | ({"Content-Type": kind} if kind else {})
        try:
            with self._opener.open(
                Request(f"{self._base}{path}", body, headers, method=method), timeout=SECONDS
            ) as answer:
                content: bytes = answer.read()
                return content
        except HTTPError as error:
            raise UserError(_reason(error.read(), f"{self._base}: answers {error.code}")) from error
        except (URLError, HTTPException, OSError, ValueError) as error:
            raise UserError(f"{self._base}: does not answer ({getattr(error, 'reason', error)})") from error


def _table(content: bytes) -> pa.Table:
    return pa.ipc.open_stream(content).read_all()


def _reason(content: bytes, otherwise: str) -> str:
    """What a service says of an error."""
    try:
        return str(json.loads(content)["error"])
    except (ValueError, KeyError, TypeError):
        return otherwise
