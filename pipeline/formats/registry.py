"""Which reader reads which file: every module of this package with a `READER` is one file format."""

from __future__ import annotations

import codecs
import functools
import importlib
import pkgutil
import stat
import zlib
from gzip import BadGzipFile, GzipFile
from io import FileIO
from pathlib import Path
from types import ModuleType
from typing import BinaryIO, Final, Protocol, runtime_checkable

from motionlake.errors import ClipError
from motionlake.formats.clip_checks import check_clip
from motionlake.formats.limits_config import DEFAULT, LimitError, Limits, limits, within
from motionlake.motion.clip import SourceClip

COMPRESSED_SUFFIX: Final = ".gz"
_CHUNK_BYTES: Final = 4 * 1024**2
# Enough to know a clip whose first kilobytes are damaged.
HEAD_BYTES: Final = 64 * 1024
MAX_REASON: Final = 200


@runtime_checkable
class Reader(Protocol):
    """One file format.

    A reader may also have

    - `companions(path: Path) -> list[Path]`: further files that belong to the clip, such as the .asf of an .amc;
    - `sniff(head: bytes) -> bool`: whether a file that begins so is of this format, where other files have its
      suffixes too;
    - `recognises(path: Path) -> bool`: in place of `sniff`, whether the file there is of this format, where its
      beginning does not tell;
    - `claims(path: Path) -> bool`: whether the file there is this reader's, where another reader has its suffixes too;
      one that has no `claims` reads what no other claims. Of several such it is the first that knows the file by
      `sniff` or `recognises`.

    `read_clips` holds every clip against the limits of the lake; a reader whose file promises frames or joints before
    it holds them asks `limits().check_body(...)` before it makes room for them.

    Attributes:
        name: the format's name, as users see it.
        suffixes: lower-case file name endings with the dot, without ".gz".
    """

    name: str
    suffixes: tuple[str, ...]

    def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
        """Read the decompressed bytes of `path`, one `SourceClip` per body; `ClipError` where it cannot.

        Where the user says the frame rate (`fps`), it stands in place of the file's, which may be anything.
        """
        ...


@functools.cache
def readers() -> tuple[Reader, ...]:
    """The `READER` of every module of this package, in the order of their names."""
    found = []
    for module_info in pkgutil.iter_modules([str(Path(__file__).parent)]):
        module: ModuleType = importlib.import_module(f"{__package__}.{module_info.name}")
        reader = getattr(module, "READER", None)
        if isinstance(reader, Reader):
            found.append(reader)
    return tuple(sorted(found, key=lambda reader: reader.name))


@functools.cache
def _by_suffix(every: tuple[Reader, ...]) -> dict[str, tuple[Reader, ...]]:
    """The readers of every suffix, which is what a name has from its last dot on."""
    found: dict[str, tuple[Reader, ...]] = {}
    for reader in every:
        for suffix in reader.suffixes:
            found[suffix] = (*found.get(suffix, ()), reader)
    return found


def reader_for(path: Path) -> Reader | None:
    """The reader for the file's name (".gz" and letter case aside), or None where there is none.

    Of readers of one suffix it is the first that claims the file there, or else one that claims none.
    """
    name = path.name.lower().removesuffix(COMPRESSED_SUFFIX)
    of_suffix = _by_suffix(readers()).get("".join(name.rpartition(".")[1:]), ()) if "." in name else ()
    if not of_suffix:
        return None
    if len(of_suffix) == 1:
        return of_suffix[0]
    claiming = next((reader for reader in of_suffix if hasattr(reader, "claims") and reader.claims(path)), None)
    if claiming is not None:
        return claiming
    others = [reader for reader in of_suffix if not hasattr(reader, "claims")]
    if len(others) < 2:
        return next(iter(others), None)
    return next((reader for reader in others if _knows(reader, path)), others[0])


def clip_by_name(name: str) -> bool | None:
    """Whether a file of this name is a clip without companions; None where the file has to be looked at."""
    whole = name.lower().removesuffix(COMPRESSED_SUFFIX)
    return _clip_by_suffix(whole[dot:]) if (dot := whole.rfind(".")) >= 0 else False


@functools.lru_cache(maxsize=1024)
def _clip_by_suffix(suffix: str) -> bool | None:
    of_suffix = _by_suffix(readers()).get(suffix, ())
    looking = ("claims", "recognises", "sniff", "companions")
    plain = len(of_suffix) == 1 and not any(hasattr(of_suffix[0], name) for name in looking)
    return (plain or None) if of_suffix else False


def is_clip(path: Path) -> bool:
    """Whether the file is a clip by its name (a skeleton alone, such as an .asf, is none).

    Where a reader shares its suffix with other kinds of files (`.txt`), by its first 64 KiB too. Such a file
    is none where it cannot be opened, and is one, to be rejected, where its gzip stream is damaged there, or cut short
    before it tells and begins with the reader's `opening`.
    """
    reader = reader_for(path)
    return reader is not None and _knows(reader, path)


