"""OpenSim MOT and STO: angles of the joints of a gait model, columns of text."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.limits_config import MOST_DEGREES, limits
from motionlake.formats.parse.numbers import parse_table
from motionlake.motion.clip import SourceClip
from motionlake.motion.opensim import BODIES, COORDINATES, KNEES, TRANSLATION, opensim_channels, opensim_hierarchy
from motionlake.names import printable

BONES: Final = "bone lengths are those of OpenSim's generic full-body model: a .mot says none"
HANGING: Final = "the arms hang: the file has no angles of them"
UPRIGHT: Final = "trunk and pelvis are in line: the file has no lumbar angles"
_END: Final = re.compile(rb"^[ \t]*endheader[ \t]*\r?\n", re.IGNORECASE | re.MULTILINE)
_COMMAS: Final = re.compile(rb"^[ \t]*endheader,+[ \t]*\r?\n", re.IGNORECASE | re.MULTILINE)
_MARKS: Final = re.compile(rb"endheader|nRows|nColumns|inDegrees|datacolumns", re.IGNORECASE)
_HEADER_BYTES: Final = 1 << 16
_FORCES: Final = re.compile(r"force|grf|torque|moment|_v[xyz]$|_p[xyz]$|emg|activation", re.IGNORECASE)
_SPINE: Final = re.compile(r"^[LT]\d+_[LTS]\d+_(.+)$")
_LUMBAR: Final = {"Flex_Ext": "lumbar_extension", "Lat_Bending": "lumbar_bending", "axial_rotation": "lumbar_rotation"}
_NEEDED: Final = ("pelvis_tilt", "hip_flexion_r", "hip_flexion_l", *KNEES)
_ARMS: Final = tuple(f"arm_flex_{side}" for side in "rl")
_OF_ARMS: Final = tuple(f"{body}_{side}" for side in "rl" for body in ("humerus", "ulna", "hand"))
_OF_TRUNK: Final = ("torso", "neck", "head")
_MOST_RADIANS: Final = 4.0 * np.pi  # more than two whole turns: the numbers are degrees
_EVEN: Final = 1e-3  # of a frame: what instants may be off an even grid
_FARTHEST: Final = 1e5  # metres
_NUMBER: Final = re.compile(r"\d{1,12}")


@dataclass(frozen=True)
class _Table:
    """The columns of a file.

    Attributes:
        names: of the columns.
        rows: [F, C].
        in_degrees: what the header says of angles; None where it says nothing.
    """

    names: tuple[str, ...]
    rows: Float64Array
    in_degrees: bool | None


class MotReader:
    """Joint angles of gait models whose coordinates are called as in OpenSim's (`pelvis_tilt`, `hip_flexion_r`)."""

    name = "OpenSim motion"
    suffixes = (".mot", ".sto")

    def sniff(self, head: bytes) -> bool:
        """Whether these first bytes are of a table that OpenSim wrote, or of one that is damaged."""
        return _MARKS.search(head) is not None

    def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
        """Read one body, at `fps` in place of the rate that the column `time` has.

        Raises:
            ClipError: the table is damaged or cut short, or its columns are no joint angles of a whole body.
        """
        table = _table(data)
        columns = {_coordinate(name): column for column, name in enumerate(table.names)}
        _check_columns(table.names, columns)
        rows, rate, notes = _even(table.rows, columns["time"])
        angles = {name: rows[:, columns[name]] for name in COORDINATES if name in columns}
        if not any(name in angles for name in _LUMBAR.values()):
            angles |= _lumbar(columns, rows)
        angles, more = _as_in_the_model(angles, table.in_degrees)
        notes += [BONES, *more]
        hanging = not any(name in angles for name in _ARMS)
        upright = not any(name in angles for name in _LUMBAR.values())
        notes += [*[HANGING] * hanging, *[UPRIGHT] * upright]
        places = np.zeros((len(rows), 3))
        for axis, name in enumerate(TRANSLATION):
            if name in columns:
                places[:, axis] = rows[:, columns[name]]
        channels = opensim_channels(angles, places)
        return [
            SourceClip(
                opensim_hierarchy(),
                channels,
                rate if fps is None else fps,
                metres_per_unit=1.0,
                up="y",
                filled=(*_OF_TRUNK * upright, *_OF_ARMS * hanging),
                notes=tuple(notes),
            )
        ]


