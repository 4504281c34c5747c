"""glTF 2.0 as a container: the JSON of a .gltf or .glb, its buffers, and accessors as arrays.

What the JSON says is checked where it is used: it may be of any type, and an index may lie outside of its list.
"""

from __future__ import annotations

import base64
import binascii
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.limits_config import limits
from motionlake.formats.parse.json_document import json_document
from numpy.typing import NDArray

MAGIC: Final = b"glTF"
_JSON: Final = 0x4E4F534A
_BINARY: Final = 0x004E4942
_HEADER: Final = struct.Struct("<4sII")
_CHUNK: Final = struct.Struct("<II")
_COMPONENTS: Final[dict[int, str]] = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_INDICES: Final = (5121, 5123, 5125)
_VALUES: Final[dict[str, int]] = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_COMPRESSED: Final = ("EXT_meshopt_compression", "KHR_meshopt_compression")
WHOLE: Final = 2**53  # JSON's numbers hold no more exactly


def split_glb(data: bytes) -> tuple[bytes, bytes | None]:
    """The JSON of a .glb and its binary chunk, if it has one.

    Raises:
        ClipError: the header or a chunk's length does not fit the bytes there are.
    """
    if len(data) < _HEADER.size + _CHUNK.size or data[:4] != MAGIC:
        raise ClipError("does not begin as a .glb file does")
    _, version, length = _HEADER.unpack_from(data)
    if version != 2:
        raise ClipError(f"is glTF of version {version}; motionlake reads version 2")
    if not _HEADER.size <= length <= len(data):
        raise ClipError(f"{length} bytes declared, but the file has {len(data)}")
    chunks: dict[int, bytes] = {}
    at = _HEADER.size
    while at + _CHUNK.size <= length:
        size, kind = _CHUNK.unpack_from(data, at)
        at += _CHUNK.size
        if size > length - at:
            raise ClipError(f"has a chunk of {size} bytes where {length - at} are left")
        chunks.setdefault(kind, data[at : at + size])
        at += size
    if _JSON not in chunks:
        raise ClipError("has no JSON chunk")
    return chunks[_JSON], chunks.get(_BINARY)


def json_of(data: bytes) -> tuple[dict[str, Any], bytes | None]:
    """The JSON object of a .gltf or .glb and the binary chunk of the latter; `ClipError` where there is none."""
    text, binary = split_glb(data) if data[:4] == MAGIC else (data, None)
    document = json_document(text)
    if not isinstance(document, dict):
        raise ClipError("is JSON, but no object as glTF is")
    return document, binary


def external_names(document: dict[str, Any]) -> Iterator[str]:
    """The paths of the buffers that lie beside the file, as the file spells them.

    Raises:
        ClipError: one that is no path below the file's folder.
    """
    for buffer in objects(document, "buffers"):
        uri = buffer.get("uri")
        if uri is None or (isinstance(uri, str) and uri.startswith("data:")):
            continue
        name = unquote(uri) if isinstance(uri, str) else ""
        path = Path(name)
        if not name or "\0" in name or "\\" in name or ":" in name or path.is_absolute() or ".." in path.parts:
            raise ClipError(f"keeps a buffer at {str(uri)[:60]!r}, which is no file beside it")
        yield name


def objects(document: dict[str, Any], name: str) -> list[dict[str, Any]]:
    """A list of objects; empty where there is none.

    Raises:
        ClipError: it is something else.
    """
    found = document.get(name, [])
    if not isinstance(found, list) or not all(isinstance(each, dict) for each in found):
        raise ClipError(f"its {name!r} is no list of objects")
    return found


def whole(holder: dict[str, Any], name: str, default: int | None = None, most: int = WHOLE) -> int:
    """A whole number from 0 to below `most`; `ClipError` where there is none and no default."""
    value = holder.get(name, default)
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < most:
        raise ClipError(f"has {name!r} {str(value)[:40]!r} where a number from 0 to {most - 1} is expected")
    return value


def indices(holder: dict[str, Any], name: str, most: int) -> list[int]:
    """A list of whole numbers from 0 to below `most`; empty where there is none."""
    found = holder.get(name, [])
    if not isinstance(found, list):
        raise ClipError(f"its {name!r} is no list of numbers")
    return [whole({name: value}, name, most=most) for value in found]


def numbers(holder: dict[str, Any], name: str, default: tuple[float, ...]) -> Float64Array:
    """[n] as many finite numbers as the default has."""
    found = holder.get(name, default)
    sound = isinstance(found, list | tuple) and len(found) == len(default)
    if not sound or not all(isinstance(value, int | float) and abs(value) < 1e30 for value in found):
        raise ClipError(f"has a {name!r} that is not {len(default)} numbers")
    return np.array(found, float)


