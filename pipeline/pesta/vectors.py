"""Vectors of numbers inside numba kernels: one string, or one strip of a long query, in each lane.

LLVM does not turn the window of section 6 into vector code by itself, since it cannot prove that the cells read
and the cell written lie apart. These intrinsics emit the vector instructions directly; they work on any processor.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from motionlake.pesta.lanes import LANES, ROWS
from numba import types
from numba.extending import intrinsic, models, register_model

_FLOAT_ROWS = ir.VectorType(ir.FloatType(), ROWS)
_INT32 = ir.IntType(32)
_INT64 = ir.IntType(64)
_SHUFFLE = ir.VectorType(_INT32, LANES)


class LanesType(types.Type):  # type: ignore[misc]
    """The numba type of a vector of numbers."""

    def __init__(self, element: Any, lanes: int = LANES) -> None:
        super().__init__(name=f"Lanes({lanes} x {element})")
        self.element, self.lanes = element, lanes


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: LanesType) -> None:
        super().__init__(manager, kind, vector_of(kind))


Floats = LanesType(types.float32)
Ints = LanesType(types.int32)


def vector_of(kind: LanesType) -> Any:
    return ir.VectorType(ir.FloatType() if kind.element == types.float32 else _INT32, kind.lanes)


def _kind(array: Any) -> LanesType:
    return Floats if array.dtype == types.float32 else Ints


def constants_of(*values: Any) -> tuple[int, ...] | None:
    """What numba knows to be constants; None if it does not know one of them."""
    return tuple(v.literal_value for v in values) if all(isinstance(v, types.IntegerLiteral) for v in values) else None


def _data(context: Any, builder: Any, kind: Any, array: Any) -> Any:
    return context.make_array(kind)(context, builder, array).data


def _read(builder: Any, data: Any, offset: Any, vector: Any) -> Any:
    return builder.load(builder.bitcast(builder.gep(data, [offset]), vector.as_pointer()), align=4)


def _write(builder: Any, data: Any, offset: Any, value: Any) -> None:
    builder.store(value, builder.bitcast(builder.gep(data, [offset]), value.type.as_pointer()), align=4)


def _spread(builder: Any, number: Any, vector: Any) -> Any:
    nothing = ir.Constant(vector, ir.Undefined)
    one = builder.insert_element(nothing, number, ir.Constant(_INT32, 0))
    return builder.shuffle_vector(one, nothing, ir.Constant(ir.VectorType(_INT32, vector.count), [0] * vector.count))


def _least(builder: Any, a: Any, b: Any) -> Any:
    return builder.select(builder.fcmp_ordered("<", b, a), b, a)


@intrinsic  # type: ignore[untyped-decorator]
def load(typing: Any, array: Any, offset: Any) -> Any:
    """array[offset + lane] of a flat float32 or int32 array."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = _data(context, builder, signature.args[0], arguments[0])
        return _read(builder, data, arguments[1], vector_of(signature.return_type))

    return _kind(array)(array, types.intp), emit


@intrinsic(prefer_literal=True)  # type: ignore[untyped-decorator]
def load_strip(typing: Any, array: Any, offset: Any, lanes: Any) -> Any:
    """array[offset + lane] of a flat float32 array, for a constant number of lanes."""
    constants = constants_of(lanes)
    if not constants:
        return None
    kind = LanesType(types.float32, *constants)

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _read(builder, _data(context, builder, signature.args[0], arguments[0]), arguments[1], vector_of(kind))

    return kind(array, types.intp, lanes), emit


