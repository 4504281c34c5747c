"""The SQL of the lake as package data: schema, views, queries and macros, one file a table or macro family."""

from __future__ import annotations

from functools import cache
from importlib.resources import files


@cache
def read(name: str) -> str:
    """The text of one .sql file, by its path below this package (for instance "queries/roots.sql")."""
    return files(__name__).joinpath(*name.split("/")).read_text(encoding="utf-8")


@cache
def names(folder: str) -> tuple[str, ...]:
    """The .sql files of a folder, in the order in which they must run (by name)."""
    entries = files(__name__).joinpath(folder).iterdir()
    return tuple(sorted(f"{folder}/{entry.name}" for entry in entries if entry.name.endswith(".sql")))
