"""`motionlake compact` killed wherever it renames a file, beside readers, and in lakes that are not up to date."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import sys
from pathlib import Path

from motionlake.lake.catalog import connect_read_only
from motionlake.lake.layout import open_lake
from motionlake.lake.space import blocks_of

from tests.lakes import Changed, assert_same, motionlake, on_cluster, query
from tests.processes import serve_forks
from tests.test_compact import NIGHTS, compact, lake, made, nights, rows
from tests.test_newer_models import newer
from tests.test_shortlist import few

__all__ = ["lake", "nights"]  # fixtures


def _die_at(renames: int, after: bool, folder: str) -> None:
    """Run compact in this process, and kill -9 it before or after so many renames of files."""
    from motionlake.cli.main import main

    rename, count = Path.replace, 0

    def counted(path: Path, target: Path) -> Path:
        nonlocal count
        count += 1
        if count == renames and not after:
            os.kill(os.getpid(), signal.SIGKILL)
        found = rename(path, target)
        if count == renames:
            os.kill(os.getpid(), signal.SIGKILL)
        return found

    Path.replace = counted  # type: ignore[method-assign, assignment]
    sys.argv = ["motionlake", "compact", "--lake", folder]
    main()


def died(root: Path, renames: int, *, after: bool) -> bool:
    """Whether a process that compacts a lake was killed at its so many-th rename."""
    serve_forks()
    process = multiprocessing.get_context("forkserver").Process(target=_die_at, args=(renames, after, str(root)))
    process.start()
    process.join(120)
    assert process.exitcode in (0, -signal.SIGKILL)
    return process.exitcode != 0


def test_killed_at_any_rename(lake: Path, tmp_path: Path) -> None:
    before = rows(lake)
    renames, alive = 1, True
    while alive:
        root = Path(shutil.copytree(lake, tmp_path / f"killed{renames}"))
        alive = died(root, renames, after=renames % 2 == 0)
        assert motionlake("verify", "--lake", root).status == 0
        assert_same(before, rows(root))
        assert compact(root)["parts"] in ([NIGHTS, 1], [0, 0])
        assert len(list(root.glob("frames/*/*"))) == 1
        assert_same(before, rows(root))
        assert not [path for path in root.rglob("*") if path.name.endswith(".tmp")]
        renames += 3
    assert renames > 15  # files, the catalog, its sums and its records


def test_readers_of_before_are_answered(lake: Path) -> None:
    asked = "SELECT clip, count(*) FROM frames GROUP BY clip ORDER BY clip"
    con = connect_read_only(open_lake(lake))
    found = con.execute(asked).fetchall()
    assert compact(lake)["parts"] == [NIGHTS, 1]
    assert len(list(lake.glob("frames/*/*.parquet"))) == NIGHTS + 1
    assert con.execute(asked).fetchall() == found == query(lake, asked)
    con.close()
    del con
    compact(lake)
    assert len(list(lake.glob("frames/*/*.parquet"))) == 1


def test_a_graph_that_is_due(lake: Path, scheduler: str) -> None:
    """What it tells of clips that stay is taken from it still, and what is made is what it would have been."""
    (first,) = query(lake, "SELECT min(clip) FROM clips")[0]
    assert motionlake("remove", first, "--for-good", "--lake", lake).status == 0
    near = "FROM clip_neighbours ORDER BY ALL"
    assert compact(lake)["parts"] == [NIGHTS, 1]
    merged = query(lake, near)
    assert merged
    assert made(lake, scheduler, "all") == 1
    assert made(lake, scheduler, "graph") == 0
    assert {row[:2] for row in query(lake, near)} == {row[:2] for row in merged}


def test_the_shortlist_of_a_large_lake(lake: Path, scheduler: str) -> None:
    with few():
        assert made(lake, scheduler, "shortlist") == 1
        (first,) = query(lake, "SELECT min(clip) FROM clips")[0]
        asked = ["search", first, "--json", "-k", 5, "--lake", lake]
        found = motionlake(*asked).json
        (size,) = query(lake, "SELECT bytes FROM manifest WHERE stage = 'shortlist'")[0]
        assert compact(lake)["parts"] == [NIGHTS, 1]
        assert made(lake, scheduler, "shortlist") == 0
        assert motionlake("verify", "--deep", "--lake", lake).status == 0
        assert motionlake(*asked).json == found
        assert query(lake, "SELECT bytes > $size / 2 FROM manifest WHERE stage = 'shortlist'", size=size) == [(True,)]


def test_parts_that_other_stages_name_stay(lake: Path, scheduler: str) -> None:
    assert made(lake, scheduler, "transitions") > 0
    run = motionlake("compact", "--lake", lake)
    assert run.out.startswith("nothing to merge")
    assert "3 small parts stay, since they are named by what `run neighbours` or `run transitions` made" in run.err


def test_vacuum(lake: Path, scheduler: str) -> None:
    before = rows(lake)
    newer(lake, "descriptors")
    with Changed(lake) as con:
        for text in (
            "CREATE TABLE gone AS SELECT random() AS number FROM range(3_000_000)",
            "UPDATE words SET start = start",  # written behind it, so that the file stays as long
            "DROP TABLE gone",
        ):
            con.execute(text)
            con.execute("CHECKPOINT")
    assert made(lake, scheduler, "all") > 0
    assert blocks_of(open_lake(lake)).many
    found = compact(lake, "--vacuum", "--keep", 1)
    assert found["models"] == []
    assert not blocks_of(open_lake(lake)).many
    found = compact(lake, "--vacuum", "--dry-run")
    assert found["models"] == ["descriptors-1"]
    shutil.copyfile(lake / "models/descriptors-1.safetensors", lake / "models/descriptors-0.safetensors")
    assert compact(lake, "--vacuum")["models"] == found["models"]
    assert query(lake, "SELECT model FROM models WHERE kind = 'descriptors'") == [("descriptors-2",)]
    assert [path.name for path in lake.glob("models/descriptors*")] == ["descriptors-1.safetensors"]  # of both
    assert motionlake("verify", "--deep", "--lake", lake).status == 0
    assert made(lake, scheduler, "all") == 0
    after = rows(lake)
    for name in ("frames", "words", "signatures", "symbol_strings", "clip_neighbours"):
        assert before[name] == after[name]
    run = on_cluster(["search", query(lake, "SELECT min(clip) FROM clips")[0][0], "--lake", lake], scheduler)
    assert run.status == 0, run.err
