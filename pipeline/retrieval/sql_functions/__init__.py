"""Functions in SQL that are written in Python: every module here holds some, which `connect` finds by itself.

    @sql_function(columns(Hit, "rank", "clip", "distance"))
    def similar_clips(served: Served, query: str, k: int = 10) -> list[Hit]: ...

can be asked `FROM similar_clips('walk_01', k := 3)`. Names, defaults and types are those of the Python function. NULL
stands for the default where Python knows no None; without a default it gives no rows. A function that returns a number
is one that SQL calls for each row. Modules import what they need when they are first called: a connection that asks for
none of it opens as fast.
"""

from __future__ import annotations

import inspect
import pkgutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache, cached_property, partial
from importlib import import_module
from itertools import accumulate
from pathlib import Path
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Any, TypeAlias, Union, get_args, get_origin, get_type_hints

import pyarrow as pa
from motionlake.lake.catalog import Connection, connect_read_only, fetch, reading
from motionlake.lake.integrity import know, sound_folder
from motionlake.lake.layout import Lake, open_lake
from motionlake.lake.resolve import resolve_clip
from motionlake.lake.safe import LakeConnection, limit_memory, lock_down

if TYPE_CHECKING:
    from motionlake.retrieval.protocol import Finds, Query, Searcher

Columns: TypeAlias = Mapping[str, Any]  # a Python or an Arrow type by name
Names: TypeAlias = str | list[str]
REQUIRED = inspect.Parameter.empty
# What SQL and Arrow call the types of Python.
_SQL = {str: "VARCHAR", int: "BIGINT", float: "DOUBLE", bool: "BOOLEAN", list[str]: "VARCHAR[]", Names: "VARCHAR[]",
        list[int]: "INTEGER[]", list[float]: "FLOAT[]"}  # fmt: skip
_ARROW = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
_ARROW_IN_SQL = {pa.string(): "VARCHAR", pa.int64(): "BIGINT", pa.float64(): "DOUBLE", pa.bool_(): "BOOLEAN",
                 pa.int32(): "INTEGER", pa.float32(): "FLOAT"}  # fmt: skip


class Served:
    """What the functions of one connection share, read at first use and once.

    A function must not query the connection that calls it: it opens another with `reading(served.lake)`.
    """

    def __init__(self, lake: Lake, *, trusted: bool = True) -> None:
        self.lake, self._trusted = lake, trusted
        self.once = cache(lambda make, *arguments, **options: make(lake, *arguments, **options))

    def searcher(self, finds: Finds, name: str, /, **options: Any) -> Searcher:
        """A way to search, made once for the same options."""
        found: Searcher = self.once(_searcher, finds, name, **options)
        return found

    def query(self, name: str, start: int | None = None, stop: int | None = None) -> Query:
        """The clip of the lake that a name means, or the clip file where SQL is trusted to read files."""
        from motionlake.retrieval.protocol import Query, query_of

        if name in self._names:
            return Query(name, start, stop)
        with reading(self.lake) as con:
            if self._trusted:
                return query_of(con, name, start, stop)
            return Query(resolve_clip(con, name), start, stop)

    @cached_property
    def _names(self) -> set[str]:
        with reading(self.lake) as con:
            return {row["clip"] for row in fetch(con, "clip_names")}


def _searcher(lake: Lake, finds: Finds, name: str, **options: Any) -> Searcher:
    from motionlake.retrieval.registry import searcher

    return searcher(finds, name, lake, **options)


@dataclass(frozen=True)
class SqlFunction:
    """A function of `Served` and its arguments in SQL, and the columns of its rows; None: it returns a number.

    Its rows are a sequence of objects that have those attributes, or an Arrow array of structs.
    """

    answer: Callable[..., Any]
    columns: Columns | None


def sql_function(row: Columns | None = None) -> Callable[[Callable[..., Any]], SqlFunction]:
    """Let SQL know a function; `row`: the columns of the rows that it returns, without one it returns a number."""
    return lambda answer: SqlFunction(answer, row)


def columns(row: type, *names: str) -> dict[str, Any]:
    """Columns by the fields of a dataclass: those that are named, or all."""
    hints = get_type_hints(row)
    return {name: _plain(hints[name]) for name in names or hints}


def connect(lake: Path | str, *, trusted: bool = False, memory: str | None = None) -> LakeConnection:
    """Open a lake for questions in SQL: its tables, views, macros, and the functions of every module of this package.

    Close the connection to see what later runs have added: it reads the catalog as it stood when it was opened.

    SQL reads the lake and nothing else, and writes nowhere (`motionlake.lake.safe`; docs/security.md).

    Args:
        lake: its folder.
        trusted: SQL may read and write whatever this process may: every file, other databases, extensions.
        memory: most that DuckDB may use, such as "4GB"; by default four fifths of the machine's.

    Raises:
        UserError: there is no lake, its catalog is open for writing elsewhere, or `memory` is no size.
    """
    target = open_lake(lake)
    con, served = connect_read_only(target), Served(target, trusted=trusted)
    know(target, con)
    for module in pkgutil.iter_modules(__path__):
        for name, found in vars(import_module(f"{__name__}.{module.name}")).items():
            if isinstance(found, SqlFunction):
                _register(con, name, found.columns, partial(found.answer, served))
    con.create_function("sound_files", partial(_sound_files, target), ["VARCHAR"], "VARCHAR[]")
    if memory is not None:
        limit_memory(con, memory)
    if not trusted:
        lock_down(con, target.root.resolve())
    return LakeConnection(con, trusted=trusted)


def _sound_files(lake: Lake, folder: str) -> list[str]:
    return [str(path) for path in sound_folder(lake, folder)]


