"""What commands say: answers for people or machines, notices on stderr, CSV files."""

from __future__ import annotations

import csv
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from motionlake.cli._event_log import event
from motionlake.errors import UserError
from motionlake.names import json_text, printable

FORMULA: Final = ("=", "+", "-", "@", "\t", "\r")


def check_folder_of(file: Path) -> None:
    """Raises `UserError` where the folder of a file to write is not there."""
    if not file.parent.is_dir():
        raise UserError(f"{file.parent}: no such folder")


def write_csv(file: Path, columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Rows as CSV: every cell as it is, since labels.csv and other programs read it back.

    A notice tells of cells that a spreadsheet would run as formulas.

    Raises:
        UserError: the file cannot be written.
    """
    try:
        with file.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerow(columns)
            writer.writerows(rows)
    except OSError as error:
        raise UserError(f"{file}: cannot be written ({error.strerror})") from error
    formulas = sum(isinstance(v, str) and v.startswith(FORMULA) for row in rows for v in row)
    if formulas:
        notice(f"{file}: {formulas} cells begin as a formula does; have a spreadsheet read them as text")


def notice(line: str) -> None:
    """Tell a person something while a command runs."""
    event("notice", text=line)
    print(printable(line), file=sys.stderr, flush=True)


def tell(value: Any, shown: str | Sequence[Mapping[str, Any]] | None = None, *, as_json: bool) -> None:
    """The answer of a command: `value` as JSON for machines, else `shown` (default: `value`), a line or a table."""
    answer = value if shown is None else shown
    if as_json:
        print(json_text(value))
    elif isinstance(answer, str):
        print(printable(answer))
    elif answer:
        _print_table(answer)
    else:
        notice("no rows")


def _print_table(rows: Sequence[Mapping[str, Any]]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    for name, value in rows[0].items():
        table.add_column(
            printable(name), justify="right" if isinstance(value, int | float) else "left", overflow="fold"
        )
    for row in rows:
        table.add_row(*(_cell(v) for v in row.values()))
    width = None if sys.stdout.isatty() else 200
    console = Console(width=width, highlight=False, markup=False, emoji=False)
    with console.capture() as shown:
        console.print(table)
    print(shown.get(), end="")  # rich would end the program where nobody reads


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else printable(str(value))
