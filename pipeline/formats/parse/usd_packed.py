"""Packed parts of a binary USD layer: LZ4 blocks, and integers as differences of one, two or four bytes."""

from __future__ import annotations

import struct
from contextlib import suppress
from typing import Final

import pyarrow as pa
from motionlake.formats.limits_config import limits

_MOST_RATIO: Final = 256  # an LZ4 block cannot hold more than 255 times its bytes
# Of four numbers in a byte, two bits each: 0 is the usual difference, the others are of so many bytes.
_WIDTHS: Final = (0, 1, 2, 4)
_HALF: Final = 1 << 31


class NotPlainError(Exception):
    """A file, or something in it, that is not read this way; the library reads it, or says what is wrong."""


class Bytes:
    """The bytes of a part of a file, read one thing after the other."""

    def __init__(self, data: memoryview) -> None:
        self.data, self.at = data, 0

    def take(self, count: int) -> memoryview:
        """The next `count` bytes; `NotPlainError` where there are fewer."""
        if not 0 <= count <= len(self.data) - self.at:
            raise NotPlainError("ends early")
        self.at += count
        return self.data[self.at - count : self.at]

    def number(self) -> int:
        """The next unsigned integer of eight bytes."""
        return int(struct.unpack("<Q", self.take(8))[0])

    def integers(self, count: int) -> list[int]:
        """The next `count` packed integers, as signed ones of four bytes."""
        return _integers(self.take(self.number()), count)


def unpacked(data: memoryview, size: int) -> bytes:
    """`size` bytes of an LZ4 block, with a byte before it; `NotPlainError` where it holds fewer or more."""
    found = _unpacked(data, size)
    _check_holds(data, size)
    return found


def _unpacked(data: memoryview, most: int) -> bytes:
    """The bytes of a block that holds no more than `most`, with whatever is in memory after them."""
    if not len(data) or data[0]:  # it counts the blocks, where there are several: of two gigabytes
        raise NotPlainError("is packed in several blocks")
    if most > _MOST_RATIO * len(data):
        raise NotPlainError("promises more than it holds")
    limits().check_memory(most)
    try:
        return bytes(pa.decompress(pa.py_buffer(data[1:]), most, codec="lz4_raw", asbytes=True)) if most else b""
    except OSError as error:
        raise NotPlainError("is packed wrongly") from error


def _check_holds(data: memoryview, size: int) -> None:
    """Reject a block that holds fewer than `size` bytes: it would go into a byte less, which nothing else tells."""
    if size:
        with suppress(OSError):
            pa.decompress(pa.py_buffer(data[1:]), size - 1, codec="lz4_raw", asbytes=True)
            raise NotPlainError("holds less than it promises")


def _integers(data: memoryview, count: int) -> list[int]:
    """`count` integers: the usual difference, a code for each of them, then those differences that differ.

    A loop, for mostly there are few.
    """
    at = 4 + -(-count // 4)
    whole = _unpacked(data, min(at + 4 * count, _MOST_RATIO * len(data)))
    if len(whole) < at:
        raise NotPlainError("ends early")
    usual = int.from_bytes(whole[:4], "little", signed=True)
    found, value = [], 0
    for number in range(count):
        width = _WIDTHS[whole[4 + (number >> 2)] >> 2 * (number & 3) & 3]
        value += int.from_bytes(whole[at : at + width], "little", signed=True) if width else usual
        at += width
        found.append((value + _HALF) % (2 * _HALF) - _HALF)
    _check_holds(data, at)
    return found