def _table(data: bytes) -> _Table:
    if _COMMAS.search(data, 0, _HEADER_BYTES):  # a spreadsheet wrote it
        data = data.replace(b",", b"\t")
    end = _END.search(data, 0, _HEADER_BYTES)
    if end is None:
        raise ClipError("has no line endheader, as files of OpenSim have")
    header = data[: end.start()].decode("utf-8", errors="replace")
    label_end = data.find(b"\n", end.end())
    while label_end >= 0 and not data[end.end() : label_end].strip():  # blank lines before the names
        label_end = data.find(b"\n", label_end + 1)
    if label_end < 0:
        raise ClipError("is cut short: it has no columns")
    if label_end - end.end() > _HEADER_BYTES:
        raise ClipError(f"the line of its columns is {label_end - end.end()} bytes long")
    text = data[end.end() : label_end].decode("utf-8", errors="replace")
    names = tuple(printable(name) for name in text.split())
    if len(set(names)) < len(names):
        raise ClipError("has two columns of one name")
    declared = _declared(header, "nColumns|datacolumns")
    if declared is not None and declared != len(names):
        raise ClipError(f"{declared} columns declared, {len(names)} named")
    rows = _declared(header, "nRows|datarows")
    if rows is None:
        rows = sum(bool(line.strip()) for line in data[label_end:].splitlines())
    held = min(rows, len(data) // (2 * len(names)) + 1)  # a count that the bytes cannot hold is damage
    limits().check_body(held, max(len(names), len(BODIES)), len(data))
    most = np.full(len(names), max(MOST_DEGREES, _FARTHEST))
    told = re.search(r"inDegrees\s*=\s*(\w+)", header, re.IGNORECASE)
    degrees = None if told is None else told[1].lower() in ("yes", "true", "1")
    return _Table(names, parse_table(data, label_end, rows, len(names), most), degrees)


def _declared(header: str, names: str) -> int | None:
    """A count of the header; None where there is none that can be believed."""
    found = re.search(rf"^\s*(?:{names})\s*=?\s*({_NUMBER.pattern})\s*$", header, re.IGNORECASE | re.MULTILINE)
    return int(found[1]) if found else None


def _coordinate(name: str) -> str:
    """The coordinate of a column: OpenSim 4 writes `/jointset/hip_r/hip_flexion_r/value`; of speeds it is the path."""
    parts = name.split("/")
    return parts[-2] if len(parts) > 2 and parts[-1] == "value" else name


def _check_columns(names: tuple[str, ...], columns: dict[str, int]) -> None:
    if "time" not in columns:
        raise ClipError("has no column time")
    lacking = [name for name in _NEEDED if name not in columns]
    if not lacking:
        return
    shown = ", ".join(names[1:4])
    if len(lacking) == len(_NEEDED):
        what = "forces or other results" if any(map(_FORCES.search, names)) else "something else"
        raise ClipError(f"holds no joint angles of a gait model but {what} ({shown}, …)")
    raise ClipError(f"is no whole body: it has no column {', '.join(lacking)}")


def _even(rows: Float64Array, time: int) -> tuple[Float64Array, float, list[str]]:
    """Rows at even times, how many there are a second, and a note where they were not even before."""
    times = rows[:, time]
    steps = np.diff(times)
    if not len(steps):
        raise ClipError(f"has {len(rows)} frame(s); a motion needs at least two")
    if not (steps > 0).all():
        raise ClipError("its times do not rise")
    step = float(np.median(steps))
    even = (times[-1] - times[0]) / len(steps)
    grid = times[0] + even * np.arange(len(times))
    if np.abs(times - grid).max() <= max(_EVEN * even, 10.0 ** -_decimals(times)):
        return rows, _rate(even), []
    count = int((times[-1] - times[0]) / step + _EVEN) + 1
    limits().check_body(count, len(BODIES))
    grid = times[0] + step * np.arange(count)
    resampled = np.stack([np.interp(grid, times, column) for column in rows.T], axis=1)
    return resampled, _rate(step), [f"frames of unequal duration, resampled to {_rate(step):g} a second"]


def _decimals(times: Float64Array) -> int:
    """Digits after the point with which instants are written, 9 at most."""
    return next((digits for digits in range(2, 9) if np.abs(times - times.round(digits)).max() < 1e-10), 9)


def _rate(step: float) -> float:
    """1 / step, or the whole number that is a hair beside it."""
    whole = round(1.0 / step)
    return float(whole) if whole and abs(whole * step - 1.0) < _EVEN else 1.0 / step


def _lumbar(columns: dict[str, int], rows: Float64Array) -> dict[str, Float64Array]:
    """Lumbar angles of a model with a joint at every vertebra: the sums of theirs, which turn about like axes."""
    sums: dict[str, Float64Array] = {}
    for name, column in columns.items():
        found = _SPINE.match(name)
        lumbar = _LUMBAR.get(found[1]) if found else None
        if lumbar is not None:
            sums[lumbar] = sums.get(lumbar, np.zeros(len(rows))) + rows[:, column]
    return sums


def _as_in_the_model(
    angles: dict[str, Float64Array], in_degrees: bool | None
) -> tuple[dict[str, Float64Array], list[str]]:
    """Angles in degrees with knees that bend upwards from 0, and notes of what the file left open."""
    notes = []
    if in_degrees is None:
        in_degrees = max(float(np.abs(values).max()) for values in angles.values()) > _MOST_RADIANS
        notes.append(f"angles are taken for {'degrees' if in_degrees else 'radians'}, by their size")
    if not in_degrees:
        angles = {name: np.rad2deg(values) for name, values in angles.items()}
    knees = np.concatenate([angles[name] for name in KNEES])
    if abs(knees.min()) > abs(knees.max()):  # a knee bends far one way alone: so do models of Delp and of Hamner
        notes.append("knee angles are negative where knees bend, as in gait2392")
        angles |= {name: -angles[name] for name in KNEES}
    return angles, notes


READER: Final = MotReader()
