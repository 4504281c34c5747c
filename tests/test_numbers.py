"""The number kernel against Python's `float`, which is correctly rounded."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from motionlake.errors import ClipError
from motionlake.formats.parse.numbers import parse_table

signs = st.sampled_from(["", "-", "+"])
digits = st.text("0123456789", max_size=24)
exponents = st.one_of(st.just(""), st.integers(-345, 310).map(lambda e: f"e{e}"))


@st.composite
def written_numbers(draw: st.DrawFn) -> str:
    whole, fraction = draw(digits), draw(digits)
    point = "." if fraction else draw(st.sampled_from(["", "."]))
    text = f"{draw(signs)}{whole}{point}{fraction}"
    return (text if whole or fraction else text.replace(".", "") + "0") + draw(exponents)


@st.composite
def halfway_numbers(draw: st.DrawFn) -> str:
    """The exact decimal expansion of the middle between two neighbouring floats, and its neighbours."""
    mantissa = draw(st.integers(2**52, 2**53 - 1))
    shift = draw(st.integers(-8, 10))
    middle = (2 * mantissa + 1) * 2 ** max(shift, 0) * 10 ** (12 if shift < 0 else 0) // 2 ** max(-shift, 0)
    nudge = draw(st.integers(-1, 1))
    return f"{middle + nudge}{'e-12' if shift < 0 else ''}"


@settings(max_examples=600, deadline=None)
@given(st.one_of(written_numbers(), halfway_numbers(), st.floats(allow_nan=False, allow_infinity=False).map(repr)))
@example(".0083333")
@example("-0")
@example("9007199254740993")
@example("9007199254740993e22")
@example("1.7976931348623157e308")
@example("2.2250738585072011e-308")
@example("5e-324")
@example("1e-400")
@example("0e999999999999")
def test_numbers_are_correctly_rounded(text: str) -> None:
    expected = float(text)
    data = f"{text}\t1\r\n2 {text}".encode()
    if not np.isfinite(expected):
        with pytest.raises(ClipError, match=r"line 1: .*not a finite number"):
            parse_table(data, 0, 2, 2)
        return
    table = parse_table(data, 0, 2, 2)
    assert table.tolist() == [[expected, 1.0], [2.0, expected]]
    assert np.signbit(table[0, 0]) == np.signbit(np.float64(expected))


@settings(max_examples=200, deadline=None)
@given(st.text("0123456789+-.eExX_naif,", min_size=1, max_size=8))
def test_a_token_is_read_as_python_reads_it_or_refused(token: str) -> None:
    try:
        expected = float(token) if "_" not in token else None
    except ValueError:
        expected = None
    if expected is None or not np.isfinite(expected):
        with pytest.raises(ClipError) as caught:
            parse_table(f"\n1\n{token}\n".encode(), 0, 2, 1)
        assert caught.value.line == 3
    else:
        assert parse_table(f"\n1\n{token}\n".encode(), 0, 2, 1)[1, 0] == expected


@pytest.mark.parametrize(
    ("text", "line", "reason"),
    [
        ("1 2\n3\n", 2, "has 1 values, not 2"),
        ("1 2\n3 4 5\n", 2, "more than 2 values"),
        ("1 2\n\n3 4\n5 6\n", 4, "more rows than the 2 declared"),
        ("1 2\n", None, "2 rows declared, 1 found"),
        ("", None, "2 rows declared, 0 found"),
        ("1 2\n3 x\n", 2, "'x' is not a finite number"),
        ("1 2\n3 " + "4" * 100_000 + "\n", 2, "not a finite number"),
    ],
)
def test_a_table_of_another_shape_is_refused_with_its_line(text: str, line: int | None, reason: str) -> None:
    with pytest.raises(ClipError, match=reason) as caught:
        parse_table(text.encode(), 0, 2, 2)
    assert caught.value.line == line


def test_a_wild_number_of_rows_costs_no_memory() -> None:
    with pytest.raises(ClipError, match="found"):
        parse_table(b"1 2\n" * 10, 0, 10**15, 2)
