"""Vectors of `LANES` numbers inside numba kernels: one string, or one segment of a query, in each lane.

LLVM does not turn the window of section 6 into vector code by itself, since it cannot prove that the cells read
and the cell written lie apart. These intrinsics emit the vector instructions directly; they work on any processor.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from motionlake.pesta.lanes import LANES, ROWS
from numba import types
from numba.extending import intrinsic, models, register_model

_FLOATS = ir.VectorType(ir.FloatType(), LANES)
_FLOAT_ROWS = ir.VectorType(ir.FloatType(), ROWS)
_INTS = ir.VectorType(ir.IntType(32), LANES)
_INT32 = ir.IntType(32)
_INT64 = ir.IntType(64)


class LanesType(types.Type):  # type: ignore[misc]
    """The numba type of a vector of `LANES` numbers."""

    def __init__(self, element: Any) -> None:
        super().__init__(name=f"Lanes({LANES} x {element})")
        self.element = element


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: LanesType) -> None:
        super().__init__(manager, kind, _vector(kind))


Floats = LanesType(types.float32)
Ints = LanesType(types.int32)


def _vector(kind: LanesType) -> Any:
    return _FLOATS if kind.element == types.float32 else _INTS


def _kind(array: Any) -> LanesType:
    return Floats if array.dtype == types.float32 else Ints


def _data(context: Any, builder: Any, kind: Any, array: Any) -> Any:
    return context.make_array(kind)(context, builder, array).data


def _read(builder: Any, data: Any, offset: Any, vector: Any) -> Any:
    return builder.load(builder.bitcast(builder.gep(data, [offset]), vector.as_pointer()), align=4)


def _write(builder: Any, data: Any, offset: Any, value: Any) -> None:
    builder.store(value, builder.bitcast(builder.gep(data, [offset]), value.type.as_pointer()), align=4)


def _spread(builder: Any, number: Any, vector: Any) -> Any:
    nothing = ir.Constant(vector, ir.Undefined)
    one = builder.insert_element(nothing, number, ir.Constant(_INT32, 0))
    return builder.shuffle_vector(one, nothing, ir.Constant(_INTS, [0] * LANES))


def _least(builder: Any, a: Any, b: Any) -> Any:
    return builder.select(builder.fcmp_ordered("<", b, a), b, a)


@intrinsic  # type: ignore[untyped-decorator]
def load(typing: Any, array: Any, offset: Any) -> Any:
    """array[offset + lane] of a flat float32 or int32 array."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = _data(context, builder, signature.args[0], arguments[0])
        return _read(builder, data, arguments[1], _vector(signature.return_type))

    return _kind(array)(array, types.intp), emit


@intrinsic  # type: ignore[untyped-decorator]
def store(typing: Any, array: Any, offset: Any, value: Any) -> Any:
    """array[offset + lane] = value[lane]."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        _write(builder, _data(context, builder, signature.args[0], arguments[0]), arguments[1], arguments[2])
        return context.get_dummy_value()

    return types.none(array, types.intp, _kind(array)), emit


@intrinsic  # type: ignore[untyped-decorator]
def spread(typing: Any, number: Any) -> Any:
    """The same float32 or int32 in every lane."""
    kind = Floats if number == types.float32 else Ints

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _spread(builder, arguments[0], _vector(signature.return_type))

    return kind(kind.element), emit


@intrinsic  # type: ignore[untyped-decorator]
def least(typing: Any, a: Any, b: Any) -> Any:
    """The lesser of two float vectors, lane by lane."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _least(builder, *arguments)

    return Floats(Floats, Floats), emit


@intrinsic  # type: ignore[untyped-decorator]
def plus(typing: Any, a: Any, b: Any) -> Any:
    """The sum of two float vectors."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.fadd(*arguments)

    return Floats(Floats, Floats), emit


@intrinsic  # type: ignore[untyped-decorator]
def scaled(typing: Any, a: Any, factor: Any) -> Any:
    """A float vector times a float32."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.fmul(arguments[0], _spread(builder, arguments[1], _FLOATS))

    return Floats(Floats, types.float32), emit


