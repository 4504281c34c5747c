"""Who may ask the service, and how: tokens, hosts, origins, paths, hostile names, long and slow requests."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit
from urllib.request import Request, urlopen

import pytest
from motionlake.lake.annotations import Annotations
from motionlake.lake.layout import open_lake
from motionlake.service import server
from motionlake.service.options import Options
from motionlake.service.security import cookie_name

from tests.hostile import LABELS
from tests.lakes import motionlake
from tests.services import HOST, TOKEN, serving

ASKED = (
    "/api/lake",
    "/api/clips",
    "/api/openapi.json",
    "/api/docs",
    "/api/events",
    "/",
    "/assets/a.js",
    "/favicon.ico",
)


@pytest.mark.parametrize("path", ASKED)
def test_without_the_token_nothing_is_told(built_lake: Path, path: str) -> None:
    with serving(built_lake, token=None) as client:
        answers = [
            client.get(path),
            client.get(path, headers={"Authorization": f"Bearer {TOKEN}x"}),
            client.get(path, headers={"Authorization": f"Basic {TOKEN}"}),
            client.get(path, headers={"Authorization": "Bearer "}),
            client.get(path, headers={"Cookie": f"{cookie_name(TOKEN)}=wrong"}),
            client.get(path, headers={"Cookie": f"other={TOKEN}"}),
            client.get(path, params={"token": "wrong"}),
        ]
        for answer in answers:
            assert answer.status_code == 401, answer.request.headers
            assert "clips" not in answer.text.replace("clips/", "")
            assert "error" in answer.json() if path.startswith("/api/") else "printed" in answer.text


def test_the_token_of_the_address_becomes_a_cookie(built_lake: Path) -> None:
    with serving(built_lake, token=None) as client:
        answer = client.get("/", params={"token": TOKEN, "view": "clip", "clip": "a/b&c=d"})
        assert answer.status_code == 303
        where = urlsplit(answer.headers["location"])
        assert (where.scheme, where.netloc, where.path) == ("", "", "/")
        assert parse_qs(where.query) == {"view": ["clip"], "clip": ["a/b&c=d"]}
        cookie = answer.headers["set-cookie"].lower()
        assert "httponly" in cookie
        assert "samesite=strict" in cookie
        assert TOKEN not in answer.headers["location"]
        assert client.get("/api/lake").status_code == 200, "the client keeps the cookie"


def test_a_host_of_another_name_is_refused(built_lake: Path) -> None:
    with serving(built_lake) as client:
        for host in (
            "evil.example",
            "evil.example:8765",
            "127.0.0.1",
            "127.0.0.1:1",
            "127.0.0.1:8765.evil.example",
            "",
        ):
            answer = client.get("/api/lake", headers={"Host": host})
            assert answer.status_code == 403, host
        assert client.get("/api/lake", headers={"Host": HOST.upper()}).status_code == 200
        assert client.get("/", params={"token": TOKEN}, headers={"Host": "evil.example"}).status_code == 403


@pytest.mark.parametrize("method", ["POST", "DELETE", "PUT", "PATCH"])
def test_another_origin_changes_nothing(lake: Path, method: str) -> None:
    body = {"clips": ["x"], "kind": "tag", "value": "x"}
    with serving(lake, token=None) as client:
        client.get("/", params={"token": TOKEN})  # a browser, which has the cookie
        for origin in (
            "http://evil.example",
            "null",
            f"https://{HOST}",
            f"http://{HOST}.evil.example",
            "http://localhost:1",
            None,
        ):
            headers = {} if origin is None else {"Origin": origin}
            answer = client.request(method, "/api/annotations", json=body, headers=headers)
            assert answer.status_code == 403, origin
        own = client.request(method, "/api/annotations", json=body, headers={"Origin": f"http://{HOST}"})
        assert own.status_code != 403
        assert client.get("/api/clips", headers={"Sec-Fetch-Site": "cross-site"}).status_code == 403
    assert Annotations(open_lake(lake)).all() == []


def test_headers_let_a_page_run_nothing_but_its_own(built_lake: Path) -> None:
    with serving(built_lake) as client:
        for path in ("/", "/api/lake", "/nothing", "/api/docs"):
            headers = client.get(path).headers
            policy = dict(part.strip().split(" ", 1) for part in headers["content-security-policy"].split(";"))
            assert policy["default-src"] == policy["frame-ancestors"] == policy["base-uri"] == "'none'"
            assert policy["script-src"] == "'self'"
            assert policy["style-src"] == ("'unsafe-inline'" if path == "/api/docs" else "'self'")
            assert headers["x-content-type-options"] == "nosniff"
            assert headers["referrer-policy"] == "no-referrer"
            assert "access-control-allow-origin" not in headers
    with serving(built_lake, token="wrong") as client:
        assert "content-security-policy" in client.get("/").headers


def test_what_is_too_long_is_refused(lake: Path) -> None:
    with serving(lake, most_body=10_000, most_upload=20_000) as client:
        clip = client.get("/api/clips").json()["clips"][0]["clip"]
        for answer, status in (
            (client.get("/api/clips", params={"where": "x" * 20_000}), 413),
            (client.get("/api/clips", params={"where": "1 = 1 -- " + "x" * 5000}), 413),
            (client.get("/api/clips", params={"text": "x" * 201}), 422),
            (client.get("/api/clip", params={"clip": "x" * 3000}), 422),
            (client.get("/api/clips", params={"limit": 10**9}), 422),
            (client.get("/api/clips", params={"offset": 10**30}), 422),
            (client.post("/api/search", json={"clip": clip, "where": "x" * 12_000}), 413),
            (client.post("/api/search", content=iter([b"x" * 6000, b"x" * 6000])), 413),
            (client.post("/api/uploads", params={"name": "x.bvh"}, content=b"x" * 20_001), 413),
            (client.post("/api/annotations", json={"clips": [clip], "kind": "tag", "value": "x" * 1001}), 422),
            (client.post("/api/search", content=b"[" * 9000), 422),
            (client.post("/api/search", content=b"x", headers={"Content-Length": "9" * 30}), 413),
        ):  # fmt: skip
            assert answer.status_code == status, (str(answer.request.url)[:80], answer.text[:200])
            assert len(answer.text) < 1200
            assert "error" in answer.json()


def test_a_condition_only_asks_and_ends(lake: Path, tmp_path: Path) -> None:
    (tmp_path / "secret.csv").write_text("a\n1\n")
    with serving(lake, seconds=1.0, memory="200MB") as client:

        def asked(condition: str) -> Any:
            return client.get("/api/clips", params={"where": condition})

        for condition in (
            f"(SELECT count(*) FROM read_csv('{tmp_path}/secret.csv')) > 0",
            "(SELECT count(*) FROM read_text('/etc/passwd')) > 0",
            "1 = 1); DROP TABLE clips; --",
            "1 = 1; COPY clips TO 'frames/a.parquet'",
            "getenv('HOME') <> ''",
            "no_such_column = 1", "'", ")", "",
        ):  # fmt: skip
            answer = asked(condition)
            assert answer.status_code == (400 if condition else 200), condition
            assert "\n" not in answer.text
        started = time.monotonic()
        endless = asked("(SELECT count(*) FROM range(1000000) a, range(1000000) b WHERE a.range * b.range % 7 = 3) > 0")
        assert endless.status_code == 503
        assert "stopped after 1 s" in endless.json()["error"]
        assert time.monotonic() - started < 20
        large = asked("len((SELECT list(range) FROM range(200000000))) > 0")
        assert large.status_code == 503, large.text
        assert client.get("/api/clips").json()["total"] > 0
        assert asked("seconds > 0").status_code == 200


def test_names_and_labels_stay_text(lake: Path) -> None:
    with serving(lake) as client:
        clips = [row["clip"] for row in client.get("/api/clips").json()["clips"]]
        for label in (label for label in LABELS if "\0" not in label):
            clip = clips[len(label) % len(clips)]
            made = client.post("/api/annotations", json={"clips": [clip], "kind": "tag", "value": label, "who": "me"})
            assert made.status_code == 200, label
            answer = client.get("/api/clips", params={"tags": label.strip()})
            assert answer.headers["content-type"] == "application/json"
            assert [row["clip"] for row in answer.json()["clips"]] == [clip]
            assert label.strip() in answer.json()["clips"][0]["tags"]
        page = client.get("/api/clip", params={"clip": "<script>alert(1)</script>"})
        assert page.headers["content-type"] == "application/json"
        assert page.status_code == 404
        assert "<script>" not in client.get("/api/docs").text
        text = client.get("/api/annotations/export", params={"kind": "labels"}).text
        assert not any(cell.startswith(("=", "+", "-", "@")) for line in text.splitlines() for cell in line.split(","))


def test_nothing_outside_the_lake_is_read(lake: Path) -> None:
    with serving(lake) as client:
        for name in ("../../etc/passwd", "/etc/passwd", "clips/../catalog.duckdb", "catalog.duckdb", "%00", "\x00"):
            for path in ("/api/clip", "/api/clip/motion", "/api/clip/timeline", "/api/thumbnails"):
                assert client.get(path, params={"clip": name}).status_code == 404, (path, name)
            exported = client.post("/api/export", json={"clips": [{"clip": name}], "format": "bvh"})
            assert exported.status_code == 404
            assert client.post("/api/search", json={"clip": name}).status_code == 404
            assert client.get("/api/clip/motion", params={"made": name}).status_code == 404
        assert client.post("/api/export", json={"clips": [], "format": "../x"}).status_code == 422


def test_read_only_writes_nothing(lake: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in lake.rglob("*")}
    with serving(lake, read_only=True) as client:
        clip = client.get("/api/clips").json()["clips"][0]["clip"]
        made = client.post("/api/annotations", json={"clips": [clip], "kind": "tag", "value": "x"})
        assert made.status_code == client.delete("/api/annotations", params={"id": "x"}).status_code == 403
        assert client.get("/api/lake").json()["read_only"] is True
        assert client.post("/api/search", json={"clip": clip}).status_code == 200
    assert {path: path.stat().st_mtime_ns for path in lake.rglob("*")} == before


def test_an_error_of_the_program_is_no_traceback(built_lake: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from motionlake.service.shelf import Shelf

    def fails(*_: object, **__: object) -> None:
        raise ZeroDivisionError("secret detail")

    monkeypatch.setattr(Shelf, "page", fails)
    with serving(built_lake) as client:
        answer = client.get("/api/clips")
        assert answer.status_code == 500
        assert set(answer.json()) == {"error"}
        assert "secret" not in answer.text
        assert "Traceback" not in answer.text


def test_the_command_refuses_what_is_not_safe(built_lake: Path) -> None:
    for words, told in (
        (["--host", "0.0.0.0"], "--token"), (["--token", "short"], "16 characters"),
        (["--token", "é" * 20], "16 characters"),
        (["--host", "no.such.host.invalid", "--token", "x" * 16], "cannot listen"),
    ):  # fmt: skip
        run = motionlake("browse", *words, "--no-open", "--lake", built_lake)
        assert run.status == 2
        assert told in run.err
    assert motionlake("browse", "--no-open", "--lake", built_lake.parent / "none").status == 2


def test_hosts_are_those_listened_on() -> None:
    with server.listening("127.0.0.1", 0) as sock:
        port = sock.getsockname()[1]
        assert server.hosts_of(sock, "127.0.0.1") == {f"127.0.0.1:{port}", f"localhost:{port}", f"[::1]:{port}"}
        assert server.address(sock, "127.0.0.1", "a b").startswith(f"http://127.0.0.1:{port}/?token=a%20b")


@contextmanager
def process(lake: Path, *words: str) -> Iterator[str]:
    """The address of a service in a process of its own."""
    run = subprocess.Popen(
        [sys.executable, "-m", "motionlake.cli.main", "browse", "--no-open", "--port", "0", "--lake", lake, *words],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert run.stdout is not None
        yield run.stdout.readline().strip()
    finally:
        run.terminate()
        _, said = run.communicate(timeout=60)
    assert run.returncode == 0, said
    assert "Traceback" not in said


def test_a_real_process_serves_and_ends_by_a_signal(lake: Path) -> None:
    with process(lake) as address:
        where = urlsplit(address)
        (token,) = parse_qs(where.query)["token"]
        base = f"http://{where.netloc}"

        def ask(path: str) -> dict[str, Any]:
            with urlopen(Request(f"{base}{path}", headers={"Authorization": f"Bearer {token}"}), timeout=60) as answer:
                found: dict[str, Any] = json.load(answer)
            return found

        assert len(token) >= 24
        assert ask("/api/lake")["clips"] > 0
        events = socket.create_connection((where.hostname, where.port), timeout=30)
        events.sendall(
            f"GET /api/events HTTP/1.1\r\nHost: {where.netloc}\r\nAuthorization: Bearer {token}\r\n\r\n".encode()
        )
        said = b""
        while b"generation" not in said:
            said += events.recv(4096)
        _slow(where.hostname or "", where.port or 0, where.netloc, token, lambda: ask("/api/lake"))


def _slow(name: str, port: int, netloc: str, token: str, ask: Any) -> None:
    """Clients that never end their request keep nobody from being answered, and are cut off."""
    heads = [socket.create_connection((name, port), timeout=60) for _ in range(40)]
    for head in heads:
        head.sendall(b"GET / HTTP/1.1\r\nHost: ")
    body = socket.create_connection((name, port), timeout=60)
    head_of_body = f"POST /api/search HTTP/1.1\r\nHost: {netloc}\r\nAuthorization: Bearer {token}\r\n"
    body.sendall(f"{head_of_body}Content-Length: 100\r\n\r\n{{".encode())
    assert ask()["clips"] > 0
    started = time.monotonic()
    for head in heads:
        with suppress(ConnectionResetError):
            while head.recv(4096):
                pass
    assert time.monotonic() - started < server.HEAD_SECONDS + 20
    told = b""
    while chunk := body.recv(4096):
        told += chunk
        if b"took longer" in told:
            break
    assert b" 408 " in told
    assert time.monotonic() - started < Options().body_seconds + 20
    assert ask()["clips"] > 0
