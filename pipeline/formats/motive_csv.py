"""OptiTrack Motive CSV: skeletons of bones, or labelled markers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.markers import clips_of_markers, clips_of_subjects, up_note, up_of_tree
from motionlake.formats.parse.motive_table import OPENING, Column, MotiveHeader, read_header, read_numbers
from motionlake.formats.parse.scene import Worlds, against_rest, check_room, clip_of_worlds, joint_names
from motionlake.formats.registry import COMPRESSED_SUFFIX, load_bytes
from motionlake.formats.repair import fill_missing, fill_rotations, missing_samples, repair_note
from motionlake.motion.clip import SourceClip, depth_first
from motionlake.motion.named_joints import named_tree
from motionlake.motion.rotations import IDENTITY, from_euler, multiply, normalise, rotate
from motionlake.motion.skeleton import chained
from motionlake.motion.units import named_unit

_LEAST: Final = 1e-6  # length of a quaternion that is a rotation
_QUATERNION: Final = "Quaternion"
_ORDERS: Final = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
_UNLABELLED: Final = "Unlabeled"
_MARKERS: Final = ("Marker", "Bone Marker", "Marker Set Marker", "Trained Markerset Marker", "Rigid Body Marker")


class MotiveReader:
    """A clip for every skeleton of an export, of its bones; where there is none, of labelled markers."""

    name = "Motive CSV"
    suffixes = (".csv",)
    opening = OPENING

    def sniff(self, head: bytes) -> bool:
        """Whether these first bytes are an export's."""
        return head.lstrip(b"\xef\xbb\xbf").startswith(OPENING)

    def claims(self, path: Path) -> bool:
        """Whether the file there begins as an export does."""
        try:
            if path.name.lower().endswith(COMPRESSED_SUFFIX):
                return self.sniff(load_bytes(path)[: 2 * len(OPENING)])
            with path.open("rb") as stream:
                return self.sniff(stream.read(2 * len(OPENING)))
        except (ClipError, OSError):
            return False

    def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
        """Read every skeleton, at `fps` in place of `Export Frame Rate`.

        Raises:
            ClipError: the header or a row is damaged, the file is cut short, or holds no body.
        """
        header = read_header(data)
        unit = named_unit(header.settings.get("Length Units", "Meters"))
        if unit is None:
            raise ClipError(f"Length Units is {header.settings['Length Units']!r:.40}, which is no unit", line=1)
        rate = header.rate() if fps is None else fps
        bones = [column for column in header.columns if column.kind == "Bone"]
        if bones:
            names = list(dict.fromkeys(column.name for column in bones))
            check_room([(header.frames(data), len(names))])
            numbers = read_numbers(data, header, bones)
            return clips_of_subjects(
                names, lambda places, subject: _skeleton(header, bones, numbers, list(places), subject, unit, rate)
            )
        kind = next((kind for kind in _MARKERS if any(column.kind == kind for column in header.columns)), None)
        if kind is None:
            what = ", ".join(sorted({column.kind for column in header.columns})) or "nothing"
            raise ClipError(f"holds no skeleton and no labelled markers, but {what}"[:120])
        return _of_markers(data, header, kind, unit, rate)


def _of_markers(data: bytes, header: MotiveHeader, kind: str, unit: float, rate: float) -> list[SourceClip]:
    columns = [
        each
        for each in header.columns
        if (each.kind, each.what) == (kind, "Position") and not each.name.rpartition(":")[2].startswith(_UNLABELLED)
    ]
    if not columns:
        raise ClipError("holds no labelled markers")
    names = list(dict.fromkeys(column.name for column in columns))
    check_room([(header.frames(data), len(names))])
    numbers = read_numbers(data, header, columns)
    places = _vectors(columns, numbers, names, "Position", "XYZ")
    return clips_of_markers(places * unit, names, rate, tell_up=True)


def _vectors(
    columns: Sequence[Column], numbers: Float64Array, names: Sequence[str], what: str, axes: str
) -> Float64Array:
    """[F, N, n] the numbers of things along some axes, of the columns [F, C]."""
    found = {(column.name, column.axis): place for place, column in enumerate(columns) if column.what == what}
    wanted = [(name, axis) for name in names for axis in axes]
    if missing := next((each for each in wanted if each not in found), None):
        raise ClipError(f"{missing[0]} has no column {what} {missing[1]}")
    chosen = np.take(numbers, [found[each] for each in wanted], axis=1)
    return np.asarray(chosen.reshape(len(numbers), len(names), len(axes)))