@intrinsic  # type: ignore[untyped-decorator]
def chosen(typing: Any, a: Any, b: Any, if_less: Any, otherwise: Any) -> Any:
    """`if_less` where b < a, else `otherwise`, lane by lane; all floats."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        a, b, if_less, otherwise = arguments
        return builder.select(builder.fcmp_ordered("<", b, a), if_less, otherwise)

    return Floats(Floats, Floats, Floats, Floats), emit


@intrinsic  # type: ignore[untyped-decorator]
def load_rows(typing: Any, table: Any, at: Any, first: Any, out: Any) -> Any:
    """out[row * LANES + lane] = table[at[lane] + first + row] for `ROWS` rows: loaded by lane, then transposed."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        table, at, out = (_data(context, builder, signature.args[i], arguments[i]) for i in (0, 1, 3))
        by_lane = []
        for lane in range(LANES):
            start = builder.load(builder.gep(at, [ir.Constant(_INT64, lane)]))
            by_lane.append(_read(builder, table, builder.add(start, arguments[2]), _FLOAT_ROWS))
        both = ir.Constant(ir.VectorType(_INT32, LANES), list(range(LANES)))
        halves = [builder.shuffle_vector(by_lane[lane], by_lane[lane + ROWS], both) for lane in range(ROWS)]
        for row, vector in enumerate(_transposed(builder, halves, ROWS)):
            _write(builder, out, ir.Constant(_INT64, row * LANES), vector)
        return context.get_dummy_value()

    return types.none(table, at, types.intp, out), emit


