"""Files that children of one server read: one after the other, each as if it were the first."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import pytest
from motionlake.errors import ClipError
from motionlake.formats.limits_config import Limits, within
from motionlake.formats.parse import own_process

# What a child does with a file: say who it is, end as a library in C would, never end, or find it wrong.
READER = """
import os, signal, time
from pathlib import Path
from motionlake.errors import ClipError
from motionlake.formats.parse.own_process import serve
read_before = []
def read(data, folder):
    assert not list(folder.iterdir())
    word = data.decode()
    if word == "crash" or (word == "crash later" and read_before):
        os.kill(os.getpid(), signal.SIGSEGV)
    if word == "hang":
        time.sleep(60)
    if word == "reject" or (word == "reject later" and read_before):
        raise ClipError(f"after {len(read_before)}")
    read_before.append(word)
    print("what a library prints")
    return [memoryview(f"{word} {os.getppid()} {os.getpid()}".encode())]
serve(read, lambda: None)
"""


@pytest.fixture
def ask(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):  # type: ignore[no-untyped-def]
    """Have the reader above read a word; what it says."""
    (tmp_path / "made_up_reader.py").write_text(READER)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *sys.path]))
    monkeypatch.setattr(own_process, "_waiting", {})

    def read(word: str) -> list[str]:
        return own_process.read_apart("made_up_reader", "the library", word.encode()).tobytes().decode().split()

    yield read
    for servers in own_process._waiting.values():
        for server, _ in servers:
            server.end()


def test_one_child_reads_many_files(ask) -> None:  # type: ignore[no-untyped-def]
    assert len({tuple(ask("good")) for _ in range(5)}) == 1


def test_a_file_that_ends_the_child_harms_no_other(ask) -> None:  # type: ignore[no-untyped-def]
    ask("good")
    for _ in range(2):
        with pytest.raises(ClipError, match="the library cannot read it: it ended while it read the file"):
            ask("crash")
        assert ask("good")[0] == "good"


def test_what_is_rejected_ends_the_child_and_not_the_server(ask) -> None:  # type: ignore[no-untyped-def]
    _, server, child = ask("good")
    with pytest.raises(ClipError, match="after 0"):  # by a child that has read nothing before
        ask("reject")
    _, same, other = ask("good")
    assert server == same
    assert child != other


@pytest.mark.parametrize("word", ["crash later", "reject later"])
def test_no_file_is_rejected_for_what_another_did(ask, word: str) -> None:  # type: ignore[no-untyped-def]
    ask("good")
    assert ask(word)[:2] == word.split()


def test_a_file_that_takes_too_long_is_rejected(ask) -> None:  # type: ignore[no-untyped-def]
    with within(Limits(seconds=1)), pytest.raises(ClipError, match=r"took more than 1 s to read; \[limits\] seconds"):
        ask("hang")
    assert ask("good")[0] == "good"


@pytest.mark.parametrize("word", ["good", "reject", "crash"])
def test_what_a_file_leaves_on_the_disk_goes_with_the_server(
    ask: Callable[[str], list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, word: str
) -> None:
    monkeypatch.setattr(own_process, "mkdtemp", lambda prefix: tempfile.mkdtemp(prefix=prefix, dir=tmp_path))
    with nullcontext() if word == "good" else pytest.raises(ClipError):
        ask(word)
    ask("good")
    [[(server, _)]] = own_process._waiting.values()
    assert list(tmp_path.glob("motionlake-*")) == [server.folder]
    server.end()
    assert not server.folder.exists()


def test_a_server_that_was_killed_while_it_waited_rejects_nothing(ask) -> None:  # type: ignore[no-untyped-def]
    _, server, child = ask("good")
    os.kill(int(server), signal.SIGKILL)
    os.kill(int(child), signal.SIGKILL)
    assert ask("good")[1] != server


def test_a_server_ends_with_its_parent(tmp_path: Path) -> None:
    (tmp_path / "made_up_reader.py").write_text(READER)
    program = (
        "from motionlake.formats.parse.own_process import read_apart\n"
        "print(read_apart('made_up_reader', '', b'good').tobytes().decode())\n"
    )
    path = os.pathsep.join([str(tmp_path), *sys.path])
    folders = tmp_path / "folders"
    folders.mkdir()
    ran = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PYTHONPATH": path, "TMPDIR": str(folders)},
    )
    ids = [int(word) for word in ran.stdout.split()[1:]]
    for _ in range(100):
        if not any(Path(f"/proc/{each}/cmdline").exists() for each in ids):
            assert not list(folders.iterdir())
            return
        os.sched_yield()
        signal.sigtimedwait([], 0.05)
    pytest.fail("it runs on")
