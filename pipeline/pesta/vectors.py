"""Vectors of `LANES` numbers inside numba kernels: one string, or one segment of a query, in each lane.

LLVM does not turn the window of section 6 into vector code by itself, since it cannot prove that the cells read
and the cell written lie apart. These intrinsics emit the vector instructions directly; they work on any processor.
"""

from __future__ import annotations

from typing import Any, Final

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, models, register_model

LANES: Final = 16
ROWS: Final = LANES // 2  # of the query, whose distances are loaded at once
# Strides whose window is written out in full; a wider window is a loop.
MAX_UNROLLED: Final = 3

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
    """`if_less` where b < a, else `otherwise`, lane by lane: a, b floats, the others integers."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        a, b, if_less, otherwise = arguments
        return builder.select(builder.fcmp_ordered("<", b, a), if_less, otherwise)

    return Ints(Floats, Floats, Ints, Ints), emit


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


@intrinsic  # type: ignore[untyped-decorator]
def transpose(typing: Any, source: Any, target: Any) -> Any:
    """target[j * LANES + i] = source[i * LANES + j] of two flat arrays of `LANES` vectors."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        read, write = (_data(context, builder, signature.args[i], arguments[i]) for i in (0, 1))
        vector = _vector(_kind(source))
        rows = [_read(builder, read, ir.Constant(_INT64, i * LANES), vector) for i in range(LANES)]
        for i, row in enumerate(_transposed(builder, rows, LANES)):
            _write(builder, write, ir.Constant(_INT64, i * LANES), row)
        return context.get_dummy_value()

    return types.none(source, target), emit


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
        read = _Window(context, builder, signature, arguments)
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
def window_from(typing: Any, ring: Any, origins: Any, columns: Any, row: Any, distance: Any, stride: Any) -> Any:
    """As `window`, and the origin (int32) that the first of the best cells carries: a pair of vectors."""
    if not isinstance(stride, types.IntegerLiteral):
        return None
    pair = types.Tuple((Floats, Ints))

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        costs = _Window(context, builder, signature, arguments)
        marks = _data(context, builder, signature.args[1], arguments[1])
        rivals = []
        for p in range(1, stride.literal_value + 1):
            penalty = costs.penalty(arguments[4], p)
            for cell in window_cells(p):
                mark = _read(builder, marks, costs.place(*cell), _INTS)
                rivals.append((builder.fadd(costs.cost(*cell), penalty), mark))
        while len(rivals) > 1:  # by pairs, the first of equals kept: no long chain of comparisons
            pairs = [rivals[i : i + 2] for i in range(0, len(rivals), 2)]
            rivals = [_first_least(builder, *pair) if len(pair) > 1 else pair[0] for pair in pairs]
        best, origin = rivals[0]
        return context.make_tuple(builder, signature.return_type, (best, origin))

    return pair(ring, origins, columns, types.intp, Floats, stride), emit


def _first_least(builder: Any, a: tuple[Any, Any], b: tuple[Any, Any]) -> tuple[Any, Any]:
    less = builder.fcmp_ordered("<", b[0], a[0])
    return builder.select(less, b[0], a[0]), builder.select(less, b[1], a[1])


class _Window:
    """The cells around one cell, as a window intrinsic's arguments (ring, ..., columns, row, ...) give them."""

    def __init__(self, context: Any, builder: Any, signature: Any, arguments: Any) -> None:
        where = 1 if len(signature.args) and signature.args[1].dtype == types.intp else 2
        self._builder = builder
        self._data = _data(context, builder, signature.args[0], arguments[0])
        self._row = arguments[where + 1]
        columns = _data(context, builder, signature.args[where], arguments[where])
        last = signature.args[-1].literal_value
        self._columns = [builder.load(builder.gep(columns, [ir.Constant(_INT64, k)])) for k in range(last + 1)]

    def place(self, rows: int, columns: int) -> Any:
        up = ir.Constant(_INT64, rows * LANES)
        return self._builder.sub(self._builder.add(self._columns[columns], self._row), up)

    def cost(self, rows: int, columns: int) -> Any:
        return _read(self._builder, self._data, self.place(rows, columns), _FLOATS)

    def penalty(self, distance: Any, p: int) -> Any:
        if p == 1:
            return distance
        return self._builder.fmul(distance, ir.Constant(_FLOATS, [float(p)] * LANES))