def _transposed(builder: Any, rows: list[Any], size: int) -> list[Any]:
    """`size` vectors, each square of size x size within them transposed."""
    step = 1
    while step < size:
        swapped = list(rows)
        low = [j if (j // step) % 2 == 0 else LANES + j - step for j in range(LANES)]
        high = [j + step if (j // step) % 2 == 0 else LANES + j for j in range(LANES)]
        for row in range(size):
            if (row // step) % 2 == 0:
                pair = rows[row], rows[row + step]
                swapped[row] = builder.shuffle_vector(*pair, ir.Constant(_INTS, low))
                swapped[row + step] = builder.shuffle_vector(*pair, ir.Constant(_INTS, high))
        rows = swapped
        step *= 2
    return rows


def window_cells(p: int) -> list[tuple[int, int]]:
    """(rows back, columns back) of the cells p steps away, in the order in which ties are decided.

    The diagonal first, then those p rows back by falling column, then those p columns back by falling row.
    """
    return [(p, p), *((p, k) for k in range(p - 1, -1, -1)), *((k, p) for k in range(p - 1, -1, -1))]


@intrinsic(prefer_literal=True)  # type: ignore[untyped-decorator]
def window(typing: Any, ring: Any, columns: Any, row: Any, above: Any, distance: Any, stride: Any) -> Any:
    """Least W(m, n) + D * p over the window of one cell, for a stride that is a constant (section 6).

    ring: flat float32; columns[k]: where the column k steps back begins in it; row: the cell's row * LANES;
    above: W of the row before in this column; distance: D.
    """
    if not isinstance(stride, types.IntegerLiteral):
        return None

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        read = _Window(context, builder, signature, arguments, stride.literal_value)
        best = None
        for p in range(stride.literal_value, 0, -1):
            cells = [read.cost(*cell) for cell in window_cells(p) if cell != (1, 0)]
            if p == 1:
                cells.append(arguments[3])
            low = cells[0]
            for cell in cells[1:]:
                low = _least(builder, low, cell)
            cost = builder.fadd(low, read.penalty(arguments[4], p))
            best = cost if best is None else _least(builder, best, cost)
        return best

    return Floats(ring, columns, types.intp, Floats, Floats, stride), emit


@intrinsic(prefer_literal=True)  # type: ignore[untyped-decorator]
def rows_above(typing: Any, ring: Any, columns: Any, row: Any, plane: Any, stride: Any, depth: Any) -> Any:
    """What `next_row` needs of the rows before a strip's second one: its first row, and none above it.

    ring: flat float32: the costs, and `depth` tables of what cells carry, `plane` places apart; columns[k]: where the
    column k steps back begins in it; row: the first row's place.

    Returns:
        (1 + depth) * stride * (stride + 1) vectors: by table, rows back and columns back.
    """
    if not (isinstance(stride, types.IntegerLiteral) and isinstance(depth, types.IntegerLiteral)):
        return None
    w, tables = stride.literal_value, depth.literal_value + 1

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        read = _Window(context, builder, signature, arguments[:3], w)
        nothing = ir.Constant(_FLOATS, [float("inf")] * LANES)
        cells = []
        for table in range(tables):
            cells += [read.cost(0, k, builder.mul(arguments[3], ir.Constant(_INT64, table))) for k in range(w + 1)]
            cells += [nothing] * ((w - 1) * (w + 1))
        return context.make_tuple(builder, signature.return_type, cells)

    many = types.UniTuple(Floats, tables * w * (w + 1))
    return many(ring, columns, types.intp, types.intp, stride, depth), emit


@intrinsic(prefer_literal=True)  # type: ignore[untyped-decorator]
def next_row(
    typing: Any, ring: Any, columns: Any, row: Any, plane: Any, stride: Any, depth: Any, distance: Any, above: Any,
    reach: Any,
) -> Any:  # fmt: skip
    """Write a row's cell, the least W(m, n) + D * p over its window (section 6), and what the first of the best cells
    carries.

    row: the row's place; distance: D; above: `rows_above` or what this has returned of the row before; reach: how many
    rows above there are at most, a constant. Cells are compared by pairs, then the lesser ones by pairs, the first of
    equals kept: no long chain.

    Returns:
        As `rows_above`, for the next row.
    """
    if not all(isinstance(each, types.IntegerLiteral) for each in (stride, depth, reach)):
        return None
    w, tables, most = stride.literal_value, depth.literal_value + 1, reach.literal_value

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        read = _Window(context, builder, signature, arguments[:3], w)
        places = [builder.mul(arguments[3], ir.Constant(_INT64, table)) for table in range(tables)]
        beside = [[read.cost(0, k, place) for k in range(1, w + 1)] for place in places]

        def cell(table: int, rows: int, columns: int) -> Any:
            if rows == 0:
                return beside[table][columns - 1]
            at = (table * w + rows - 1) * (w + 1) + columns
            return builder.extract_value(arguments[7], at)

        rivals = []
        for p in range(1, w + 1):
            penalty = read.penalty(arguments[6], p)
            for rows, back in window_cells(p):
                if rows <= most:
                    cost = builder.fadd(cell(0, rows, back), penalty)
                    rivals.append([cost, *(cell(table, rows, back) for table in range(1, tables))])
        while len(rivals) > 1:
            pairs = [rivals[i : i + 2] for i in range(0, len(rivals), 2)]
            rivals = [_first_least(builder, *pair) if len(pair) > 1 else pair[0] for pair in pairs]
        following = []
        for table, place in enumerate(places):
            read.put(place, rivals[0][table])
            following += [rivals[0][table], *beside[table]]
            following += [cell(table, rows, k) for rows in range(1, w) for k in range(w + 1)]
        return context.make_tuple(builder, signature.return_type, following)

    many = types.UniTuple(Floats, tables * w * (w + 1))
    return many(ring, columns, types.intp, types.intp, stride, depth, Floats, many, reach), emit


def _first_least(builder: Any, a: list[Any], b: list[Any]) -> list[Any]:
    less = builder.fcmp_ordered("<", b[0], a[0])
    return [builder.select(less, other, one) for one, other in zip(a, b, strict=True)]


class _Window:
    """The cells around one cell, as an intrinsic's first arguments (ring, columns, row) give them."""

    def __init__(self, context: Any, builder: Any, signature: Any, arguments: Any, last: int) -> None:
        self._builder = builder
        self._data = _data(context, builder, signature.args[0], arguments[0])
        columns = _data(context, builder, signature.args[1], arguments[1])
        starts = [builder.load(builder.gep(columns, [ir.Constant(_INT64, k)])) for k in range(last + 1)]
        self._columns = [builder.add(start, arguments[2]) for start in starts]

    def cost(self, rows: int, columns: int, table: Any = None) -> Any:
        """Of the cell so many rows and columns back, in the table that begins `table` places further on."""
        place = self._builder.sub(self._columns[columns], ir.Constant(_INT64, rows * LANES))
        return _read(self._builder, self._data, place if table is None else self._builder.add(place, table), _FLOATS)

    def put(self, table: Any, value: Any) -> None:
        """Into the cell itself."""
        _write(self._builder, self._data, self._builder.add(self._columns[0], table), value)

    def penalty(self, distance: Any, p: int) -> Any:
        if p == 1:
            return distance
        return self._builder.fmul(distance, ir.Constant(_FLOATS, [float(p)] * LANES))
