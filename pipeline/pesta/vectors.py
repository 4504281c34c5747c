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
        a, b = arguments
        return builder.select(builder.fcmp_ordered("<", b, a), b, a)

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
