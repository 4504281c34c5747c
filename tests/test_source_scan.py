"""Which clip files a source folder holds: found by strings, as a look at every file by itself finds them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.errors import ClipError
from motionlake.formats import clip_by_name, companions, is_clip, readers
from motionlake.lake.layout import Lake
from motionlake.names import kept
from motionlake.stages.sources import SourceFile, scan

ENDINGS = sorted({suffix for reader in readers() for suffix in reader.suffixes} | {".asf", ".bin", ".gz", "."})
NAMES = st.builds(
    "".join, st.tuples(st.sampled_from(["a", "a b", ".a", "A.bvh", "é", ""]), st.sampled_from(ENDINGS),
                       st.sampled_from(["", ".gz", ".GZ", "x"]))
)  # fmt: skip


def looked_at(root: Path, lake: Lake) -> dict[str, SourceFile]:
    """By path, what `scan` is to find: an oracle that asks every file."""
    found = {}
    for path in root.rglob("*"):
        relative = path.relative_to(root)
        hidden = any(part.startswith(".") for part in relative.parts) or path.is_relative_to(lake.root)
        if hidden or path.is_dir() or not is_clip(path):
            continue
        try:
            more = companions(path)
        except ClipError:
            more = []
        try:
            stats = [file.stat() for file in (path, *more)]
            size, newest = sum(s.st_size for s in stats), max(s.st_mtime_ns for s in stats)
        except OSError:
            size = newest = 0
        found[kept(relative)] = SourceFile(kept(relative), size, newest)
    return found


def test_a_folder_of_every_kind_of_file_is_scanned_as_each_file_tells(tmp_path: Path) -> None:
    lake = Lake(tmp_path / "clips" / "lake")
    for folder in ("", "walks", ".hidden", "walks/deep", "lake/frames"):
        (tmp_path / "clips" / folder).mkdir(parents=True, exist_ok=True)
        for number, ending in enumerate(ENDINGS):
            path = tmp_path / "clips" / folder / f"a{ending}"
            path.write_bytes(b"x" * number)
            os.utime(path, ns=(10**9 * number, 10**9 * number))
    walks = tmp_path / "clips" / "walks"
    (walks / "B.BVH").write_bytes(b"HIERARCHY")
    (walks / "b.bvh.gz").write_bytes(b"")
    (walks / "subject.asf").write_bytes(b"of two takes")
    (walks / "subject_01.amc").write_bytes(b"a take")
    (walks / ".c.bvh").write_bytes(b"")
    (walks / "lost.bvh").symlink_to(tmp_path / "nothing")
    (walks / "again").symlink_to(walks / "deep", target_is_directory=True)
    (walks / os.fsdecode(b"take\xe9.bvh")).write_bytes(b"")
    found = list(scan(tmp_path / "clips", lake))
    assert {file.path: file for file in found} == looked_at(tmp_path / "clips", lake)
    assert len(found) == len({file.path for file in found})
    assert "walks/lost.bvh" in {file.path for file in found}
    assert not any(file.path.startswith(("lake/", ".hidden/", "walks/again/")) for file in found)
    takes = [file for file in found if file.path == "walks/subject_01.amc"]
    assert [file.size for file in takes] == [len(b"of two takes") + len(b"a take")]


def test_one_file_is_a_source_with_its_companions(tmp_path: Path) -> None:
    (tmp_path / "subject.asf").write_bytes(b"of two takes")
    (tmp_path / "subject_01.amc").write_bytes(b"a take")
    (file,) = scan(tmp_path / "subject_01.amc", Lake(tmp_path / "lake"))
    assert (file.path, file.size) == ("subject_01.amc", 18)


def test_a_folder_that_cannot_be_listed_is_said(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        list(scan(tmp_path / "none", Lake(tmp_path / "lake")))


@given(NAMES)
def test_a_name_that_tells_is_not_looked_at(name: str) -> None:
    """Where the name tells, a file that is not there is told of alike; and it has no companions."""
    told, path = clip_by_name(name), Path("nowhere") / (name or "x")
    if told is not None:
        assert told == is_clip(path)
    if told:
        assert not companions(path)


def test_bvh_and_c3d_are_told_by_their_names_and_csv_is_not() -> None:
    assert clip_by_name("a.BVH")
    assert clip_by_name("a.c3d.gz")
    assert clip_by_name("a.csv") is None
    assert clip_by_name("a.amc") is None
    assert clip_by_name("a.asf") is False
    assert clip_by_name("bvh") is False
