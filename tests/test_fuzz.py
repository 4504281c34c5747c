"""Few rounds of what `make fuzz` runs many of, and what such campaigns found."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from motionlake.errors import ClipError, UserError
from motionlake.formats import read_clips
from motionlake.lake.catalog import Connection
from motionlake.lake.config import load_config
from motionlake.retrieval.sql_functions import connect

from tests import fuzz
from tests.lakes import made_clips, motionlake, quick_lake
from tests.samples import KINECT_1, KINECT_1_PARENTS, SAMPLES, lacking, npz_bytes, swinging_body


@pytest.mark.parametrize("suffix", SAMPLES)
def test_damaged_samples_are_read_or_refused_in_words_for_people(suffix: str, tmp_path: Path) -> None:
    if reason := lacking(suffix):
        pytest.skip(reason)
    # USD starts a process a file; tests/test_usd.py reads 400 damaged files in one.
    fuzz.check_reader(suffix, tmp_path, 15 if suffix == ".usda" else 60)


def test_damaged_configurations_are_read_or_refused(tmp_path: Path) -> None:
    fuzz.check_config(tmp_path, 60)


def test_damaged_label_files_are_entered_or_refused(tmp_path: Path, scheduler: str) -> None:
    made_clips(tmp_path / "clips", 1)
    (tmp_path / "clips" / "labels.csv").unlink()
    lake = quick_lake(tmp_path / "lake")
    assert motionlake("ingest", tmp_path / "clips", "--lake", lake, "--scheduler", scheduler).status == 0
    fuzz.check_label_files(lake, tmp_path / "clips", 15)


def test_a_segment_past_all_numbers_is_one_line(tmp_path: Path, scheduler: str) -> None:
    made_clips(tmp_path / "clips", 1)
    (tmp_path / "clips" / "segments.csv").write_text(f"file,start,stop,label\nx.bvh,0,{'9' * 30},walk\n")
    run = motionlake("ingest", tmp_path / "clips", "--lake", quick_lake(tmp_path / "lake"), "--scheduler", scheduler)
    assert run.status == 1, "clips go in without their segments"
    assert f"segments.csv, line 2: start 0 and stop {'9' * 20} are no range of frames" in run.err


@pytest.fixture
def con(built_lake: Path) -> Iterator[Connection]:
    with connect(built_lake) as con:
        yield con.own


def test_functions_in_sql_answer_anything_with_rows_or_words_for_people(con: Connection) -> None:
    fuzz.check_sql_functions(con, 60, left_out=["synthesize"])


@pytest.mark.parametrize(
    "query",
    [
        "FROM similar_clips(repeat('x', 70000))",
        "FROM find_motion(chr(0) || 'x')",
        "SELECT emd([1.0], [2.0])",
        "FROM segment_clip('', teach := '[/red]', teach_clips := [NULL])",
        "FROM clips_like([NULL])",
        "SELECT emd_deep_motifs([], ['nan'::FLOAT])",
    ],
)
def test_a_query_that_no_clip_can_answer_is_the_users_mistake(con: Connection, query: str) -> None:
    fuzz.ask(con, query)


def test_the_words_of_a_program_are_told_from_those_for_people() -> None:
    assert not fuzz.fault_of_words("line 3: '1e308' is absurdly large")
    assert fuzz.fault_of_words("could not be processed (SystemError: invalid maximum character)")
    assert fuzz.fault_of_words("two\nlines")


@pytest.mark.parametrize("character", [0x7FFFFFFF, 0xD800])
def test_names_of_joints_that_are_no_text_are_refused(character: int, tmp_path: Path) -> None:
    """Such a name ended in a SystemError of the interpreter."""
    names = np.array([list(f"{name:16}".encode()) for name in KINECT_1], np.uint32)
    names[3, 2] = character
    with zipfile.ZipFile(io.BytesIO(npz_bytes(swinging_body(12), KINECT_1, KINECT_1_PARENTS, 30.0))) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<U16", "fortran_order": False, "shape": (20,)})
    members["joints.npy"] = header.getvalue() + names.astype("<u4").tobytes()
    with zipfile.ZipFile(tmp_path / "x.npz", "w") as target:
        for name, content in members.items():
            target.writestr(name, content)
    with pytest.raises(ClipError, match="names of joints that are no text"):
        read_clips(tmp_path / "x.npz")


@pytest.mark.parametrize(
    "content",
    [b"\xff", b"[frames]\nposition_step = " + b"1" * 400, b"[motifs]\nk = " + b"9" * 5000, b"x = " + b"[" * 9000],
)
def test_a_configuration_that_means_nothing_is_one_line(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "config.toml"
    path.write_bytes(content)
    with pytest.raises(UserError) as caught:
        load_config(path)
    assert not fuzz.fault_of_words(str(caught.value), 900)
