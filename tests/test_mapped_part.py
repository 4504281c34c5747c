"""Parts that searches map: rows of some clips, of which alone the bytes are compared with what was written."""

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
from motionlake.stages.mapped_part import FOOT, HEAD, SUMS, MappedPart, lists_of, read_rows, rows_of_clips, write_mapped

FILE = "features/part.arrow"
COUNTS = {"walks/one.bvh": 3, "walks/two.bvh": 1, "runs/ünü.bvh": 4}


@pytest.fixture(scope="module")
def lake(tmp_path_factory: pytest.TempPathFactory) -> Lake:
    lake = Lake(tmp_path_factory.mktemp("mapped-part"))
    write_mapped(lake.path(FILE), rows(), "key")
    return lake


def rows() -> pa.Table:
    rng, count = np.random.default_rng(3), sum(COUNTS.values())
    clips = [clip for clip, frames in COUNTS.items() for _ in range(frames)]
    values = lists_of(rng.normal(size=(count, 5)).astype(np.float16))
    return pa.table({"clip": clips, "start": np.arange(count), "value": values})


def some(lake: Lake, *clips: str, name: str = "value") -> dict[str, np.ndarray]:
    with integrity.given([sums_of(lake, FILE)]):
        return rows_of_clips(lake, {FILE: set(clips)}, name)


def test_rows_of_some_clips_are_theirs(lake: Lake) -> None:
    every = {name: dict(read_rows(lake.path(FILE), name)) for name in ("start", "value")}
    for name, wanted in every.items():
        assert list(wanted) == list(COUNTS)
        for clip, count in COUNTS.items():
            (found,) = some(lake, clip, name=name).values()
            assert len(found) == count
            np.testing.assert_array_equal(found, wanted[clip])
    assert list(some(lake, "walks/one.bvh", "none.bvh")) == ["walks/one.bvh"]


def test_rows_of_many_large_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """More than are mapped at a time, each longer than what is read of its ends; the oracle reads all rows."""
    monkeypatch.setattr("motionlake.stages.mapped_part.TOGETHER", 2)
    lake, rng = Lake(tmp_path), np.random.default_rng(5)
    files = [f"features/{k}.arrow" for k in range(5)]
    for k, file in enumerate(files):
        clips = [f"{k}/{clip}" for clip in range(30) for _ in range(700)]
        values = lists_of(rng.normal(size=(len(clips), 3)).astype(np.float32))
        write_mapped(lake.path(file), pa.table({"clip": clips, "value": values}), "key")
        assert lake.path(file).stat().st_size > 2 * (HEAD + FOOT)
    wanted = {file: {f"{k}/0", f"{k}/{k + 7}", f"{k}/29"} for k, file in enumerate(files)}
    with integrity.given([sums_of(lake, file) for file in files]):
        found = rows_of_clips(lake, wanted, "value")
    every = {clip: rows for file in files for clip, rows in read_rows(lake.path(file), "value")}
    assert found.keys() == set().union(*wanted.values())
    for clip, rows in found.items():
        np.testing.assert_array_equal(rows, every[clip])


@given(st.data())
def test_a_damaged_byte_is_told_or_lies_elsewhere(lake: Lake, data: st.DataObject) -> None:
    """Whatever byte of the file is another one, the rows of a clip are what they were, or none are given."""
    path, clip = lake.path(FILE), data.draw(st.sampled_from(sorted(COUNTS)))
    whole, wanted = path.read_bytes(), some(lake, clip)[clip]
    at, by = data.draw(st.integers(0, len(whole) - 1)), data.draw(st.integers(1, 255))
    sums = sums_of(lake, FILE)
    try:
        path.write_bytes(whole[:at] + bytes([whole[at] ^ by]) + whole[at + 1 :])
        with integrity.given([sums]):
            found = rows_of_clips(lake, {FILE: {clip}}, "value")
        np.testing.assert_array_equal(found[clip], wanted)
    except DamagedError:
        pass
    finally:
        path.write_bytes(whole)


def test_damage_to_other_clips_is_not_looked_for(lake: Lake) -> None:
    path = lake.path(FILE)
    whole, part = path.read_bytes(), MappedPart.open(path)
    held = part.column("value")[part.runs["walks/two.bvh"]].tobytes()
    assert whole.count(held) == 1
    sums = sums_of(lake, FILE)
    path.write_bytes(whole.replace(held, bytes(byte ^ 1 for byte in held)))
    try:
        with integrity.given([sums]):
            assert list(rows_of_clips(lake, {FILE: {"walks/one.bvh"}}, "value")) == ["walks/one.bvh"]
            with pytest.raises(DamagedError, match=r"part\.arrow: holds other bytes"):
                rows_of_clips(lake, {FILE: {"walks/two.bvh"}}, "value")
    finally:
        path.write_bytes(whole)


def test_a_part_of_an_earlier_version_is_compared_whole(tmp_path: Path) -> None:
    lake = Lake(tmp_path)
    write_mapped(lake.path(FILE), rows(), "key")
    table = pa.ipc.open_file(lake.path(FILE)).read_all()
    before = table.replace_schema_metadata({k: v for k, v in table.schema.metadata.items() if k != SUMS.encode()})
    with pa.ipc.new_file(str(lake.path(FILE)), before.schema) as writer:
        writer.write_table(before)
    sums = sums_of(lake, FILE)
    assert len(some(lake, "walks/one.bvh")["walks/one.bvh"]) == 3
    whole = lake.path(FILE).read_bytes()
    held = MappedPart.open(lake.path(FILE)).column("value")[3:4].tobytes()
    lake.path(FILE).write_bytes(whole.replace(held, bytes(byte ^ 1 for byte in held)))
    with integrity.given([sums]), pytest.raises(DamagedError, match="holds other bytes"):
        rows_of_clips(lake, {FILE: {"walks/one.bvh"}}, "value")


def test_a_part_of_another_size_is_not_read(lake: Lake) -> None:
    path = lake.path(FILE)
    whole, sums = path.read_bytes(), sums_of(lake, FILE)
    path.write_bytes(whole[:-1])
    try:
        with integrity.given([sums]), pytest.raises(DamagedError, match="bytes where"):
            rows_of_clips(lake, {FILE: {"walks/one.bvh"}}, "value")
    finally:
        path.write_bytes(whole)