def _knows(reader: Reader, path: Path) -> bool:
    """Whether a file of a reader's suffix is of its format."""
    recognises, sniff = getattr(reader, "recognises", None), getattr(reader, "sniff", None)
    if recognises is None and sniff is None:
        return True
    if not path.is_file():  # a pipe would never end
        return False
    if sniff is None:
        return recognises is not None and bool(recognises(path))
    try:
        with path.open("rb") as raw:
            head = raw.read(HEAD_BYTES)
    except OSError:
        return False
    if path.name.lower().endswith(COMPRESSED_SUFFIX):
        stream = zlib.decompressobj(wbits=zlib.MAX_WBITS | 16)
        try:
            plain = stream.decompress(head, HEAD_BYTES)
        except zlib.error:
            return True
        cut = 0 < len(head) < HEAD_BYTES and len(plain) < HEAD_BYTES and not stream.eof
        begins = plain.lstrip().startswith(getattr(reader, "opening", b"")) or not plain.strip()
        return bool(sniff(plain)) or (cut and begins)
    return bool(sniff(head))


def first_bytes(path: Path) -> bytes:
    """Up to 64 KiB of a file's beginning, decompressed where its name ends in ".gz".

    Raises:
        ClipError: it cannot be read.
    """
    try:
        with path.open("rb") as raw:
            head = raw.read(HEAD_BYTES)
        if path.name.lower().endswith(COMPRESSED_SUFFIX):
            head = zlib.decompressobj(wbits=zlib.MAX_WBITS | 16).decompress(head, HEAD_BYTES)
    except (OSError, zlib.error) as error:
        raise ClipError(f"cannot be read: {error}") from error
    return head.removeprefix(codecs.BOM_UTF8)


def is_clip_file(path: Path) -> bool:
    """Whether there is a clip file at the path, which may be no path at all: a clip's name, or too long for one."""
    try:
        return path.is_file() and is_clip(path)
    except OSError:
        return False


def may_have_companions(path: Path) -> bool:
    """Whether further files may make up the clip's content, by its reader."""
    return hasattr(reader_for(path), "companions")


def companions(path: Path) -> list[Path]:
    """Further files that make up the clip's content; `ClipError` where one is needed and missing."""
    find = getattr(reader_for(path), "companions", None)
    return list(find(path)) if find is not None else []


def load_bytes(path: Path, limit: int | None = None) -> bytes:
    """The file's bytes, decompressed where its name ends in ".gz".

    Raises:
        ClipError: unreadable, longer than `limit` bytes (default: as `limits` have it) as it lies there or once
            decompressed, or a damaged gzip stream.
    """
    try:
        state = path.stat()
        if not stat.S_ISREG(state.st_mode):
            raise ClipError("is not a regular file")
        _check_size(state.st_size, limit)
        if path.name.lower().endswith(COMPRESSED_SUFFIX):
            with path.open("rb") as raw:
                return _decompress(raw, limit)
        with path.open("rb", buffering=0) as plain:
            return _first(plain, state.st_size)
    except FileNotFoundError as error:
        raise ClipError("does not exist") from error
    except (EOFError, BadGzipFile, zlib.error) as error:
        raise ClipError(f"damaged gzip stream: {error}") from error
    except OSError as error:
        raise ClipError(f"cannot be read: {error.strerror or error}") from error


def _first(raw: FileIO, size: int) -> bytes:
    """So many bytes of a file, or all where it has fewer; one call may bring less than it is asked for."""
    data = raw.read(size)
    while len(data) < size and (more := raw.read(size - len(data))):
        data += more
    return data


def _check_size(size: int, limit: int | None, when: str = "") -> None:
    if size <= (limits().file_bytes if limit is None else limit):
        return
    if limit is None:
        raise LimitError("file_megabytes", limits().file_megabytes, f"is too large{when}")
    raise ClipError(f"is larger than {limit} bytes{when}")


def _decompress(raw: BinaryIO, limit: int | None) -> bytes:
    plain = bytearray()
    with GzipFile(fileobj=raw) as stream:
        while chunk := stream.read(_CHUNK_BYTES):
            plain += chunk
            _check_size(len(plain), limit, " once decompressed")
    return bytes(plain)


def read_clips(path: Path, fps: float | None = None, allowed: Limits | None = None) -> list[SourceClip]:
    """Read every body's clip of a file and check what holds for all formats; `fps` stands in place of the file's.

    Raises:
        ClipError: no reader for the name, or the file cannot be read, asks for more than is `allowed`, or has fewer
            than two frames, channels that are not finite or absurd, a frame rate outside [1, 1000] or a malformed
            hierarchy. Nothing else.
    """
    with within(allowed or DEFAULT):
        return _read_clips(path, fps)


def _read_clips(path: Path, fps: float | None) -> list[SourceClip]:
    reader = reader_for(path)
    if reader is None:
        known = ", ".join(sorted({suffix for each in readers() for suffix in each.suffixes}))
        raise ClipError(f"no reader for this kind of file (known: {known})")
    data = load_bytes(path).removeprefix(codecs.BOM_UTF8)
    if not data or data.isspace():
        raise ClipError("is empty")
    try:
        clips = reader.read(data, path, fps)
        limits().check("bodies", len(clips), f"holds {len(clips)} bodies")
        for clip in clips:
            check_clip(clip)
    except ClipError as error:
        if len(error.reason) <= MAX_REASON:
            raise
        raise ClipError(f"{error.reason[:MAX_REASON]}…", error.line) from error
    except MemoryError as error:
        raise ClipError("needs more memory than there is") from error
    except Exception as error:
        # A run over a big repository must outlive any one file: a parser's surprise is a bad clip.
        raise ClipError(f"not a readable {reader.name} file ({type(error).__name__}: {error})") from error
    if not clips:
        raise ClipError("holds no body")
    return clips