@intrinsic  # type: ignore[untyped-decorator]
def store(typing: Any, array: Any, offset: Any, value: Any) -> Any:
    """array[offset + lane] = value[lane]."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        _write(builder, _data(context, builder, signature.args[0], arguments[0]), arguments[1], arguments[2])
        return context.get_dummy_value()

    return types.none(array, types.intp, value), emit


@intrinsic  # type: ignore[untyped-decorator]
def spread(typing: Any, number: Any) -> Any:
    """The same float32 or int32 in every lane."""
    kind = Floats if number == types.float32 else Ints

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _spread(builder, arguments[0], vector_of(signature.return_type))

    return kind(kind.element), emit


@intrinsic  # type: ignore[untyped-decorator]
def least(typing: Any, a: Any, b: Any) -> Any:
    """The lesser of two float vectors, lane by lane."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _least(builder, *arguments)

    return a(a, b), emit


@intrinsic  # type: ignore[untyped-decorator]
def plus(typing: Any, a: Any, b: Any) -> Any:
    """The sum of two float vectors."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.fadd(*arguments)

    return a(a, b), emit


@intrinsic  # type: ignore[untyped-decorator]
def scaled(typing: Any, a: Any, factor: Any) -> Any:
    """A float vector times a float32."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.fmul(arguments[0], _spread(builder, arguments[1], arguments[0].type))

    return a(a, types.float32), emit


@intrinsic  # type: ignore[untyped-decorator]
def chosen(typing: Any, a: Any, b: Any, if_less: Any, otherwise: Any) -> Any:
    """`if_less` where b < a, else `otherwise`, lane by lane; all floats."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        a, b, if_less, otherwise = arguments
        return builder.select(builder.fcmp_ordered("<", b, a), if_less, otherwise)

    return a(a, b, if_less, otherwise), emit


@intrinsic  # type: ignore[untyped-decorator]
def load_rows(typing: Any, table: Any, at: Any, first: Any, out: Any) -> Any:
    """out[row * LANES + lane] = table[at[lane] + first + row] for `ROWS` rows: loaded by lane, then transposed."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        table, at, out = (_data(context, builder, signature.args[i], arguments[i]) for i in (0, 1, 3))
        by_lane = []
        for lane in range(LANES):
            start = builder.load(builder.gep(at, [ir.Constant(_INT64, lane)]))
            by_lane.append(_read(builder, table, builder.add(start, arguments[2]), _FLOAT_ROWS))
        both = ir.Constant(_SHUFFLE, list(range(LANES)))
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
                swapped[row] = builder.shuffle_vector(*pair, ir.Constant(_SHUFFLE, low))
                swapped[row + step] = builder.shuffle_vector(*pair, ir.Constant(_SHUFFLE, high))
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
    constants = constants_of(stride)
    if not constants:
        return None
    (w,) = constants

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        read = Window(context, builder, signature, arguments, w)
        best = None
        for p in range(w, 0, -1):
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


class Window:
    """The cells around one cell, as an intrinsic's first arguments (ring, columns, row) give them."""

    def __init__(
        self, context: Any, builder: Any, signature: Any, arguments: Any, last: int, lanes: int = LANES
    ) -> None:
        self._builder, self._lanes = builder, lanes
        self._data = _data(context, builder, signature.args[0], arguments[0])
        columns = _data(context, builder, signature.args[1], arguments[1])
        starts = [builder.load(builder.gep(columns, [ir.Constant(_INT64, k)])) for k in range(last + 1)]
        self._columns = [builder.add(start, arguments[2]) for start in starts]

    def cost(self, rows: int, columns: int, table: Any = None) -> Any:
        """Of the cell so many rows and columns back, in the table that begins `table` places further on."""
        place = self._builder.sub(self._columns[columns], ir.Constant(_INT64, rows * self._lanes))
        place = place if table is None else self._builder.add(place, table)
        return _read(self._builder, self._data, place, ir.VectorType(ir.FloatType(), self._lanes))

    def put(self, table: Any, value: Any) -> None:
        """Into the cell itself."""
        _write(self._builder, self._data, self._builder.add(self._columns[0], table), value)

    def penalty(self, distance: Any, p: int) -> Any:
        if p == 1:
            return distance
        return self._builder.fmul(distance, ir.Constant(distance.type, [float(p)] * self._lanes))
