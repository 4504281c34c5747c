"""Pieces of a shortlist: rows of clips, in files of several runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.errors import DamagedError
from motionlake.lake import integrity
from motionlake.lake.file_list import sums_of
from motionlake.lake.layout import Lake
from motionlake.stages.shortlist_files import file_of
from motionlake.stages.shortlist_pieces import Kind, Pieces, PieceWriter, RowPlaces, serving

KIND = Kind("rows", ".rows", ("piece", "start", "count", "crc32"), np.dtype(("<f4", (3,))))


@given(st.permutations(range(12)), st.lists(st.text("0123456789abcdef", min_size=16, max_size=16), min_size=12))
def test_pieces_are_told_by_their_numbers(order: list[int], keys: list[str]) -> None:
    """Those of earlier runs have other keys."""
    files = [file_of(keys[number], KIND.file(number)) for number in range(12)]
    assert KIND.among([*(files[number] for number in order), "shortlist/key-clips.arrow"]) == files


@pytest.fixture
def written(tmp_path: Path) -> tuple[Lake, list[str], pa.Table, list[np.ndarray]]:
    """Rows of seven clips, two in each of three pieces, whose keys are in no order, and one without any."""
    lake, places, rng = Lake(tmp_path), RowPlaces.empty(7), np.random.default_rng(2)
    rows = [rng.normal(size=(count, 3)).astype(np.float32) for count in (4, 1, 3, 0, 2, 5, 1)]
    files = []
    for number, (key, clips) in enumerate((("f" * 16, (5, 0)), ("0" * 16, (1, 6)), ("c" * 16, (2, 4)))):
        with PieceWriter(lake, file_of(key, KIND.file(number)), number, places) as writer:
            for clip in clips:
                writer.add(clip, rows[clip])
        files.append(writer.file)
    return lake, files[::-1], pa.table(places.columns(KIND)), rows


def test_rows_of_clips_are_theirs(written: tuple[Lake, list[str], pa.Table, list[np.ndarray]]) -> None:
    lake, files, table, rows = written
    with integrity.given([sums_of(lake, file) for file in files]):
        pieces = Pieces(lake, files, table, KIND)
        for asked in ([0], [1, 6], [6, 0, 2], [3], [3, 5, 3], list(range(7))):
            for clip, found in zip(asked, pieces.of(np.array(asked)), strict=True):
                np.testing.assert_array_equal(found, rows[clip])
        pieces.check_all()


def test_damage_to_a_clip_is_told(written: tuple[Lake, list[str], pa.Table, list[np.ndarray]]) -> None:
    lake, files, table, rows = written
    sums, path = [sums_of(lake, file) for file in files], lake.path(KIND.among(files)[1])
    content = path.read_bytes()
    path.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    with integrity.given(sums):
        pieces = Pieces(lake, files, table, KIND)
        np.testing.assert_array_equal(pieces.of(np.array([1]))[0], rows[1])
        for ask in (lambda: pieces.of(np.array([0, 6])), pieces.check_all):
            with pytest.raises(DamagedError, match=path.name):
                ask()


def test_which_pieces_go_on_serving() -> None:
    """The first ones, where most rows are of clips that stay; small ones at the end are written with what comes."""
    places = RowPlaces.of(
        pa.table({
            "piece": np.array([0, 0, 0, 0, 0, 0, 1, 2], np.int32), "start": np.zeros(8, np.int64),
            "count": np.full(8, 10, np.int32), "crc32": np.zeros(8, np.uint32),
        }), KIND,
    )  # fmt: skip
    every = np.arange(8)
    assert serving([60, 10, 10], places, every, 0) == 3
    assert serving([60, 10, 10], places, every, 1) == 1
    assert serving([60, 10, 10], places, every[:4], 0) == 0, "half of the rows are of clips that left"
    assert serving([], places, every, 0) == 0
