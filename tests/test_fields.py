"""Numbers between delimiters: the kernel against Arrow's reader, on tidy and untidy tables."""

from __future__ import annotations

import re
from unittest.mock import patch

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from motionlake.errors import ClipError
from motionlake.formats.parse import delimited
from motionlake.formats.parse.delimited import read_columns
from motionlake.formats.parse.fbx_braces import open_braces

NUMBERS = st.one_of(
    st.floats(-1e6, 1e6).map(lambda value: f"{value:.6f}"),
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.integers(-(10**20), 10**20).map(str),
    st.sampled_from(["", "", " 1.5", "2 ", "-0.0", "1e5", ".5", "5.", "1e-320"]),
)
ODD = st.one_of(NUMBERS, st.sampled_from(["+1", " ", "nan", "x", '"1"', "1,2", "1\r", "--1", "1e400", "0x10", "\t3"]))
ENDS = st.sampled_from(["\n", "\r\n", "\n\n"])


def read(text: str, width: int, wanted: list[int], parted_by: str, *, by_arrow: bool) -> np.ndarray | str:
    usual = (lambda *_: None) if by_arrow else delimited._usual_columns
    with patch.object(delimited, "_usual_columns", usual):
        try:
            return read_columns(b"head\n" + text.encode(), 5, width, wanted, parted_by=parted_by)
        except ClipError as error:
            return str(error)


@given(st.data(), st.integers(1, 4), st.sampled_from([",", ";", "\t"]), st.booleans())
def test_the_kernel_reads_what_arrow_reads(data: st.DataObject, width: int, parted_by: str, odd: bool) -> None:
    rows = data.draw(
        st.lists(st.lists(ODD if odd else NUMBERS, min_size=width, max_size=width), min_size=1, max_size=4)
    )
    wanted = data.draw(st.lists(st.integers(0, width - 1), min_size=1, max_size=width, unique=True))
    end = data.draw(ENDS)
    text = end.join(parted_by.join(row) for row in rows) + data.draw(st.sampled_from(["", end]))
    ours, theirs = (read(text, width, wanted, parted_by, by_arrow=by_arrow) for by_arrow in (False, True))
    if isinstance(theirs, str) or isinstance(ours, str):
        assert isinstance(ours, str)
        assert ours == theirs
    else:
        np.testing.assert_array_equal(ours, theirs)


def test_a_tidy_table_needs_no_other_reader() -> None:
    text = b"1.5,2,,4\r\n-0.25, 3e2,x,5\r\n"
    found = delimited._usual_columns(text, 0, 4, [3, 0, 1], ",")
    assert found is not None
    np.testing.assert_array_equal(found, [[4, 1.5, 2], [5, -0.25, 300]])
    assert delimited._usual_columns(text, 0, 4, [2], ",") is None


WORDS = re.compile(rb'"[^"]*"|;[^\n]*')


@given(st.lists(st.sampled_from(list('"";{{}}\na')), max_size=30).map("".join))
def test_braces_in_words_and_remarks_are_none(text: str) -> None:
    plain = WORDS.sub(b"", text.encode())
    expected = plain.count(b"{") - plain.count(b"}")
    assert open_braces(np.frombuffer(text.encode(), np.uint8)) == expected
