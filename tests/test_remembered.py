"""What is remembered of files and folders follows every change on disk."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest
from motionlake.formats import read_clips
from motionlake.formats.remembered import Remembered

from tests.test_asf_amc import AMC, ASF, write


@pytest.fixture
def settled(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if the files had been written ten seconds ago."""
    now = time.time_ns
    monkeypatch.setattr(time, "time_ns", lambda: now() + 10_000_000_000)


def counted(size: int = 8) -> tuple[Remembered[str], list[Path]]:
    calls: list[Path] = []

    def read(path: Path) -> str:
        calls.append(path)
        return path.read_text()

    return Remembered(read, size), calls


@pytest.mark.usefixtures("settled")
def test_an_unchanged_file_is_read_once_and_a_changed_one_again(tmp_path: Path) -> None:
    recall, calls = counted()
    path = tmp_path / "a"
    path.write_text("one")
    assert [recall(path), recall(path)] == ["one", "one"]
    assert len(calls) == 1
    # Replaced by a file of the same size and time, as a restored backup would.
    stat = path.stat()
    (tmp_path / "b").write_text("two")
    os.utime(tmp_path / "b", ns=(stat.st_atime_ns, stat.st_mtime_ns))
    (tmp_path / "b").replace(path)
    assert recall(path) == "two"


def test_what_changed_just_now_is_not_kept_for_it_may_change_again_unseen(tmp_path: Path) -> None:
    recall, calls = counted()
    (tmp_path / "a").write_text("one")
    assert [recall(tmp_path / "a"), recall(tmp_path / "a")] == ["one", "one"]
    assert len(calls) == 2


@pytest.mark.usefixtures("settled")
def test_no_more_is_kept_than_asked_for_and_no_failure(tmp_path: Path) -> None:
    recall, calls = counted(size=2)
    for name in "abcab":
        (tmp_path / name).touch()
        recall(tmp_path / name)
    assert len(calls) == 5
    for _ in range(2):
        with pytest.raises(FileNotFoundError):
            recall(tmp_path / "none")


@pytest.mark.usefixtures("settled")
def test_a_skeleton_that_changes_or_appears_is_noticed(tmp_path: Path) -> None:
    path = write(tmp_path, AMC.replace("a b.ASF", "elsewhere.asf"))
    assert read_clips(path)[0].hierarchy.offsets[2, 0] == 3
    assert read_clips(path)[0].hierarchy.offsets[2, 0] == 3
    time.sleep(0.02)
    write(tmp_path, path.read_text("latin-1"), ASF.replace("length 3", "length 4"))
    assert read_clips(path)[0].hierarchy.offsets[2, 0] == 4
    time.sleep(0.02)
    (tmp_path / "clip.asf").write_text(ASF.replace("length 3", "length 5"))
    assert read_clips(path)[0].hierarchy.offsets[2, 0] == 5
    (tmp_path / "clip.asf").unlink()
    time.sleep(0.02)
    assert read_clips(path)[0].hierarchy.offsets[2, 0] == 4
