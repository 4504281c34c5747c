"""The points of a C3D file: header, parameters and frames, each checked against the file's size before it is read.

The layout is that of the C3D User Guide (Motion Lab Systems, 2008): blocks of 512 bytes, of which the first is the
header, then come groups of parameters, then frames of points and analog samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.limits_config import limits

# Where motionlake writes the tree of joints: for each point the number of its parent's, counted from 1; 0 at the root.
OWN_GROUP: Final = "MOTIONLAKE"
PARENTS: Final = "PARENTS"
_BLOCK: Final = 512
_KEY: Final = 0x50  # the second byte of every C3D
_INTEL, _DEC, _MIPS = 84, 85, 86  # the processor whose numbers a file has
_CHARACTERS, _BYTES, _WORDS, _FLOATS = -1, 1, 2, 4  # types of parameters
_VALUES: Final = 4  # of a point: x, y, z, and a word or number whose sign says whether it was seen
_FULL: Final = 65_535  # what two bytes hold at most: of a longer file they tell nothing
_MOST_PARAMETERS: Final = 10_000
_LABELS: Final = ("LABELS", *(f"LABELS{number}" for number in range(2, 10)))  # 255 names a parameter


@dataclass(frozen=True)
class Parameter:
    """A parameter of a group.

    Attributes:
        texts: of a parameter of characters, its strings, without blanks at the end.
        numbers: of any other, its numbers; of words, as they are without a sign.
    """

    texts: tuple[str, ...] = ()
    numbers: tuple[float, ...] = ()


Parameters = dict[tuple[str, str], Parameter]


@dataclass(frozen=True)
class C3dPoints:
    """What a file says of its P points.

    Attributes:
        names: as `POINT:LABELS` spells them.
        places: [F, P, 3] in the file's unit; NaN where the file says that a point was not seen.
        rate: frames a second.
        parameters: all of the file, by (group, name), upper case.
    """

    names: tuple[str, ...]
    places: Float64Array
    rate: float
    parameters: Parameters


@dataclass(frozen=True)
class _Numbers:
    """How a processor writes numbers."""

    word: np.dtype[np.int16]
    floats: Callable[[bytes], Float64Array]


def _of_processor(code: int) -> _Numbers:
    if code == _INTEL:
        return _Numbers(np.dtype("<i2"), lambda data: np.frombuffer(data, "<f4"))
    if code == _MIPS:
        return _Numbers(np.dtype(">i2"), lambda data: np.frombuffer(data, ">f4"))
    if code == _DEC:
        return _Numbers(np.dtype("<i2"), _dec_floats)
    raise ClipError(f"is no C3D: processor {code} is not one of {_INTEL}, {_DEC}, {_MIPS}")


def _dec_floats(data: bytes) -> Float64Array:
    """DEC's numbers: the halves of Intel's change places, and the exponent is 2 larger."""
    halves = np.frombuffer(data, "<u2").reshape(-1, 2)[:, ::-1]
    return np.ascontiguousarray(halves).view("<f4").ravel() / np.float32(4.0)


def read_points(data: bytes) -> C3dPoints:
    """The points of a file.

    Raises:
        ClipError: it is no C3D, is damaged or cut short, has no points, or asks for more than `limits` allow.
    """
    if len(data) < 2 * _BLOCK or data[1] != _KEY:
        raise ClipError("is no C3D: it does not begin as one")
    start = (data[0] - 1) * _BLOCK
    if not 0 < start <= len(data) - _BLOCK:
        raise ClipError("is no C3D: its parameters lie outside the file")
    numbers = _of_processor(data[start + 3])
    parameters = _parameters(data, start + 4, numbers)
    header = np.frombuffer(data[: 24 * 2], numbers.word).view(f"{numbers.word.byteorder}u2").astype(int)
    points, analog, first, last = header[1:5].tolist()
    scale = float(numbers.floats(data[12:16])[0])
    names = _names(parameters, points)
    if not names:
        raise ClipError("has no named points")
    rate = _number(parameters, "POINT", "RATE")
    rate = float(numbers.floats(data[20:24])[0]) if rate is None else rate
    begin = _number(parameters, "POINT", "DATA_START") or header[8]
    frames = _frames(parameters, last - first + 1)
    if frames is None:
        row = (_VALUES * points + analog) * (4 if scale < 0 else 2)
        frames = max(len(data) - (int(begin) - 1) * _BLOCK, 0) // row
    places = _places(data, int(begin), frames, points, analog, scale, numbers)[:, : len(names)]
    return C3dPoints(names, places, rate, parameters)


def _parameters(data: bytes, at: int, numbers: _Numbers) -> Parameters:
    """Every parameter of a file; one whose group has no name, or that is damaged, is left out."""
    groups: dict[int, str] = {}
    found: dict[tuple[int, str], Parameter] = {}
    for _ in range(_MOST_PARAMETERS):
        if at + 2 > len(data) or not (length := abs(_signed(data[at]))):
            break
        group, body = _signed(data[at + 1]), at + 2 + length
        name = _text(data[at + 2 : body]).upper()
        if body + 2 > len(data):
            break
        following = int(np.frombuffer(data[body : body + 2], numbers.word).view(f"{numbers.word.byteorder}u2")[0])
        if group < 0:
            groups[-group] = name
        elif parameter := _parameter(data[body + 2 : body + following if following else len(data)], numbers):
            found[group, name] = parameter
        if following < 2:
            break
        at = body + following
    return {(groups[group], name): parameter for (group, name), parameter in found.items() if group in groups}


def _parameter(record: bytes, numbers: _Numbers) -> Parameter | None:
    """Of what follows a parameter's name; None where it is damaged."""
    if len(record) < 2:
        return None
    kind, dimensions = _signed(record[0]), record[1]
    shape = tuple(record[2 : 2 + dimensions])
    count = int(np.prod(shape, dtype=object)) if shape else 1
    content = record[2 + dimensions : 2 + dimensions + count * abs(kind)]
    if kind not in (_CHARACTERS, _BYTES, _WORDS, _FLOATS) or len(content) < count * abs(kind):
        return None
    if kind == _CHARACTERS:
        width = shape[0] if shape else 1
        several = range(0, count, width) if width else ()
        return Parameter(texts=tuple(_text(content[place : place + width]) for place in several))
    if kind == _FLOATS:
        return Parameter(numbers=tuple(numbers.floats(content).astype(float).tolist()))
    words = np.frombuffer(content, np.uint8 if kind == _BYTES else f"{numbers.word.byteorder}u2")
    return Parameter(numbers=tuple(words.astype(float).tolist()))


