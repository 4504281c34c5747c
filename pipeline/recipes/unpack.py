"""Archives of others, unpacked so that nothing lands outside of a folder, and no more than may be."""

from __future__ import annotations

import bz2
import errno
import gzip
import lzma
import os
import stat
import tarfile
import zipfile
import zlib
from collections.abc import Iterator
from io import BufferedIOBase
from pathlib import Path, PurePosixPath
from typing import IO, Any, Final

from motionlake.errors import UserError

FILES: Final = 1_000_000  # of an archive
RATIO: Final = 100  # times its size that an archive may hold: text of numbers shrinks to a tenth, bombs to a thousandth
LEAST: Final = 16 << 20  # bytes that any archive may hold
_CHUNK: Final = 1 << 20
_MOST_AT_ONCE: Final = 64 << 20  # bytes of one read of a tar file: of headers, which are read whole
_BROKEN: Final = (
    zipfile.BadZipFile, tarfile.TarError, zlib.error, lzma.LZMAError, EOFError, NotImplementedError, RuntimeError,
    ValueError,
)  # fmt: skip


class _RefusedError(Exception):
    """What an archive holds is not unpacked, for this reason."""


def unpack(archive: Path, kind: str, folder: Path, only: str = "") -> int:
    """Unpack an archive into a new folder; returns how many files there are in it.

    Entries that are no plain files or folders, whose names lead elsewhere, or that are more than an archive of that
    size holds make the whole archive be refused.

    Args:
        kind: "zip" or "tar" (which may be compressed with gzip, bzip2 or xz).
        only: folder of the archive that is unpacked, without the folders above it; empty: all.

    Raises:
        UserError: the archive is damaged or refused, or holds no file below `only`.
    """
    most = max(LEAST, RATIO * archive.stat().st_size)
    folder.mkdir(parents=True)
    try:
        entries = _zip_entries(archive) if kind == "zip" else _tar_entries(archive, most)
        count = _write(entries, folder, PurePosixPath(only), most)
    except _RefusedError as error:
        raise UserError(f"{archive}: is not unpacked: {error}") from error
    except (*_BROKEN, OSError) as error:
        if isinstance(error, OSError) and error.errno not in (None, errno.EINVAL):
            raise  # of the disk; those two are what bz2, gzip and a place before the file's beginning raise
        raise UserError(f"{archive}: is damaged ({str(error).splitlines()[0] if str(error) else error!r})") from error
    if not count:
        raise UserError(f"{archive}: holds no files" + (f" below {only}" if only else ""))
    return count


Entry = tuple[str, int, Any]  # a file's name, its size as declared, and what opens it


def _write(entries: Iterator[Entry], folder: Path, only: PurePosixPath, most: int) -> int:
    count = total = 0
    for name, size, opened in entries:
        path = _inside(name)
        total += size
        if total > most:
            raise _RefusedError(f"it holds more than {most} bytes, which is {RATIO} times its size")
        if not path.is_relative_to(only):
            continue
        if path == only:
            raise _RefusedError(f"{name!r} is a file, not a folder")
        count += 1
        if count > FILES:
            raise _RefusedError(f"it holds more than {FILES} files")
        target = folder / path.relative_to(only)
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            with opened() as source, target.open("xb") as file:
                _copy(source, file, size, name)
        except (FileExistsError, NotADirectoryError, IsADirectoryError) as error:
            raise _RefusedError(f"{name!r} is there twice") from error
    return count


def _copy(source: IO[bytes], file: IO[bytes], size: int, name: str) -> None:
    """The bytes of an entry, as many as it declares."""
    left = size
    while chunk := source.read(_CHUNK):
        left -= len(chunk)
        if left < 0:
            break
        file.write(chunk)
    if left:
        raise _RefusedError(f"{name!r} is not as long as it says")
    file.flush()
    os.fsync(file.fileno())


def _inside(name: str) -> PurePosixPath:
    """The path of an entry. Raises `_RefusedError` where it leads out of the folder, on any system."""
    path = PurePosixPath(name)
    parts = name.replace("\\", "/").split("/")
    if not parts[0] or ".." in parts or "\0" in name or (len(parts[0]) > 1 and parts[0][1] == ":"):
        raise _RefusedError(f"{name!r} leads out of the folder")
    return path


def _zip_entries(archive: Path) -> Iterator[Entry]:
    with zipfile.ZipFile(archive) as opened:
        for info in opened.infolist():
            kind = stat.S_IFMT(info.external_attr >> 16)
            if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
                raise _RefusedError(f"{info.filename!r} is a link or a device")
            if info.flag_bits & 1:
                raise _RefusedError(f"{info.filename!r} is encrypted")
            if info.is_dir():
                _inside(info.filename)
                continue
            yield info.filename, info.file_size, lambda info=info: opened.open(info)


def _tar_entries(archive: Path, most: int) -> Iterator[Entry]:
    with _decompressed(archive) as plain, tarfile.open(fileobj=_Limited(plain, 2 * most), mode="r:") as opened:
        for member in opened:
            if member.isdir():
                _inside(member.name)
                continue
            if not member.isfile() or member.issparse():
                raise _RefusedError(f"{member.name!r} is a link, a device or sparse")
            _inside(member.name)
            # What Python itself takes for safe; it raises `tarfile.FilterError` for anything else.
            tarfile.data_filter(member, str(archive.parent))
            yield member.name, member.size, lambda member=member: opened.extractfile(member)
            vars(opened)["members"] = []  # else a million headers stay in memory


def _decompressed(archive: Path) -> Any:
    with archive.open("rb") as handle:
        start = handle.read(6)
    for magic, opened in ((b"\x1f\x8b", gzip.open), (b"BZh", bz2.open), (b"\xfd7zXZ\0", lzma.open)):
        if start.startswith(magic):
            return opened(archive, "rb")
    return archive.open("rb")


class _Limited(BufferedIOBase):
    """A stream that is read up to some byte, and never much at once."""

    def __init__(self, stream: Any, most: int) -> None:
        self._stream, self._most = stream, most

    def read(self, size: int | None = -1, /) -> bytes:
        wanted = self._most if size is None or size < 0 else size
        if wanted > _MOST_AT_ONCE or self._stream.tell() + wanted > self._most + _CHUNK:
            raise _RefusedError(f"it holds more than {self._most} bytes, or a header of more than {_MOST_AT_ONCE}")
        return bytes(self._stream.read(wanted))

    def seek(self, place: int, whence: int = os.SEEK_SET, /) -> int:
        return int(self._stream.seek(place, whence))

    def tell(self) -> int:
        return int(self._stream.tell())

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True
