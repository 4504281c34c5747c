"""Values of a binary USD layer: words, numbers, lists of paths, and what has a value at time codes.

A value is eight bytes: its kind, whether it is an array, and where it lies, or itself where that is short.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray, Int64Array, UInt8Array
from motionlake.formats.limits_config import limits
from motionlake.formats.parse.usd_crate import Crate
from motionlake.formats.parse.usd_packed import Bytes, NotPlainError
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

_ARRAY, _INLINED, _COMPRESSED = 1 << 63, 1 << 62, 1 << 61
_PLACE: Final = (1 << 48) - 1
_TOKEN, _TOKEN_LIST, _PATH_LIST, _TOKENS, _SPECIFIER, _TIME_SAMPLES, _DOUBLES = 11, 32, 34, 41, 42, 46, 48
_FLOAT, _DOUBLE, _MATRIX = 8, 9, 15
QUATERNIONS, VECTORS, HALF_VECTORS = 17, 24, 25
# Kinds of numbers: half, float and double; 4 x 4 matrix; quaternions; vectors of three. How they lie, and their shape.
_NUMBERS: Final[dict[int, tuple[str, tuple[int, ...]]]] = {
    7: ("<f2", ()), _FLOAT: ("<f4", ()), _DOUBLE: ("<f8", ()), _MATRIX: ("<f8", (4, 4)),
    16: ("<f8", (4,)), QUATERNIONS: ("<f4", (4,)), 18: ("<f2", (4,)),
    23: ("<f8", (3,)), VECTORS: ("<f4", (3,)), HALF_VECTORS: ("<f2", (3,)),
}  # fmt: skip
_PYTHON_BYTES: Final = 64  # of a number or a name in a list
_DELETED, _ORDERED = 8, 16
_LISTS: Final = (2, 4, 32, 64)  # explicit, added, prepended, appended: bits of a list's first byte, in their order


@dataclass(frozen=True)
class Samples:
    """What an attribute says at time codes.

    Attributes:
        times: [K] growing time codes.
        values: [K, ...] at each.
    """

    times: Float64Array
    values: FloatArray


class Values:
    """The values of a layer, each by its eight bytes; `NotPlainError` where one is of a kind that is not read here."""

    def __init__(self, crate: Crate) -> None:
        self._words, self._paths = crate.words, crate.paths
        self._data = crate.data
        self._bytes = np.frombuffer(crate.data, np.uint8)

    def word(self, value: int) -> str:
        """A token."""
        if value & (_ARRAY | _INLINED) != _INLINED or _kind(value) != _TOKEN:
            raise NotPlainError("has something else than a word")
        return self._words[value & _PLACE]

    def words(self, value: int) -> list[str]:
        """Tokens, of an attribute or of the layer."""
        if _kind(value) == _TOKEN and value & (_ARRAY | _INLINED | _COMPRESSED) == _ARRAY:
            if not value & _PLACE:
                return []
        elif _kind(value) != _TOKENS or value & (_ARRAY | _INLINED):
            raise NotPlainError("has something else than words")
        return [self._words[word] for word in self._counted(value & _PLACE)]

    def specifier(self, value: int) -> int:
        """0 where a prim is defined, 1 where it is what is said over one, 2 where it is a class."""
        if _kind(value) != _SPECIFIER or not value & _INLINED:
            raise NotPlainError("has a prim of no kind")
        return value & _PLACE

    def applied(self, value: int) -> list[str]:
        """The tokens of a list of changes that adds to nothing."""
        return [self._words[word] for word in self._list(value, _TOKEN_LIST)]

    def targets(self, value: int) -> list[str]:
        """The paths of such a list."""
        return [self._paths[path] for path in self._list(value, _PATH_LIST)]

    def numbers(self, value: int) -> FloatArray:
        """[...] one number, vector or matrix, or [A, ...] of an array of them."""
        lies, shape = _lies(value)
        if value & _COMPRESSED:
            raise NotPlainError("has packed numbers")
        place = value & _PLACE
        if value & _ARRAY:
            count = self._count(place) if place else 0
            found = self._run(place + 8, lies, count * _size(shape))
            return found.reshape(count, *shape)
        if not value & _INLINED:
            return self._run(place, lies, _size(shape)).reshape(shape)
        return _inlined(place, _kind(value), lies, shape)

    def array(self, value: int, kind: int) -> FloatArray:
        """[A, ...] an array of numbers of a kind."""
        if value >> 48 != _ARRAY >> 48 | kind:
            raise NotPlainError("has numbers of another kind")
        return self.numbers(value)

    def number(self, value: int) -> float:
        """One number."""
        if _kind(value) not in (_FLOAT, _DOUBLE) or value & _ARRAY:
            raise NotPlainError("has something else than a number")
        return float(self.numbers(value))

    def samples(self, value: int, kind: int) -> Samples:
        """Arrays of one length at time codes, of numbers of a kind."""
        if _kind(value) != _TIME_SAMPLES or value & (_ARRAY | _INLINED):
            raise NotPlainError("has something else than values at time codes")
        times, place = self._pointed(value & _PLACE)
        if _kind(times) != _DOUBLES or times & (_ARRAY | _INLINED):
            raise NotPlainError("has time codes of another kind")
        count = self._count(times & _PLACE)
        codes = self._run((times & _PLACE) + 8, "<f8", count)
        place += self._at(place)
        if self._count(place) != count or not count or not (np.diff(codes) > 0).all():
            raise NotPlainError("has other values than time codes")
        return Samples(codes.astype(np.float64), self._arrays(self._run(place + 8, "<u8", count), kind))

    def _arrays(self, values: NDArray[np.uint64], kind: int) -> FloatArray:
        """[K, A, ...] arrays of one length, seen where they lie, or copied where they are not evenly apart."""
        kinds, places = values >> np.uint64(48), (values & np.uint64(_PLACE)).astype(np.int64)
        if (kinds != _ARRAY >> 48 | kind).any():
            raise NotPlainError("has numbers of another kind")
        lies, shape = _lies(int(values[0]))
        joints = self._count(int(places[0]))
        limits().check("joints", joints, f"has {joints} joints")
        size = np.dtype(lies).itemsize * _size(shape) * joints
        if places.min() <= 0 or places.max() + 8 + size > len(self._bytes):
            raise NotPlainError("ends early")
        rows = self._rows(places, 8 + size)
        if (rows[:, :8] != rows[0, :8]).any():
            raise NotPlainError("has values of several lengths")
        return rows[:, 8:].view(lies).reshape(len(places), joints, *shape)

    def _rows(self, places: Int64Array, size: int) -> UInt8Array:
        """[K, size] bytes at places within the file."""
        steps = np.diff(places)
        if len(steps) and steps[0] >= 0 and (steps == steps[0]).all():
            return as_strided(self._bytes[places[0] :], (len(places), size), (int(steps[0]), 1), writeable=False)
        limits().check_memory(size * len(places))
        together = int(np.gcd.reduce(np.append(places, (size, 8))))  # bytes that are copied at a time
        wide = self._bytes[: len(self._bytes) // together * together].view(f"<u{together}")
        copied: NDArray[Any] = wide[places[:, None] // together + np.arange(size // together)]
        return copied.view(np.uint8)

    def _pointed(self, place: int) -> tuple[int, int]:
        """The value that a place says to be so far from it, and the place after that."""
        there = place + self._at(place)
        return self._count(there), there + 8

    def _list(self, value: int, kind: int) -> list[int]:
        if _kind(value) != kind or value & (_ARRAY | _INLINED):
            raise NotPlainError("has something else than a list")
        part = Bytes(self._data[value & _PLACE :])
        bits = part.take(1)[0]
        if bits & (_DELETED | _ORDERED):
            raise NotPlainError("has a list that takes away")
        found: list[int] = []
        for bit in _LISTS:
            if bits & bit:
                found += _as_list(np.frombuffer(part.take(4 * part.number()), "<u4"))
        return found

    def _counted(self, place: int) -> list[int]:
        return _as_list(self._run(place + 8, "<u4", self._count(place)))

    def _count(self, place: int) -> int:
        return int(self._run(place, "<u8", 1)[0])

    def _at(self, place: int) -> int:
        return int(self._run(place, "<i8", 1)[0])

    def _run(self, place: int, lies: str, count: int) -> NDArray[Any]:
        size = np.dtype(lies).itemsize * count
        if not 0 < place <= len(self._bytes) - size:
            raise NotPlainError("ends early")
        return self._bytes[place : place + size].view(lies)


def _as_list(numbers: NDArray[np.uint32]) -> list[int]:
    """As Python has them, which takes much more memory."""
    limits().check_memory(_PYTHON_BYTES * len(numbers))
    found: list[int] = numbers.tolist()
    return found


def _kind(value: int) -> int:
    return value >> 48 & 0xFF


def _lies(value: int) -> tuple[str, tuple[int, ...]]:
    found = _NUMBERS.get(_kind(value))
    if found is None:
        raise NotPlainError("has something else than numbers")
    return found


def _size(shape: tuple[int, ...]) -> int:
    return int(np.prod(shape, dtype=int))


def _inlined(bits: int, kind: int, lies: str, shape: tuple[int, ...]) -> FloatArray:
    """A value that is short: a number of four bytes, whole numbers of one, or the diagonal of a matrix in those."""
    data = struct.pack("<Q", bits)
    if not shape:
        return np.frombuffer(data, "<f2" if lies == "<f2" else "<f4", 1)[0:1].astype(lies).reshape(())
    if kind == _MATRIX:
        return np.diag(np.frombuffer(data, np.int8, 4).astype(lies))
    if len(shape) == 1 and shape[0] == 3:
        return np.frombuffer(data, np.int8, 3).astype(lies)
    raise NotPlainError("has a value that is inlined otherwise")