def _skeleton(
    header: MotiveHeader,
    columns: Sequence[Column],
    numbers: Float64Array,
    bones: list[str],
    subject: str,
    unit: float,
    rate: float,
) -> SourceClip:
    full = [f"{subject}:{bone}" if subject else bone for bone in bones]
    above = [header.parent(name) for name in full]
    called = _called(bones, subject)
    order, parents = _tree(called, _called([name.rpartition(":")[2] for name in above], subject))
    left_out = (f"{len(full) - len(order)} bones left out",) if len(order) < len(full) else ()
    full, bones = [full[bone] for bone in order], [called[bone] for bone in order]
    places = _vectors(columns, numbers, full, "Position", "XYZ") * unit
    turns = _rotations(header, columns, numbers, full)
    missing = missing_samples(places) | ~(np.linalg.norm(turns, axis=2) > _LEAST)
    places, repaired = fill_missing(places, missing, bones)
    turns = normalise(fill_rotations(turns, missing))
    if header.settings.get("Coordinate Space", "Global").casefold() == "local":
        places, turns = _in_world(places, turns, parents)
    names = joint_names(bones)
    tree = named_tree(names)
    up = None if tree is None else up_of_tree(tree, places[:, list(tree.places)])
    moved, level = Worlds(places, turns), np.tile(IDENTITY, (1, len(bones), 1))
    offsets = against_rest(parents, moved, level[0])[1].mean(axis=0)
    offsets[0] = 0.0
    rest = Worlds(chained(offsets, parents)[None], level)
    clip = clip_of_worlds(
        names, parents, moved, rest, fps=rate, body="", metres_per_unit=1.0, up=up or "y",
        notes=((f"subject {subject}",) if subject else ()) + left_out + up_note(up)
        + repair_note(repaired, len(places)),
    )  # fmt: skip
    return replace(clip, repaired=repaired)


def _rotations(
    header: MotiveHeader, columns: Sequence[Column], numbers: Float64Array, names: Sequence[str]
) -> Float64Array:
    """[F, B, 4] of bones; NaN where the file has none."""
    kind = header.settings.get("Rotation Type", _QUATERNION)
    if kind == _QUATERNION:
        return _vectors(columns, numbers, names, "Rotation", "WXYZ")
    if kind not in _ORDERS:
        raise ClipError(f"Rotation Type is {kind!r:.40}, not {_QUATERNION} or one of {', '.join(_ORDERS)}", line=1)
    angles = _vectors(columns, numbers, names, "Rotation", kind)
    seen = np.isfinite(angles).all(axis=2)
    turns = np.full((*seen.shape, 4), np.nan)
    if seen.any():
        turns[seen] = from_euler(angles[seen], kind)
    return turns


def _tree(bones: Sequence[str], named: Sequence[str]) -> tuple[list[int], tuple[int, ...]]:
    """Places of the bones that are joints, the root first, and for each its parent's place among those; -1 at the root.

    Bones hang as the row `Parent` says, those whose parent is no bone from the first of these; where there is no such
    row, as the joints of a known rig do, which leaves others out.
    """
    index = {bone: place for place, bone in enumerate(bones)}
    parents = [index.get(name.rpartition(":")[2], -1) for name in named]
    if not any(parent >= 0 for parent in parents):
        tree = named_tree(bones)
        if tree is None:
            raise ClipError(
                f"its bones ({', '.join(bones[:4])}, …) are no known skeleton's, and no row says their parents"
            )
        return list(tree.places), tree.parents
    root = parents.index(-1) if -1 in parents else 0
    parents = [root if parent < 0 and place != root else parent for place, parent in enumerate(parents)]
    order = depth_first(parents)
    if len(order) < len(bones):
        raise ClipError("has bones that hang from themselves")
    place_of = {bone: place for place, bone in enumerate(order)} | {-1: -1}
    return order, tuple(place_of[parents[bone]] for bone in order)


def _called(bones: Sequence[str], subject: str) -> list[str]:
    """Names of bones; exports call the root as the skeleton, rigs as what it is."""
    root = "Hip" if "Ab" in bones or "LThigh" in bones else "Hips"
    return [root if bone == subject and root not in bones else bone for bone in bones]


def _in_world(places: Float64Array, turns: Float64Array, parents: Sequence[int]) -> tuple[Float64Array, Float64Array]:
    """Where bones are [F, B, 3] and how they are turned [F, B, 4], of how they stand under their parents."""
    places, turns = places.copy(), turns.copy()
    for bone, parent in enumerate(parents):
        if parent >= 0:
            places[:, bone] = places[:, parent] + rotate(turns[:, parent].copy(), places[:, bone].copy())
            turns[:, bone] = multiply(turns[:, parent].copy(), turns[:, bone].copy())
    return places, turns


READER: Final = MotiveReader()
