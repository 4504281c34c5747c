"""The rows of an answer, as Python, Arrow, pandas or polars have them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final, overload

import pyarrow as pa
from motionlake.errors import UserError
from motionlake.names import html

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl


SHOWN: Final = 50  # rows that a notebook shows
LONGEST: Final = 80  # characters of a value there
NESTED: Final = 30  # of a list or the like


class Rows(Sequence[dict[str, Any]]):
    """The rows of a table: a sequence of dictionaries, or a data frame of your choice.

    Examples:
        >>> rows = lake.sql("SELECT clip, frames FROM clips ORDER BY frames LIMIT 2")
        >>> len(rows)
        2
        >>> rows[0]
        {'clip': 'clips/humanoid3d_walk.txt', 'frames': 60}
        >>> [row["frames"] for row in rows]
        [60, 70]
        >>> rows.df().shape  # pandas; .pl() is polars, .arrow() Arrow
        (2, 2)
    """

    def __init__(self, table: pa.Table) -> None:
        self._table = _with_whole_numbers(table)
        self._rows: list[dict[str, Any]] | None = None

    @classmethod
    def of(cls, rows: Iterable[Mapping[str, Any]]) -> Rows:
        """Rows of dictionaries; a key that one of them lacks is None there."""
        known = [dict(row) for row in rows]
        names = dict.fromkeys(name for row in known for name in row)
        return cls(pa.Table.from_pylist([{name: row.get(name) for name in names} for row in known]))

    @property
    def columns(self) -> list[str]:
        """Names of the columns, in their order."""
        return list(self._table.column_names)

    def arrow(self) -> pa.Table:
        """The rows as an Arrow table."""
        return self._table

    def df(self) -> pd.DataFrame:
        """The rows as a pandas data frame.

        Raises:
            UserError: pandas is not installed.
        """
        with _installed("df", "pandas"):
            import pandas  # noqa: F401
        return self._table.to_pandas()

    def pl(self) -> pl.DataFrame:
        """The rows as a polars data frame.

        Raises:
            UserError: polars is not installed.
        """
        with _installed("pl", "polars"):
            import polars
        frame = polars.from_arrow(self._table)
        assert isinstance(frame, polars.DataFrame)
        return frame

    def fetchall(self) -> list[tuple[Any, ...]]:
        """The rows as tuples, as DuckDB's `fetchall` gives them."""
        return [tuple(row.values()) for row in self._dictionaries()]

    def __len__(self) -> int:
        return int(self._table.num_rows)

    @overload
    def __getitem__(self, at: int) -> dict[str, Any]: ...
    @overload
    def __getitem__(self, at: slice) -> list[dict[str, Any]]: ...
    def __getitem__(self, at: int | slice) -> dict[str, Any] | list[dict[str, Any]]:
        return self._dictionaries()[at]

    def __repr__(self) -> str:
        return f"<{len(self)} row{'s' * (len(self) != 1)}: {', '.join(self.columns)}>"

    def _repr_html_(self) -> str:
        """A table of the first rows, for notebooks."""
        return rows_html(self._table)

    def _dictionaries(self) -> list[dict[str, Any]]:
        if self._rows is None:
            self._rows = self._table.to_pylist(maps_as_pydicts="strict")
        return self._rows


def rows_html(table: pa.Table, added: Sequence[tuple[str, Sequence[str]]] = (), caption: str = "") -> str:
    """The first 50 rows as a table of HTML.

    Args:
        table: names of columns and values may hold anything; they are escaped.
        added: columns before those of the table, their names and their cells of HTML, a cell a row.
        caption: HTML above it.
    """
    shown = table.slice(0, SHOWN).to_pylist(maps_as_pydicts="strict")
    head = "".join(f"<th>{html(name)}</th>" for name in [*(name for name, _ in added), *table.column_names])
    body = [
        "".join(f"<td>{cells[at]}</td>" for _, cells in added)
        + "".join(f"<td>{html(_said(value))}</td>" for value in row.values())
        for at, row in enumerate(shown)
    ]
    more = f"<p>{SHOWN} of {table.num_rows} rows</p>" if table.num_rows > SHOWN else ""
    lines = "".join(f"<tr>{line}</tr>" for line in body)
    above = f'<caption style="text-align:left">{caption}</caption>' if caption else ""
    found = f"<table>{above}<thead><tr>{head}</tr></thead><tbody>{lines}</tbody></table>{more}"
    return f'<div style="overflow-x:auto">{found}</div>'


def _said(value: object) -> str:
    if value is None:
        return ""
    text = f"{value:.4g}" if isinstance(value, float) else str(value)
    most = NESTED if isinstance(value, list | dict) else LONGEST
    return text if len(text) <= most else f"{text[: most - 1]}…"


def _with_whole_numbers(table: pa.Table) -> pa.Table:
    """Sums of whole numbers come from DuckDB as decimals of 38 digits; those that 64 bits hold become int64."""
    for at, column in enumerate(table.schema):
        if pa.types.is_decimal(column.type) and column.type.scale == 0:
            try:
                table = table.set_column(at, column.name, table.column(at).cast(pa.int64()))
            except pa.ArrowInvalid:
                continue
    return table


@contextmanager
def _installed(method: str, package: str) -> Iterator[None]:
    try:
        yield
    except ImportError as error:
        todo = "get it with `pip install 'motionlake[frames]'`"
        raise UserError(f"{method}(): {package} is not installed; {todo}") from error
