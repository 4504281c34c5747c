"""Arrays of NumPy's files: headers against NumPy's own reading of them, and archives whose bytes are damaged."""

from __future__ import annotations

import io
import zipfile

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from motionlake.errors import ClipError
from motionlake.formats.parse.npz_members import NpzArchive, npy_array, npy_header

TYPES = ("<f4", "<f8", ">f8", "<i2", "|u1", "|b1", "<f2", "<U3", "<c8")
SHAPES = st.lists(st.integers(0, 4), max_size=4).map(tuple)


def any_room(name: str, shape: tuple[int, ...], length: int) -> None:
    """Lets every array pass."""


@given(st.sampled_from(TYPES), SHAPES, st.booleans())
def test_a_header_says_what_numpy_reads(kind: str, shape: tuple[int, ...], fortran: bool) -> None:
    stream = io.BytesIO()
    array = np.arange(np.prod(shape, dtype=int)).astype(kind).reshape(shape, order="F" if fortran else "C")
    np.save(stream, array)
    data = stream.getvalue()
    assert npy_header(data) == (array.shape, array.dtype)
    np.testing.assert_array_equal(npy_array(data, "a", any_room), np.load(io.BytesIO(data)))


@given(st.integers(10, 127), st.integers(0, 255))
@example(23, ord("0"))  # '<f0', which is no type
def test_a_header_with_a_changed_byte_is_read_as_by_numpy_or_rejected(at: int, byte: int) -> None:
    stream = io.BytesIO()
    np.save(stream, np.arange(6.0).reshape(2, 3))
    data = bytearray(stream.getvalue())
    data[at] = byte
    try:
        expected = np.lib.format.read_array_header_1_0(io.BytesIO(data[8:]))
    except Exception:  # whatever NumPy's parser makes of it
        expected = None
    found = npy_header(bytes(data))
    assert found == (None if expected is None else (expected[0], expected[2]))


@pytest.mark.parametrize("what", ["numbers", "checksum", "size", "end"])
def test_a_damaged_array_of_an_archive_is_rejected(what: str) -> None:
    stream = io.BytesIO()
    np.savez_compressed(stream, poses=np.random.default_rng(0).normal(size=(50, 66)))
    data = bytearray(stream.getvalue())
    with zipfile.ZipFile(stream) as archive:
        [member] = archive.infolist()
    directory = data.index(b"PK\x01\x02")
    # Of the directory: the checksum at 16, the packed size at 20, the size at 24.
    at, value = {
        "numbers": (directory - 500, data[directory - 500] ^ 8),
        "checksum": (directory + 16, data[directory + 16] ^ 8),
        "size": (directory + 24, data[directory + 24] ^ 8),
        "end": (directory + 21, (member.compress_size >> 8) - 1),
    }[what]
    assert member.compress_type == zipfile.ZIP_DEFLATED
    assert len(NpzArchive(bytes(data)).array("poses", any_room)) == 50
    data[at] = value & 255
    with pytest.raises(ClipError, match=r"damaged .npz archive|bytes long"):
        NpzArchive(bytes(data)).array("poses", any_room)
