"""Arrays of NumPy's files, `.npz` and `.npy`, read one by one rather than with `numpy.load`.

So a damaged or hostile header cannot ask for more memory than its array holds, and no pickle is ever loaded.
"""

from __future__ import annotations

import io
import math
import re
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import deflate
import numpy as np
from motionlake.errors import ClipError
from motionlake.formats.limits_config import MIB, limits
from numpy.typing import NDArray

MAX_HEADER_BYTES: Final = 12_000  # NumPy reads headers of up to 10,000
MAX_ENTRIES: Final = 1_000
_HEADER_AHEAD: Final = 128  # bytes that most headers take
# Of the header before each file of an archive: its length without names, and where those of its two names are.
_LOCAL_HEADER_BYTES: Final = 30
_NAME_LENGTHS_AT: Final = 26
_NAME_LENGTHS: Final = "<HH"
MAGIC: Final = b"\x93NUMPY"
COMPRESSIONS: Final = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_DAMAGE: Final = (zipfile.BadZipFile, zlib.error, struct.error, OSError, EOFError, ValueError, OverflowError)
_ENTRY: Final = b"PK\x01\x02"
_ARCHIVE: Final = ".npz archive"
_DIRECTORY_BYTES: Final = 64 * 1024
_HEADERS: Final[dict[tuple[int, int], Any]] = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}

# The header that NumPy writes for plain numbers, in its own spacing; any other is read by NumPy, which takes longer.
_PLAIN: Final = re.compile(
    rb"\x93NUMPY\x01\x00..{'descr': '([<>|][fiub]\d)', 'fortran_order': (False|True), 'shape': "
    rb"(\(\)|\((?:\d{1,18},|\d{1,18}(?:, \d{1,18})+)\)), } *\n",
    re.DOTALL,
)

# Raises `ClipError` where an array of a name, a shape and so many bytes has no room, before it is read.
RoomCheck = Callable[[str, tuple[int, ...], int], None]


class NpzArchive:
    """An `.npz` file.

    Attributes:
        names: of its arrays.
    """

    def __init__(self, data: bytes) -> None:
        """Open an archive; `ClipError` where it is damaged or holds more than 1,000 files."""
        self._data = data
        if data.count(_ENTRY) > MAX_ENTRIES:
            raise ClipError(f"is an archive of more than {MAX_ENTRIES} files")
        with _FaultsTold(_ARCHIVE):
            self._archive = zipfile.ZipFile(io.BytesIO(data))
        self.names = frozenset(name.removesuffix(".npy") for name in self._archive.namelist() if name.endswith(".npy"))

    def array(self, name: str, check_room: RoomCheck) -> NDArray[Any]:
        """An array, of which no more is read than its header before it is known to fit.

        Raises:
            ClipError: there is none of that name, it is damaged or holds Python objects, or there is no room for it.
        """
        with _FaultsTold(_ARCHIVE):
            return self._array(name, check_room)

    def _array(self, name: str, check_room: RoomCheck) -> NDArray[Any]:
        if name not in self.names:
            raise ClipError(f"has no array {name!r}")
        member = self._archive.getinfo(f"{name}.npy")
        if member.compress_type not in COMPRESSIONS:
            raise ClipError(f"array {name!r} is compressed in an unknown way")
        size = member.file_size
        limits().check("memory_megabytes", size / MIB, f"array {name!r} is {size} bytes long")
        with self._archive.open(member) as stream:
            head = stream.read(_HEADER_AHEAD)
            if (length := _header_length(head)) > len(head):
                head += stream.read(min(length, MAX_HEADER_BYTES) - len(head))
            shape, fortran, dtype, start = _checked_header(head, name, size, check_room)
        content = np.frombuffer(self._content(member), np.uint8)
        return content[start:].view(dtype).reshape(shape, order="F" if fortran else "C")

    def _content(self, member: zipfile.ZipInfo) -> bytes | memoryview:
        """The bytes of a file that is of the size that the directory says, its checksum compared."""
        begin = member.header_offset
        names = struct.unpack_from(_NAME_LENGTHS, self._data, begin + _NAME_LENGTHS_AT)
        begin += _LOCAL_HEADER_BYTES + sum(names)
        packed = memoryview(self._data)[begin : begin + member.compress_size]
        if member.compress_type == zipfile.ZIP_STORED:
            plain: bytes | memoryview = packed
        else:
            try:
                plain = deflate.deflate_decompress(packed, member.file_size)
            except deflate.DeflateError as error:
                raise EOFError("it is damaged or cut short") from error
        if len(plain) != member.file_size or deflate.crc32(plain) != member.CRC:
            raise EOFError("it is damaged or cut short")
        return plain


