"""`motionlake search` and `find` where a service of the lake runs: the same output, and done here where it fails."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
from motionlake.cli import _service
from motionlake.cli import search as commands
from motionlake.lake.announced import Announcement, announced, announcing
from motionlake.lake.layout import open_lake

from tests.lakes import Run, motionlake, query
from tests.services import serving

TOKEN = "a-token-for-these-tests"


@contextmanager
def browsing(lake: Path, *options: str) -> Iterator[subprocess.Popen[str]]:
    """A service of a lake in a process of its own, which answers."""
    words = ["browse", "--lake", str(lake), "--token", TOKEN, "--port", "0", "--no-open", *options]
    command = [str(Path(sys.executable).parent / "motionlake"), *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline().startswith("http://127.0.0.1:")
            yield process
        finally:
            process.terminate()


@pytest.fixture(scope="module")
def served(built_lake: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A lake that a service serves which changes nothing."""
    lake = Path(shutil.copytree(built_lake, tmp_path_factory.mktemp("served") / "lake"))
    with browsing(lake, "--read-only"):
        yield lake


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Of every search that asked for a service, whether one answered."""
    told: list[bool] = []

    def ask(*given: Any, **more: Any) -> Any:
        found = _service.ask_service(*given, **more)
        told.append(found is not None)
        return found

    monkeypatch.setattr(commands, "ask_service", ask)
    return told


def clip_of(lake: Path, least: float = 1.0) -> str:
    return str(query(lake, f"SELECT min(clip) FROM clips WHERE seconds >= {least}")[0][0])


def here(words: Sequence[str], lake: Path) -> Run:
    return motionlake(*words, "--no-service", "--lake", lake)


def same(one: Run, other: Run) -> bool:
    return (one.status, one.out, one.err) == (other.status, other.out, other.err)


@pytest.mark.parametrize(
    "words",
    [
        ["search", "CLIP", "-k", "5"],
        ["search", "CLIP", "--json"],
        ["search", "CLIP", "OTHER", "--explain"],
        ["search", "CLIP", "--mirrored", "--json", "--own"],
        ["search", "CLIP", "--from", "0.2s", "--to", "30", "--json"],
        ["search", "CLIP", "--method", "moves"],
        ["search", "CLIP", "-k", "9", "--below", "0.9", "--dataset", "clips", "--recorded-only"],
        ["search", "--text", "LABEL", "--json"],
        ["search", "CLIP", "--text", "LABEL"],
        ["find", "CLIP", "--from", "0", "--to", "0.9s"],
        ["find", "CLIP", "--to", "40", "--method", "words", "--json", "--mirrored"],
        ["find", "CLIP", "--own", "-k", "30", "--json"],
    ],
    ids=" ".join,
)
def test_output_is_the_same(words: list[str], served: Path, asked: list[bool]) -> None:
    clip = clip_of(served)
    ((label, other),) = query(served, "SELECT any_value(label), max(clip) FROM clips WHERE label IS NOT NULL")
    meant = {"CLIP": clip.rpartition("/")[2], "OTHER": other, "LABEL": label}
    given = [meant.get(word, word) for word in words]
    found = motionlake(*given, "--lake", served)
    assert asked == [True]
    assert found.status == 0
    assert len(found.out.splitlines()) > 1
    assert same(found, here(given, served))
    assert asked == [True]  # --no-service asks none


@pytest.mark.parametrize(
    ("words", "status"),
    [
        (["search", "nobody"], 2),
        (["search", "CLIP", "--method", "nonsense"], 2),
        (["search", "CLIP", "--method", "moves", "--explain"], 2),
        (["search", "CLIP", "--from", "7000"], 2),
        (["search", "--text", "walk", "--own"], 2),
        (["search", "CLIP", "--min-quality", "ok"], 2),
        (["search", "CLIP", "--below", "2"], 0),  # more answers than a service gives
        (["search", "--sample", "1"], 0),
        (["find", "CLIP", "--to", "2"], 2),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_a_service_does_not_answer_is_done_here(
    words: list[str], status: int, served: Path, asked: list[bool]
) -> None:
    given = [clip_of(served) if word == "CLIP" else word for word in words]
    found = motionlake(*given, "--lake", served)
    assert True not in asked
    assert found.status == status
    assert same(found, here(given, served))


def test_files_are_read_here(
    served: Path, clips_folder: Path, asked: list[bool], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clip = query(served, "SELECT min(clip) FROM clips WHERE format = 'BVH' OR format = 'positions'")[0][0]
    file = clips_folder / clip.partition("/")[2]
    found = motionlake("search", str(file), "-k", 2, "--lake", served)
    assert asked == [False]
    assert same(found, here(["search", str(file), "-k", "2"], served))
    # A clip that is called as a file is: the notice is the same.
    (tmp_path / clip).parent.mkdir(parents=True)
    shutil.copy(file, tmp_path / clip)
    monkeypatch.chdir(tmp_path)
    both = motionlake("search", clip, "-k", 2, "--lake", served)
    assert asked == [False, True]
    assert "means the file" in both.err
    assert same(both, here(["search", clip, "-k", "2"], served))


def test_the_file_is_its_owner_s_alone_and_goes_with_the_service(lake: Path, asked: list[bool]) -> None:
    with browsing(lake) as process:
        told = lake / "service.json"
        assert told.stat().st_mode & 0o777 == 0o600
        assert json.loads(told.read_text())["process"] == process.pid
        assert motionlake("search", clip_of(lake), "--lake", lake).status == 0
        process.send_signal(signal.SIGTERM)
        process.wait(30)
        assert not told.exists()
    assert motionlake("search", clip_of(lake), "--lake", lake).status == 0
    assert asked == [True, False]
    assert [path.name for path in lake.iterdir() if "service" in path.name] == []


def test_a_service_that_was_killed_is_not_waited_for(lake: Path, asked: list[bool]) -> None:
    with browsing(lake) as process:
        process.kill()
        process.wait(30)
    assert (lake / "service.json").exists()
    assert announced(open_lake(lake)) is None
    found = motionlake("search", clip_of(lake), "--lake", lake)
    assert asked == [False]
    assert same(found, here(["search", clip_of(lake)], lake))


def test_another_catalog_is_not_answered_of(served: Path, tmp_path: Path, asked: list[bool]) -> None:
    copied = Path(shutil.copytree(served, tmp_path / "copied"))
    assert announced(open_lake(copied)) is not None  # the file says what it said
    found = motionlake("search", clip_of(copied), "-k", 2, "--lake", copied)
    assert asked == [False]
    assert found.status == 0


def test_a_run_that_lands_is_noticed(lake: Path, asked: list[bool]) -> None:
    with browsing(lake):
        os.utime(lake / "catalog.duckdb")
        found = motionlake("search", clip_of(lake), "-k", 2, "--lake", lake)
        assert asked == [False]
        assert same(found, here(["search", clip_of(lake), "-k", "2"], lake))


@pytest.fixture
def told(lake: Path) -> Iterator[Callable[..., None]]:
    """Writes the announcement of a service into a lake as the tests want it."""
    made = Announcement.of("http://127.0.0.1:9/", TOKEN)

    def tell(mode: int = 0o600, text: str | None = None, **other: Any) -> None:
        (lake / "service.json").write_text(text or json.dumps({**made.__dict__, **other}))
        (lake / "service.json").chmod(mode)

    return tell  # type: ignore[return-value]


def gone() -> int:
    with subprocess.Popen([sys.executable, "-c", ""]) as process:
        process.wait()
    return process.pid


@pytest.mark.parametrize(
    "fault",
    [
        {"process": gone()}, {"machine": "another, or started since"}, {"host": "example.org"}, {"mode": 0o644},
        {"port": "9"}, {"port": 1 << 20}, {"token": "a\nb"}, {"more": 1}, {"text": "[" * 4000}, {"text": "nonsense"},
        {"process": -1}, {"process": True},
    ],
    ids=" ".join,  # not the number of a process: all who collect tests must find the same
)  # fmt: skip
def test_what_no_service_wrote_is_not_believed(fault: dict[str, Any], lake: Path, told: Callable[..., None]) -> None:
    told()
    assert announced(open_lake(lake)) is not None
    told(**fault)
    assert announced(open_lake(lake)) is None


def test_neither_a_link_nor_a_pipe_is_followed(lake: Path, tmp_path: Path, told: Callable[..., None]) -> None:
    told()
    (lake / "service.json").rename(tmp_path / "elsewhere.json")
    (lake / "service.json").symlink_to(tmp_path / "elsewhere.json")
    assert announced(open_lake(lake)) is None
    (lake / "service.json").unlink()
    os.mkfifo(lake / "service.json", 0o600)
    assert announced(open_lake(lake)) is None


def test_a_later_service_keeps_its_file(lake: Path) -> None:
    target = open_lake(lake)
    first, later = (Announcement.of(f"http://127.0.0.1:{port}/", TOKEN) for port in (1001, 1002))
    with announcing(target, later):
        with announcing(target, first), announcing(target, later):
            pass
        with announcing(target, first):
            (lake / "service.json").write_text(json.dumps(later.__dict__))
        assert announced(target) == later
    assert not (lake / "service.json").exists()


class _Answer(BaseHTTPRequestHandler):
    def do_POST(self) -> None:
        self.rfile.read(int(self.headers["Content-Length"]))
        content: bytes = self.server.content  # type: ignore[attr-defined]
        if content == b"never":
            self.server.shutting.wait()  # type: ignore[attr-defined]
        self.send_response(200)
        self.send_header("Content-Length", str(len(content) + (content == b"cut")))
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_: object) -> None: ...


@pytest.mark.parametrize(
    "content",
    [b"", b"nonsense", b"[]", b"{}", b"cut", b"never", b"[" * 99999, b'{"answers": [], "notices": [], "clips": []}',
     b'{"answers": [[1]], "notices": [], "clips": ["a"]}', b'{"answers": [null], "notices": [], "clips": ["a"]}'],
    ids=lambda content: content[:50].decode(),
)  # fmt: skip
def test_whatever_a_service_answers_the_search_is_made(
    content: bytes, lake: Path, told: Callable[..., None], asked: list[bool], monkeypatch: pytest.MonkeyPatch
) -> None:
    from threading import Event

    monkeypatch.setattr(_service, "SECONDS", 0.5)
    with HTTPServer(("127.0.0.1", 0), _Answer) as server:
        server.content, server.shutting = content, Event()  # type: ignore[attr-defined]
        thread = Thread(target=server.serve_forever, daemon=True)
        thread.start()
        told(port=server.server_port)
        found = motionlake("search", clip_of(lake), "-k", 1, "--method", "signature", "--lake", lake)
        server.shutting.set()  # type: ignore[attr-defined]
        server.shutdown()
        thread.join()
    assert asked == [False]
    assert (found.status, found.err) == (0, "")


def test_nobody_at_the_port_or_a_wrong_token(served: Path, asked: list[bool]) -> None:
    lake, words = served, ["search", clip_of(served), "-k", "1", "--method", "signature"]
    kept = (lake / "service.json").read_text()
    with socket.create_server(("127.0.0.1", 0)) as sock:
        port = sock.getsockname()[1]
    try:
        for wrong in ({"port": port}, {"token": "another token"}):
            (lake / "service.json").write_text(json.dumps(json.loads(kept) | wrong))
            assert motionlake(*words, "--lake", lake).status == 0
    finally:
        (lake / "service.json").write_text(kept)
    assert motionlake(*words, "--lake", lake).status == 0
    assert asked == [False, False, True]


def test_a_service_reads_no_file_for_a_command(built_lake: Path, clips_folder: Path) -> None:
    file = next(path for path in clips_folder.rglob("*") if path.suffix in (".bvh", ".npz"))
    catalog = list(open_lake(built_lake).served())
    body: dict[str, Any] = {"catalog": catalog, "finds": "clip", "clips": [str(file)], "k": 1, "method": "fused"}
    with serving(built_lake) as client:
        assert client.post("/api/command", json=body).status_code == 400
        assert client.post("/api/command", json=body | {"clips": [f"../{file.name}"]}).status_code == 400
        assert client.post("/api/command", json=body | {"catalog": [1, 2]}).status_code == 409
        assert client.post("/api/command", json=body | {"clips": []}).status_code == 400
        assert client.post("/api/command", json=body | {"k": 10**9}).status_code == 422
        assert client.post("/api/command", json=body | {"clips": [clip_of(built_lake)]}).status_code == 200
    with serving(built_lake, token="wrong") as client:
        assert client.post("/api/command", json=body).status_code == 401
