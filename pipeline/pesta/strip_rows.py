"""A strip's rows inside numba kernels: each cell from those before it, and what is carried along with its cost
(sections 6 and 7)."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from motionlake.pesta.vectors import LanesType, Window, constants_of, vector_of
from numba import types
from numba.extending import intrinsic

_INT64 = ir.IntType(64)


@intrinsic(prefer_literal=True)  # type: ignore[untyped-decorator]
def rows_above(
    typing: Any, ring: Any, columns: Any, row: Any, plane: Any, stride: Any, depth: Any, lanes: Any
) -> Any:  # fmt: skip
    """What `next_row` needs of the rows before a strip's second one: its first row, and none above it.

    ring: flat float32: the costs, and `depth` tables of what cells carry, `plane` places apart; columns[k]: where the
    column k steps back begins in it; row: the first row's place.

    Returns:
        (1 + depth) * stride * (stride + 1) / 2 vectors: of the row r rows back the cheapest of its last r + 1 cells,
        then its cells further back than r columns; of each its cost and what it carries.
    """
    constants = constants_of(stride, depth, lanes)
    if not constants:
        return None
    (w, carried, wide), kind = constants, LanesType(types.float32, constants[-1])
    tables = carried + 1

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        read = Window(context, builder, signature, arguments[:3], w, wide)
        places = [builder.mul(arguments[3], ir.Constant(_INT64, table)) for table in range(tables)]
        cells = [[read.cost(0, k, place) for place in places] for k in range(w + 1)]
        nothing = [ir.Constant(vector_of(kind), [float("inf")] * wide)] * tables
        above = [[_first_least(builder, cells[1], cells[0]), *cells[2:]]]
        above += [[nothing] * (w - r) for r in range(1, w)]
        return context.make_tuple(builder, signature.return_type, _flat(above))

    many = types.UniTuple(kind, tables * w * (w + 1) // 2)
    return many(ring, columns, types.intp, types.intp, stride, depth, lanes), emit


@intrinsic(prefer_literal=True)  # type: ignore[untyped-decorator]
def next_row(
    typing: Any, ring: Any, columns: Any, row: Any, plane: Any, stride: Any, depth: Any, distance: Any, above: Any,
    reach: Any, lanes: Any,
) -> Any:  # fmt: skip
    """Write a row's cell, the least W(m, n) + D * p over its window (section 6), and what the first of the best cells
    carries.

    row: the row's place; distance: D; above: `rows_above` or what this has returned of the row before; reach: how many
    rows above there are at most, a constant. Of equal cells the first in the order of `window_cells` is taken, then
    the fewest steps away.

    Returns:
        As `rows_above`, for the next row.
    """
    constants = constants_of(stride, depth, reach, lanes)
    if not constants:
        return None
    (w, carried, most, wide), kind = constants, LanesType(types.float32, constants[-1])
    tables = carried + 1

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        read = Window(context, builder, signature, arguments[:3], w, wide)
        places = [builder.mul(arguments[3], ir.Constant(_INT64, table)) for table in range(tables)]
        beside = [[read.cost(0, k, place) for place in places] for k in range(w + 1)]
        flat = iter([builder.extract_value(arguments[7], i) for i in range(tables * w * (w + 1) // 2)])
        rows = [[[next(flat) for _ in places] for _ in range(w - r)] for r in range(w)]  # the first is one row back
        ways = []
        for p in range(1, w + 1):
            cells = [rows[k - 1][p - k] for k in range(p, 0, -1) if k <= most]
            cost, *others = _first_of_all(builder, [*cells, beside[p]])
            ways.append([builder.fadd(cost, read.penalty(arguments[6], p)), *others])
        own = _first_of_all(builder, ways)
        for place, value in zip(places, own, strict=True):
            read.put(place, value)
        following = [[_first_least(builder, beside[1], own), *beside[2:]]]
        following += [
            [_first_least(builder, last, best), *further] if r <= most else [last, *further]
            for r, (best, last, *further) in enumerate(rows[:-1], 1)
        ]
        return context.make_tuple(builder, signature.return_type, _flat(following))

    many = types.UniTuple(kind, tables * w * (w + 1) // 2)
    return many(ring, columns, types.intp, types.intp, stride, depth, kind, many, reach, lanes), emit


def _flat(rows: list[list[list[Any]]]) -> list[Any]:
    return [value for cells in rows for cell in cells for value in cell]


def _first_least(builder: Any, a: list[Any], b: list[Any]) -> list[Any]:
    """The cell whose cost, its first value, is less; a where they are equal."""
    less = builder.fcmp_ordered("<", b[0], a[0])
    return [builder.select(less, other, one) for one, other in zip(a, b, strict=True)]


def _first_of_all(builder: Any, cells: list[list[Any]]) -> list[Any]:
    """The first of the cheapest, compared by pairs, and these again by pairs: no long chain."""
    while len(cells) > 1:
        pairs = [cells[i : i + 2] for i in range(0, len(cells), 2)]
        cells = [_first_least(builder, *pair) if len(pair) > 1 else pair[0] for pair in pairs]
    return cells[0]
