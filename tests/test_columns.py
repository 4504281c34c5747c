"""Columns of tables as arrays, and files as tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from motionlake.columns import matrix_of, numbers, read_parquet


@pytest.mark.parametrize("kind", [pa.int32(), pa.int64(), pa.float32(), pa.float64()])
def test_numbers_of_pieces_are_those_of_pyarrow(kind: pa.DataType) -> None:
    pieces = [pa.array([1, 2, 3], kind), pa.array([], kind), pa.array([4, 5], kind).slice(1)]
    for column in (pa.chunked_array(pieces), pa.chunked_array(pieces[:1]), pa.chunked_array([], kind), pieces[2]):
        found = numbers(column)
        np.testing.assert_array_equal(found, column.to_numpy())
        assert found.dtype == column.to_numpy().dtype


def test_one_piece_is_not_copied_and_nothing_is_made_up() -> None:
    column = pa.array([1.0, 2.0, 3.0])
    assert numbers(column).ctypes.data == column.buffers()[1].address
    with pytest.raises(ValueError, match="1 values of a column are null"):
        numbers(pa.array([1.0, None]))


@pytest.mark.parametrize("kind", [pa.float32(), pa.float64()])
def test_a_matrix_has_its_columns_beside_each_other(kind: pa.DataType) -> None:
    rng = np.random.default_rng(1)
    columns = {name: pa.chunked_array([pa.array(rng.normal(size=n), kind) for n in (3, 4)]) for name in "abcd"}
    table = pa.table(columns)
    for rows in (table, table.slice(2, 3), table.slice(0, 0)):
        found = matrix_of(rows, ["d", "a"])
        np.testing.assert_array_equal(found, np.column_stack([rows.column(name).to_numpy() for name in "da"]))
        assert found.dtype == kind.to_pandas_dtype()
        assert found.flags.c_contiguous
        assert found.flags.writeable
    nulls = pa.table({"a": [1.0, None], "b": [1.0, 2.0]})
    np.testing.assert_array_equal(matrix_of(nulls, ["b"]), [[1.0], [2.0]])
    with pytest.raises(ValueError, match="1 values of columns are null"):
        matrix_of(nulls, ["a", "b"])


def test_a_file_is_read_in_the_order_that_is_asked_for(tmp_path: Path) -> None:
    table = pa.table({"a": [1, 2, 3], "b": ["x", "y", "z"], "c": [[1.0], [], [2.0, 3.0]]})
    pq.write_table(table, tmp_path / "t.parquet", row_group_size=2)
    assert read_parquet(tmp_path / "t.parquet").equals(table)
    assert read_parquet(tmp_path / "t.parquet", ["c", "a"]).equals(table.select(["c", "a"]))
