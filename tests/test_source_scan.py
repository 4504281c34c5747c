"""Which clip files a source folder holds, and which of them differ from what the lake knows: as naive oracles say."""

from __future__ import annotations

import os
from pathlib import Path
from random import Random
from typing import Any

import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.errors import ClipError, UserError
from motionlake.formats import clip_by_name, companions, is_clip, readers
from motionlake.formats.limits_config import Limits
from motionlake.lake.catalog import create_catalog, load_rows, reading, writing
from motionlake.lake.layout import Lake
from motionlake.names import kept, on_disk
from motionlake.stages.source_files import LATEST, SourceFile, content_hash, scan
from motionlake.stages.sources import Difference, IngestOptions, Root, compare

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
    (walks / "c.bvh").mkdir()  # a folder that is named as the clips before it
    (walks / "c.bvh" / "d.bvh").write_bytes(b"HIERARCHY")
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


def test_a_date_that_the_catalog_cannot_hold_is_its_last(tmp_path: Path) -> None:
    (tmp_path / "a.bvh").write_bytes(b"")
    os.utime(tmp_path / "a.bvh", (0, 2**34 - 1))
    if (tmp_path / "a.bvh").stat().st_mtime_ns <= LATEST:
        pytest.skip("this file system has no such dates")
    (file,) = scan(tmp_path, Lake(tmp_path / "lake"))
    assert file.mtime_ns == LATEST


OTHER, SHAPED = "there", "shaped"


def by_hand(root: Path, known: list[dict[str, Any]], retried: set[str], *, checksum: bool) -> Difference | None:
    """What `compare` is to say, file by file: an oracle. None where a path is another folder's."""
    lake = {row["path"]: row for row in known}
    found = list(scan(root, Lake(root / "lake")))
    if any(lake[file.path]["root"] != str(root) for file in found if file.path in lake):
        return None
    changed, touched, again = [], [], []
    for file in found:
        old = lake.get(file.path)
        stands = old is not None and file.path not in retried and old["config_hash"] == SHAPED
        dated = old is not None and (old["size"], old["mtime_ns"]) == (file.size, file.mtime_ns)
        if stands and dated and not checksum:
            continue
        hashed = file._replace(content_hash=content_hash(root / on_disk(file.path)))
        same = old is not None and old["content_hash"] == hashed.content_hash
        if not (stands and same):
            changed.append(hashed)
            again += [old["config_hash"]] if old and same and old["config_hash"] != SHAPED else []
        elif not dated:
            touched.append(hashed)
    gone = sorted(path for path, row in lake.items() if row["root"] == str(root) and not (root / path).exists())
    return Difference(changed, touched, len(found) - len(changed), gone, len(again), again[0] if again else "")


@pytest.mark.parametrize("seed", range(40))
def test_a_folder_is_compared_with_the_lake_as_file_by_file(tmp_path: Path, seed: int) -> None:
    """Files of every state: new, as they were, touched, of other bytes, shaped otherwise, rejected, gone, another's."""
    rng = Random(seed)
    root, lake = tmp_path / "clips", Lake(tmp_path / "lake")
    (root / "é").mkdir(parents=True)
    known: list[dict[str, Any]] = []
    rejects: list[dict[str, Any]] = []
    for number in range(rng.choice((0, 1, 30))):
        path = rng.choice(("", "é/")) + f"ü{number}.bvh"
        (root / path).write_text(f"{number}" * (number + 1), encoding="utf-8")
        state = (root / path).stat()
        if rng.random() < 0.2:
            continue  # new
        size, date, content = state.st_size, state.st_mtime_ns, content_hash(root / path)
        known.append({
            "dataset": "made", "path": path, "root": str(root), "part": "",
            "size": size + (rng.random() < 0.1), "mtime_ns": date + (rng.random() < 0.2),
            "content_hash": rng.choice((content, content, content, "other")),
            "config_hash": rng.choice((SHAPED, SHAPED, SHAPED, "otherwise")),
        })  # fmt: skip
        if rng.random() < 0.2:
            rejects.append({"dataset": "made", "path": path, "line": None, "reason": "bad", "content_hash": content})
        if rng.random() < 0.1:
            (root / path).unlink()
    if known and seed % 8 == 0:
        known[rng.randrange(len(known))]["root"] = OTHER
    # Another dataset's rows are nothing to this one.
    rows = known + [{**row, "dataset": "other", "content_hash": "x", "size": 0} for row in known]
    create_catalog(lake)
    with writing(lake) as con:
        for name, entered in (("load_sources", rows), ("load_rejects", rejects)):
            if entered:
                load_rows(con, name, pa.Table.from_pylist(entered))
    for checksum, retry in ((False, False), (True, False), (False, True)):
        retried = {row["path"] for row in rejects} if retry else set()
        expected = by_hand(root, known, retried, checksum=checksum)
        asked = Root("made", str(root), IngestOptions())
        with reading(lake) as con:
            if expected is None:
                with pytest.raises(UserError, match="holds a clip of this path from"):
                    compare(con, lake, asked, SHAPED, Limits(), checksum=checksum, retry_failed=retry)
            else:
                assert compare(con, lake, asked, SHAPED, Limits(), checksum=checksum, retry_failed=retry) == expected
