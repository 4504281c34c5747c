"""OpenSim TRC: places of markers as text, columns parted by tabs."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.limits_config import limits
from motionlake.formats.markers import clips_of_markers
from motionlake.formats.parse.delimited import read_columns
from motionlake.motion.clip import SourceClip
from motionlake.motion.units import UNITS

_HEADER_LINES: Final = 5
# Before the markers: the frame's number and its time.
_LEADING: Final = 2
_ROW: Final = re.compile(rb"[^\r\n]*\d[^\r\n]*")
# Python's `float` takes quadratic time: no endless digits.
_LONGEST: Final = 64


class TrcReader:
    """Markers of OpenSim, Vicon and Pose2Sim, turned into joints."""

    name = "TRC"
    suffixes = (".trc",)

    def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
        """Read every subject, at `fps` in place of the file's `DataRate`.

        Raises:
            ClipError: the header or a row is damaged, the file is cut short, or its markers fit no set.
        """
        data = _parted_by_tabs(data)
        begin = _end_of_header(data)
        lines = data[:begin].decode("utf-8", errors="replace").splitlines()
        if not begin or not lines[0].startswith("PathFileType"):
            raise ClipError("is no TRC: it does not begin with the five lines of its header", line=1)
        settings = dict(zip(lines[1].split(), lines[2].split(), strict=False))
        markers = [name.strip() for name in lines[3].split("\t")[_LEADING:] if name.strip()]
        frames, declared = _number(settings, "NumFrames"), _number(settings, "NumMarkers")
        if declared != len(markers):
            raise ClipError(f"{declared:g} markers declared, {len(markers)} named", line=4)
        unit = UNITS.get(settings.get("Units", "").lower())
        if unit is None:
            raise ClipError(f"Units is {settings.get('Units')!r}, not one of {', '.join(UNITS)}", line=3)
        rate = _number(settings, "DataRate") if fps is None else fps
        held = len(data) // (3 * len(markers) + 1) + 1  # a row has a byte for each number, at least
        limits().check_body(min(held, data.count(b"\n", begin) + 1), len(markers), len(data))
        places = _tidy_places(data, begin, 3 * len(markers))
        if places is None:
            places = _places(data, 3 * len(markers))
        _check_end(data, len(places), frames)
        places *= unit
        clips = clips_of_markers(places.reshape(len(places), -1, 3), markers, rate)
        if len(places) == frames:
            return clips
        note = f"{len(places)} frames, though the file says {frames:g}"
        return [replace(clip, notes=(*clip.notes, note)) for clip in clips]


def _parted_by_tabs(data: bytes) -> bytes:
    """The same with tabs where a spreadsheet wrote commas."""
    head = data[: _end_of_header(data)]
    return data.replace(b",", b"\t") if b"\tTime" not in head and b",Time," in head else data


def _check_end(data: bytes, found: int, declared: float) -> None:
    """Programs declare the frames of another file. Where fewer are there than declared and the last row does not end,
    the file is cut short, and its last number may be."""
    if not found or (found < declared and not data.endswith((b"\n", b"\r"))):
        raise ClipError(f"{declared:g} frames declared, but the file is cut short")


def _end_of_header(data: bytes) -> int:
    """The byte after the header; 0 where there is nothing."""
    begin = 0
    for _ in range(_HEADER_LINES):
        begin = data.find(b"\n", begin) + 1
        if not begin:
            return 0
    return begin if begin < len(data) else 0


def _number(settings: dict[str, str], name: str) -> float:
    try:
        return _float(settings[name])
    except (KeyError, ValueError) as error:
        raise ClipError(f"{name} is {settings.get(name)!r:.40}, not a number", line=3) from error


def _float(text: str) -> float:
    """The number of a field; `ValueError` where it is none or endless."""
    if len(text) > _LONGEST:
        raise ValueError(f"{len(text)} characters")
    return float(text)


def _tidy_places(data: bytes, begin: int, count: int) -> Float64Array | None:
    """[F, count] the numbers of all rows at once; None where one of them is untidy or damaged."""
    row = _ROW.search(data, begin)
    width = row[0].count(b"\t") + 1 if row else 0
    if width < _LEADING + count:
        return None
    try:
        places = read_columns(data, begin, width, range(_LEADING, width), parted_by="\t")
    except ClipError:
        return None
    if not np.isnan(places[:, count:]).all():
        return None
    places = places[:, :count]
    blank = np.isnan(places[:, 0])
    return None if np.isnan(places[blank]).all(axis=1).any() else places


def _places(data: bytes, count: int) -> Float64Array:
    """The same row by row; `ClipError` with the line of one that is damaged."""
    lines = data.decode("utf-8", errors="replace").splitlines()
    rows = [(at, row) for at, row in enumerate(lines[_HEADER_LINES:], start=_HEADER_LINES + 1) if row.strip()]
    return np.array([_values(row, count, line) for line, row in rows]).reshape(-1, count)


def _values(row: str, count: int, line: int) -> Float64Array:
    """[count] the numbers after a row's number and time; NaN where a field is blank."""
    fields = row.split("\t")[_LEADING:]
    if len(fields) < count or any(field.strip() for field in fields[count:]):
        raise ClipError(f"the row has {len(fields)} values, not {count}", line=line)
    try:
        return np.array([_float(field) if field.strip() else np.nan for field in fields[:count]])
    except ValueError as error:
        raise ClipError(f"the row has a value that is no number ({error})", line=line) from error


READER: Final = TrcReader()
