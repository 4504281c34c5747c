"""Finding readers and loading bytes."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
from motionlake.errors import ClipError
from motionlake.formats import is_clip, load_bytes, read_clips, reader_for, registry
from motionlake.motion.clip import SourceClip

from tests.samples import deepmimic_frames, deepmimic_text
from tests.test_bvh import TIDY, read


@pytest.mark.parametrize("name", ["a.bvh", "a.BVH", "a.b.bvh.gz", "A.Bvh.GZ"])
def test_a_reader_is_found_by_suffix_whatever_its_case(name: str) -> None:
    reader = reader_for(Path(name))
    assert reader is not None
    assert reader.name == "BVH"


@pytest.mark.parametrize("name", ["a.asf", "a.gz", "bvh", "a.bvh.bak", ""])
def test_other_files_have_no_reader(name: str) -> None:
    assert reader_for(Path(name)) is None


def test_compressed_clips_are_read_and_damaged_ones_refused(tmp_path: Path) -> None:
    whole = gzip.compress(TIDY.encode())
    path = tmp_path / "x.bvh.gz"
    path.write_bytes(whole)
    np.testing.assert_array_equal(read_clips(path)[0].channels, read(TIDY).channels)
    for damaged in (whole[:-9], whole[:12], TIDY.encode(), whole[:60] + b"\xff" * 9 + whole[69:]):
        path.write_bytes(damaged)
        with pytest.raises(ClipError, match="gzip"):
            read_clips(path)


def test_what_is_longer_than_the_limit_is_refused_compressed_or_not(tmp_path: Path) -> None:
    bomb = tmp_path / "x.bvh.gz"
    bomb.write_bytes(gzip.compress(b"\0" * 30_000_000))
    plain = tmp_path / "x.bvh"
    plain.write_bytes(b"\0" * 1001)
    assert len(load_bytes(bomb, 30_000_000)) == 30_000_000
    for path in (bomb, plain):
        with pytest.raises(ClipError, match="larger than 1000 bytes"):
            load_bytes(path, 1000)


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "folder.bvh").mkdir()
    for name, reason in (("folder.bvh", "not a regular file"), ("none.bvh", "does not exist")):
        with pytest.raises(ClipError, match=reason):
            read_clips(tmp_path / name)


@pytest.mark.parametrize("timing", ["", "Frame Time:", "Frame Time: 0", "Frame Time: soon", "Frame Time: 1e-9"])
def test_a_rate_that_the_user_says_stands_in_place_of_a_bad_one(tmp_path: Path, timing: str) -> None:
    path = tmp_path / "x.bvh"
    path.write_text(TIDY.replace("Frame Time: .0083333\n", timing and f"{timing}\n"))
    with pytest.raises(ClipError, match="say --fps") as caught:
        read_clips(path)
    assert caught.value.line == 18
    (clip,) = read_clips(path, fps=60.0)
    assert clip.fps == 60.0
    np.testing.assert_array_equal(clip.channels, read(TIDY).channels)


def test_a_rate_outside_what_any_clip_may_have_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.bvh").write_text(TIDY)
    with pytest.raises(ClipError, match=r"frame rate 0\.5/s is outside"):
        read_clips(tmp_path / "x.bvh", fps=0.5)


def test_a_reader_that_fails_unforeseen_makes_a_clip_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Broken:
        name = "broken"
        suffixes = (".broken",)

        def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
            raise IndexError("list index out of range")

    monkeypatch.setattr(registry, "readers", lambda: (Broken(),))
    (tmp_path / "x.broken").write_bytes(b"x")
    with pytest.raises(ClipError, match="IndexError"):
        read_clips(tmp_path / "x.broken")


def test_a_text_that_is_cut_within_its_gzip_stream_is_rejected_not_passed_over(tmp_path: Path) -> None:
    whole = gzip.compress(deepmimic_text(deepmimic_frames(20)).encode(), mtime=0)
    for size in (1, 9, 12, 30, len(whole) - 1):
        path = tmp_path / f"{size}.txt.gz"
        path.write_bytes(whole[:size])
        assert is_clip(path), size
        with pytest.raises(ClipError, match="gzip stream"):
            read_clips(path)
    notes = tmp_path / "notes.txt.gz"
    notes.write_bytes(gzip.compress(b"notes"))
    (tmp_path / "empty.txt.gz").touch()
    assert not is_clip(notes)
    assert not is_clip(tmp_path / "empty.txt.gz")
