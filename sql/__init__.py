"""The SQL of the lake as package data.

`schema/`, `views/` and `macros/` hold one file a table or macro family; `queries/` holds the statements
that Python runs, by topic, each below a line `-- name: its_name`.
"""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files
from typing import Final

_NAME: Final = re.compile(r"^-- name: (\w+)\n", re.MULTILINE)


@cache
def read(name: str) -> str:
    """The text of a named statement ("roots"), or of a whole file by its path below this package ("views/frames.sql").

    Raises:
        KeyError: no statement has that name.
    """
    if name.endswith(".sql"):
        return files(__name__).joinpath(*name.split("/")).read_text(encoding="utf-8")
    return statements()[name]


@cache
def statements() -> dict[str, str]:
    """Every named statement of `queries/`.

    Raises:
        ValueError: two statements have one name, or text stands before the first name of a file.
    """
    found: dict[str, str] = {}
    for path in names("queries"):
        before, *pieces = _NAME.split(read(path))
        if before.strip():
            raise ValueError(f"sql/{path}: text before the first `-- name:` line")
        for name, text in zip(pieces[::2], pieces[1::2], strict=True):
            if name in found:
                raise ValueError(f"sql/{path}: a second statement is named {name}")
            found[name] = text
    return found


@cache
def names(folder: str) -> tuple[str, ...]:
    """The .sql files of a folder, in the order in which they must run (by name)."""
    entries = files(__name__).joinpath(folder).iterdir()
    return tuple(sorted(f"{folder}/{entry.name}" for entry in entries if entry.name.endswith(".sql")))