def _signed(byte: int) -> int:
    return byte - 256 if byte > 127 else byte


def _text(data: bytes) -> str:
    return data.decode("utf-8", errors="replace").rstrip(" \0")


def _number(parameters: Parameters, group: str, name: str) -> float | None:
    """The first number of a parameter, where it has one that is above zero."""
    values = parameters.get((group, name), Parameter()).numbers
    return values[0] if values and 0 < values[0] < np.inf else None


def _names(parameters: Parameters, points: int) -> tuple[str, ...]:
    """Names of the first points; those after the last label have none."""
    labels = [text for name in _LABELS for text in parameters.get(("POINT", name), Parameter()).texts]
    return tuple(labels[:points])


def _frames(parameters: Parameters, of_header: int) -> int | None:
    """How many frames a file says that it has; None where it says it by two bytes alone, and those are full."""
    ends = [parameters.get(("TRIAL", f"ACTUAL_{end}_FIELD"), Parameter()).numbers for end in ("START", "END")]
    if all(len(words) == 2 for words in ends):
        first, last = (int(low + 65_536 * high) for low, high in ends)
        if last > first:
            return last - first + 1
    told = _number(parameters, "POINT", "LONG_FRAMES") or _number(parameters, "POINT", "FRAMES")
    frames = of_header if told is None or (of_header > 0 and told <= _FULL) else int(told)
    return None if frames == _FULL else max(frames, 0)


def _places(
    data: bytes, block: int, frames: int, points: int, analog: int, scale: float, numbers: _Numbers
) -> Float64Array:
    """[F, P, 3] where points are; NaN where they were not seen."""
    limits().check_body(frames, points, len(data))
    wide = scale < 0  # then the file's numbers are floats, which nothing scales
    width = _VALUES * points + analog
    begin, size = (block - 1) * _BLOCK, frames * width * (4 if wide else 2)
    if begin < _BLOCK or begin + size > len(data):
        raise ClipError(f"{frames} frames declared, but the file is cut short")
    if not np.isfinite(scale) or scale == 0:
        raise ClipError(f"its scale of points is {scale:g}")
    content = data[begin : begin + size]
    values = numbers.floats(content) if wide else np.frombuffer(content, numbers.word)
    read = values.reshape(frames, width)[:, : _VALUES * points].reshape(frames, points, _VALUES)
    with np.errstate(invalid="ignore", over="ignore"):
        places = read[..., :3].astype(np.float64) * (1.0 if wide else scale)
        places[~(read[..., 3] >= 0)] = np.nan
    return places
