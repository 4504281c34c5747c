"""Any program with DuckDB reads a lake: every table, every view, and the macros the docs call plain."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from motionlake.lake.frames import read_part

from tests.lakes import catalog, motionlake, query
from tests.samples import KINECT_1, KINECT_1_PARENTS, npz_bytes, swinging_body

TABLES = (
    "clips", "rejects", "segments", "manifest", "models", "runs", "roots", "sources", "layouts", "skeletons", "words",
    "motifs", "word_motifs", "signatures", "mirrored_signatures", "transitions", "frames", "embeddings",
    "rig_joints", "postures", "symbol_strings", "posture_distances", "descriptors", "submotion_parts", "submotions",
    "clip_neighbours", "synthetic", "schema_version", "files", "settings",
)  # fmt: skip


@pytest.mark.parametrize("table", TABLES)
def test_every_table_reads(built_lake: Path, table: str) -> None:
    rows = query(built_lake, f"SELECT count(*) FROM (SELECT * FROM {table})")
    assert rows[0][0] > 0 or table in ("rejects", "segments", "synthetic", "transitions")


def test_no_table_is_left_out(built_lake: Path) -> None:
    names = {r[0] for r in query(built_lake, "SELECT table_name FROM information_schema.tables")}
    assert names == set(TABLES)


def test_plain_macros(built_lake: Path) -> None:
    clip = query(built_lake, "SELECT min(clip) FROM clips")[0][0]
    stem = clip.rpartition("/")[2]
    assert query(built_lake, "FROM find_clip($name)", name=stem) == [(clip,)]
    shared = query(built_lake, "SELECT clip, shared FROM overlapping_motifs($clip, 5)", clip=clip)
    assert len(shared) == 5
    assert all(0 <= s <= 1 + 1e-6 for _, s in shared)
    assert query(built_lake, "FROM clip_segments($clip)", clip=clip) == []


def test_from_within_the_lake_nothing_has_to_be_set(built_lake: Path) -> None:
    text = (
        "import duckdb; con = duckdb.connect('catalog.duckdb', read_only=True); "
        "print(con.execute('SELECT count(*) FROM frames').fetchall()[0][0])"
    )
    found = subprocess.run(
        [sys.executable, "-c", text], cwd=built_lake, capture_output=True, text=True, check=True
    ).stdout
    assert int(found) == query(built_lake, "SELECT sum(frames) FROM clips")[0][0]


def test_frames_are_sorted_and_complete(built_lake: Path) -> None:
    for part in built_lake.glob("frames/dataset=*/*.parquet"):
        table = pq.read_table(part, columns=["clip", "frame"])
        rows = list(zip(table["clip"].to_pylist(), table["frame"].to_pylist(), strict=True))
        assert rows == sorted(rows)
    rows = query(built_lake, "SELECT clip, max(frame) + 1 FROM frames GROUP BY clip ORDER BY clip")
    assert rows == query(built_lake, "SELECT clip, frames FROM clips ORDER BY clip")


def test_frames_carry_their_rate(tmp_path: Path, scheduler: str) -> None:
    (tmp_path / "clips").mkdir()
    for fps in (25.0, 30.0, 59.94):
        clip = npz_bytes(swinging_body(40), KINECT_1, KINECT_1_PARENTS, fps)
        (tmp_path / "clips" / f"{fps}.npz").write_bytes(clip)
    lake = tmp_path / "lake"
    assert motionlake("ingest", tmp_path / "clips", "--lake", lake, "--scheduler", scheduler).status == 0
    rates = query(lake, "SELECT clip, fps FROM clips ORDER BY clip")
    assert [round(fps, 2) for _, fps in rates] == [25.0, 30.0, 59.94]
    assert query(lake, "SELECT DISTINCT clip, fps FROM frames ORDER BY clip") == rates
    stored = {clip.clip: clip.fps for part in lake.glob("frames/*/*.parquet") for clip in read_part(part)}
    assert stored == dict(rates)


def test_frame_columns_are_compressed_as_documented(built_lake: Path) -> None:
    part = next(built_lake.glob("frames/dataset=*/*.parquet"))
    group = pq.ParquetFile(part).metadata.row_group(0)
    for i in range(group.num_columns):
        column = group.column(i)
        assert column.compression == "ZSTD"
        if column.physical_type == "FLOAT":
            assert "BYTE_STREAM_SPLIT" in column.encodings


def test_labels_and_attributes(built_lake: Path) -> None:
    rows = query(built_lake, "SELECT label, subject, attributes['note'] FROM clips")
    assert all(label and note for label, _, note in rows)
    with catalog(built_lake) as con:
        kinds = dict(con.execute("SELECT rig, count(*) FROM clips GROUP BY rig").fetchall())
    assert len(kinds) == 3
