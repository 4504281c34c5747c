"""What PESTA's experiments found as tables of rows, without curves and confusions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

PARTS: Final = ("sub_queries", "holistic", "several_labels", "robustness", "sizes")
TITLES: Final = {"sizes": "m"}  # of the first column; by default the name of the part
LONG: Final = ("curve", "confusion", "map_by_class")
Row = dict[str, Any]


def tables(found: Mapping[str, Any]) -> list[list[Row]]:
    """A table of whole clips by method, then one of each other experiment, as `evaluate_pesta` found them."""
    whole = {name: rows for name, rows in found.items() if name not in PARTS}
    made = [_by_method("method", whole)]
    for part in PARTS:
        rows = found.get(part)
        if rows:
            made.append(_by_share(rows) if part == "robustness" else _by_method(TITLES.get(part, part), rows))
    return made


def _by_method(title: str, found: Mapping[str, Any]) -> list[Row]:
    rows = {name: row for name, row in found.items() if isinstance(row, Mapping)}
    return [{title: name, **{key: of for key, of in row.items() if key not in LONG}} for name, row in rows.items()]


def _by_share(found: Mapping[str, Any]) -> list[Row]:
    """MAP by the share of replaced pieces."""
    shares = next(iter(found.values()))
    return [{"replaced": share, **{method: rows[share]["map"] for method, rows in found.items()}} for share in shares]