def npy_array(data: bytes, name: str, check_room: RoomCheck) -> NDArray[Any]:
    """The array of an `.npy` file, called `name` in what is said of it.

    Raises:
        ClipError: it is damaged or holds Python objects, or there is no room for it.
    """
    with _FaultsTold("array"):
        shape, fortran, dtype, start = _checked_header(data[:MAX_HEADER_BYTES], name, len(data), check_room)
        return np.frombuffer(memoryview(data)[start:], dtype=dtype).reshape(shape, order="F" if fortran else "C")


def npy_header(head: bytes) -> tuple[tuple[int, ...], np.dtype[Any]] | None:
    """Shape and type that the beginning of an `.npy` file says, or None where it says none."""
    try:
        shape, _, dtype, _ = _header(head[:MAX_HEADER_BYTES], "")
    except ClipError:
        return None
    return shape, dtype


def directory_holds(path: Path, *names: str) -> bool:
    """Whether the directory of the `.npz` file there, which stands at its end, lists all these arrays."""
    if not path.is_file():  # a pipe would never end
        return False
    try:
        with path.open("rb") as stream:
            size = stream.seek(0, io.SEEK_END)
            stream.seek(max(0, size - _DIRECTORY_BYTES))
            return tail_holds(stream.read(_DIRECTORY_BYTES), *names)
    except OSError:
        return False


def tail_holds(tail: bytes, *names: str) -> bool:
    """The same of the last bytes of an archive."""
    directory = tail[-_DIRECTORY_BYTES:]
    return all(f"{name}.npy".encode() in directory for name in names)


def described(array: NDArray[Any]) -> str:
    """Type and shape of an array, for people."""
    return f"{array.dtype} {list(array.shape)}"


def _checked_header(
    head: bytes, name: str, size: int, check_room: RoomCheck
) -> tuple[tuple[int, ...], bool, np.dtype[Any], int]:
    shape, fortran, dtype, start = _header(head, name)
    if dtype.hasobject:
        raise ClipError(f"array {name!r} holds Python objects, which are never loaded")
    length = size - start
    if min(shape, default=0) < 0 or math.prod(shape) * dtype.itemsize != length:
        raise ClipError(f"array {name!r} is {length} bytes long, but its header says {shape} {dtype}")
    check_room(name, shape, length)
    return shape, fortran, dtype, start


def _header_length(head: bytes) -> int:
    """The bytes that a header takes, by its own beginning."""
    wide = head[6:7] != b"\x01"
    return (12 if wide else 10) + int.from_bytes(head[8 : 12 if wide else 10], "little")


def _header(head: bytes, name: str) -> tuple[tuple[int, ...], bool, np.dtype[Any], int]:
    """Shape, whether the first axis runs fastest, type, and where the numbers start."""
    plain = _PLAIN.match(head)
    stream = io.BytesIO(head)
    try:
        if plain and plain.end() == _header_length(head):
            shape = tuple(int(count) for count in plain[3].strip(b"(),").split(b", ") if count)
            return shape, plain[2] == b"True", np.dtype(plain[1].decode()), plain.end()
        shape, fortran, dtype = _HEADERS[np.lib.format.read_magic(stream)](stream)
    except (KeyError, ValueError, SyntaxError, TypeError, tokenize.TokenError) as error:
        raise ClipError(f"array {name!r} has a damaged header") from error
    return shape, fortran, dtype, stream.tell()


class _FaultsTold:
    """Faults of a file, called by its kind, as `ClipError`."""

    def __init__(self, kind: str) -> None:
        self._kind = kind

    def __enter__(self) -> None:
        pass

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        if isinstance(error, _DAMAGE):
            raise ClipError(f"damaged {self._kind}: {error}") from error
        if isinstance(error, (NotImplementedError, RuntimeError)):
            raise ClipError(f"unsupported {self._kind}: {error}") from error