@dataclass
class GltfDocument:
    """The JSON of a file and the bytes of its buffers.

    Attributes:
        json: the file's object.
        binary: the binary chunk of a .glb.
        beside: bytes of the buffers that lie beside the file, by their names in it.
    """

    json: dict[str, Any]
    binary: bytes | None
    beside: dict[str, bytes]
    _buffers: dict[int, bytes] = field(default_factory=dict)
    _lists: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    _taken: int = 0

    def objects(self, name: str) -> list[dict[str, Any]]:
        """As the function `objects`, of the file's object; checked once."""
        if name not in self._lists:
            self._lists[name] = objects(self.json, name)
        return self._lists[name]

    def accessor(self, index: int, kinds: tuple[str, ...]) -> Float64Array:
        """[count, n] the numbers of an accessor; n is 1, 3, 4 or 16 as its kind has it.

        Whole numbers of normalised accessors become shares from -1 or 0 to 1.

        Args:
            index: in the file's "accessors".
            kinds: the kinds that are meant, such as "VEC3".

        Raises:
            ClipError: another kind, or numbers outside of the bytes that there are.
        """
        accessors = self.objects("accessors")
        accessor = accessors[whole({"accessor": index}, "accessor", most=len(accessors))]
        kind, component = accessor.get("type"), accessor.get("componentType")
        if kind not in kinds or component not in _COMPONENTS:
            raise ClipError(f"accessor {index} holds {str(kind)[:20]} of type {component}, not {' or '.join(kinds)}")
        count, width = whole(accessor, "count"), _VALUES[kind]
        self._take(count * width * 8)
        dtype = np.dtype(_COMPONENTS[component])
        if "bufferView" in accessor:
            view = whole(accessor, "bufferView")
            raw = self._strided(view, whole(accessor, "byteOffset", 0), count, width, dtype)
        else:
            raw = np.zeros((count, width), dtype)
        if "sparse" in accessor:
            raw = self._replaced(raw, accessor["sparse"])
        values = raw.astype(np.float64)
        if accessor.get("normalized") is True and dtype.kind in "iu":
            values = np.maximum(values / np.iinfo(dtype).max, -1.0)
        return values

    def _take(self, size: int) -> None:
        """Hold all accessors together against the limit of memory: many may share the same bytes."""
        self._taken += size
        limits().check_memory(self._taken)

    def _replaced(self, values: NDArray[Any], sparse: Any) -> NDArray[Any]:
        """A copy of an accessor's numbers with those that its "sparse" gives in their places."""
        if not isinstance(sparse, dict) or not all(isinstance(sparse.get(n), dict) for n in ("indices", "values")):
            raise ClipError('has an accessor whose "sparse" lacks indices or values')
        count, where, what = whole(sparse, "count"), sparse["indices"], sparse["values"]
        if where.get("componentType") not in _INDICES:
            raise ClipError("has sparse indices that are no whole numbers")
        self._take(count * 8)
        offsets = [whole(part, "byteOffset", 0) for part in (where, what)]
        dtype = np.dtype(_COMPONENTS[where["componentType"]])
        places = self._strided(whole(where, "bufferView"), offsets[0], count, 1, dtype)[:, 0]
        new = self._strided(whole(what, "bufferView"), offsets[1], count, values.shape[1], values.dtype)
        if count and int(places.max()) >= len(values):
            raise ClipError("has a sparse index outside of its accessor")
        result = values.copy()
        result[places] = new
        return result

    def _strided(self, view: int, offset: int, count: int, width: int, dtype: np.dtype[Any]) -> NDArray[Any]:
        """[count, width] values that lie in a bufferView, with whatever lies between them."""
        views = self.objects("bufferViews")
        place = views[whole({"bufferView": view}, "bufferView", most=len(views))]
        extensions = place.get("extensions")
        if isinstance(extensions, dict) and any(name in extensions for name in _COMPRESSED):
            raise ClipError("its numbers are compressed (EXT_meshopt_compression): write it without compression")
        buffer = self._buffer(whole(place, "buffer"))
        start, length = whole(place, "byteOffset", 0), whole(place, "byteLength")
        size = width * dtype.itemsize
        stride = whole(place, "byteStride", size) or size
        needed = offset + (count - 1) * stride + size if count else 0
        if start + length > len(buffer) or needed > length:
            raise ClipError(f"bufferView {view} promises {max(needed, length)} bytes that its buffer does not hold")
        strides = (stride, dtype.itemsize)
        return np.ndarray((count, width), dtype, buffer, start + offset if count else 0, strides)

    def _buffer(self, index: int) -> bytes:
        if index in self._buffers:
            return self._buffers[index]
        buffers = self.objects("buffers")
        buffer = buffers[whole({"buffer": index}, "buffer", most=len(buffers))]
        uri = buffer.get("uri")
        if uri is None:
            if index or self.binary is None:
                raise ClipError(f"buffer {index} has no bytes")
            data = self.binary
        elif isinstance(uri, str) and uri.startswith("data:"):
            data = _data_uri(uri)
        else:
            data = self.beside[unquote(uri)]
        if whole(buffer, "byteLength") > len(data):
            raise ClipError(f"buffer {index} of {buffer['byteLength']} bytes holds {len(data)}")
        self._buffers[index] = data
        return data


def _data_uri(uri: str) -> bytes:
    head, comma, body = uri.partition(",")
    if not comma or not head.endswith(";base64"):
        raise ClipError("has a data URI that is not base64")
    limits().check_memory(len(body))
    try:
        return base64.b64decode(body, validate=True)
    except (binascii.Error, ValueError) as error:
        raise ClipError(f"has a damaged data URI: {error}") from error