def _register(con: Connection, name: str, row: Columns | None, answer: Callable[..., Any]) -> None:
    """Make one function known to a connection, as a table of rows, or of `row` None as a number for each row."""
    import duckdb
    from duckdb.func import ARROW, SPECIAL

    parameters = _parameters(answer)
    types: Any = [duckdb.sqltype(_SQL[one.kind]) for one in parameters]
    arrow = {} if row is None else {column: _ARROW.get(kind, kind) for column, kind in row.items()}
    struct = pa.struct(list(arrow.items()))

    def each(*given: pa.ChunkedArray) -> pa.Array:
        found = []
        for values in zip(*(column.to_pylist() for column in given), strict=True):
            given_to = _arguments(parameters, values)
            found.append(None if given_to is None else answer(**given_to))
        if row is None:
            return pa.array(found, pa.float64())
        return _lists([_rows(rows or [], struct) for rows in found], struct)

    each.__signature__ = inspect.Signature(  # type: ignore[attr-defined]  # DuckDB counts the parameters
        [inspect.Parameter(one.name, inspect.Parameter.POSITIONAL_ONLY) for one in parameters]
    )
    called = name if row is None else f"{name}_rows"
    settings: Any = {"type": ARROW, "null_handling": SPECIAL}
    of_row = ", ".join(f'"{column}" {_in_sql(kind)}' for column, kind in arrow.items())
    result = "DOUBLE" if row is None else f"STRUCT({of_row})[]"
    if not fetch(con, "has_function", {"name": called}):
        con.create_function(called, each, types, duckdb.sqltype(result), **settings)
    if row is not None:
        con.execute(_macro(name, parameters))


@dataclass(frozen=True)
class _Parameter:
    """One argument in SQL; `part_of` names that of Python of which it is a field."""

    name: str
    hint: Any
    default: Any = REQUIRED
    part_of: tuple[str, type] | None = None

    @property
    def kind(self) -> Any:
        return _plain(self.hint)

    @property
    def required(self) -> bool:
        return self.default is REQUIRED


def _parameters(answer: Callable[..., Any]) -> list[_Parameter]:
    """The arguments of a function; an argument of a dataclass is one for each of its fields."""
    hints, found = get_type_hints(answer.func if isinstance(answer, partial) else answer), []
    for name, parameter in inspect.signature(answer).parameters.items():
        if is_dataclass(hints[name]):
            own = get_type_hints(hints[name])
            part_of = (name, hints[name])
            found += [
                _Parameter(each.name, own[each.name], REQUIRED if each.default is MISSING else each.default, part_of)
                for each in fields(hints[name])
            ]
        else:
            found.append(_Parameter(name, hints[name], parameter.default))
    return found


def _macro(name: str, parameters: Sequence[_Parameter]) -> str:
    """The table of the rows of a function, with its names and defaults."""
    taken = [f'"{one.name}"' + ("" if one.required else f" := {_literal(one.default)}") for one in parameters]
    given = [_cast(f'"{one.name}"', one.kind) for one in parameters]
    return (
        f"CREATE OR REPLACE TEMP MACRO {name}({', '.join(taken)}) AS TABLE "
        f"FROM (SELECT unnest({name}_rows({', '.join(given)}), max_depth := 2))"  # lists inside of rows stay
    )


def _cast(value: str, kind: Any) -> str:
    if kind == Names:  # one name is a list of one
        return f"coalesce(try_cast({value} AS VARCHAR[]), [{value}::VARCHAR])"
    return f"{value}::{_SQL[kind]}"


def _literal(value: object) -> str:
    return "NULL" if value is None else f"'{value}'" if isinstance(value, str) else str(value).lower()


def _in_sql(kind: pa.DataType) -> str:
    """What SQL calls a type of Arrow."""
    if pa.types.is_list(kind):
        return f"{_in_sql(kind.value_type)}[]"
    if pa.types.is_struct(kind):
        inside = ", ".join(f'"{field.name}" {_in_sql(field.type)}' for field in kind)
        return f"STRUCT({inside})"
    return _ARROW_IN_SQL[kind]


def _plain(hint: Any) -> Any:
    """A type without None."""
    if get_origin(hint) in (Union, UnionType) and hint != Names:
        rest = [kind for kind in get_args(hint) if kind is not NoneType]
        return rest[0] if len(rest) == 1 else Union[tuple(rest)]  # noqa: UP007 - of types that are known here only
    return hint


def _arguments(parameters: Sequence[_Parameter], values: Sequence[Any]) -> dict[str, Any] | None:
    """The arguments of a call; None where NULL stands for one that there must be."""
    found: dict[str, Any] = {}
    parts: dict[tuple[str, type], dict[str, Any]] = {}
    for one, value in zip(parameters, values, strict=True):
        if value is None and NoneType not in get_args(one.hint):
            if one.required:
                return None
            continue
        if one.kind in (Names, list[str]) and isinstance(value, list):
            value = [name for name in value if name is not None]
        (parts.setdefault(one.part_of, {}) if one.part_of else found)[one.name] = value
    return found | {name: kind(**values) for (name, kind), values in parts.items()}


def _rows(rows: Any, struct: pa.StructType) -> pa.StructArray:
    if isinstance(rows, pa.StructArray):
        return rows
    return pa.array([{field.name: _as_arrow(getattr(row, field.name)) for field in struct} for row in rows], struct)


def _as_arrow(value: Any) -> Any:
    """A sequence of objects as one of their fields."""
    return [vars(each) for each in value] if isinstance(value, tuple) else value


def _lists(rows: Sequence[pa.StructArray], struct: pa.StructType) -> pa.ListArray:
    """One list for each call."""
    ends = pa.array([0, *accumulate(map(len, rows))], pa.int32())
    return pa.ListArray.from_arrays(ends, pa.concat_arrays([pa.array([], struct), *rows]))
