"""ASF/AMC clips: an .amc file and the .asf skeleton that belongs to it."""

from __future__ import annotations

import re
import zlib
from dataclasses import dataclass
from gzip import GzipFile
from pathlib import Path
from typing import BinaryIO, Final, cast

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.asf import ROOT, Skeleton, load_asf
from motionlake.formats.limits_config import FARTHEST, MOST_DEGREES, limits
from motionlake.formats.parse.amc_frames import parse_frames
from motionlake.formats.registry import COMPRESSED_SUFFIX
from motionlake.formats.remembered import Remembered
from motionlake.motion.clip import SourceClip
from motionlake.motion.rotations import rotate

DEFAULT_FPS: Final = 120.0
HEAD_BYTES: Final = 4096
PREAMBLE_BYTES: Final = 128 * 1024
_ANCESTORS: Final = 3
_FOLDERS: Final = re.compile(r".*[\\/:]")
_SUFFIXES: Final = (".asf", f".asf{COMPRESSED_SUFFIX}")


def _list_skeletons(folder: Path) -> dict[str, Path]:
    names = sorted(entry.name for entry in folder.iterdir() if entry.name.lower().endswith(_SUFFIXES))
    return {name.lower().removesuffix(COMPRESSED_SUFFIX).removesuffix(".asf"): folder / name for name in names}


_listed: Final = Remembered(_list_skeletons, size=256)


def _skeletons_in(folder: Path) -> dict[str, Path]:
    """The folder's ASF files by lower-case stem."""
    try:
        return _listed(folder)
    except OSError:
        return {}


def find_skeleton(path: Path, named: str = "") -> tuple[Path, str]:
    """The ASF file that an AMC file moves, and why it is that one.

    In this order: the name that the AMC gives (`#!OML:ASF`), in its folder; the AMC's own stem; the longest
    stem that the AMC's name begins with ("HDM_bd.asf" for "HDM_bd_walk_001.amc"), in the folder or the
    nearest of 3 above it that has one; the only ASF of the folder.

    Raises:
        ClipError: none of these; says where it looked.
    """
    stem = path.name.lower().removesuffix(COMPRESSED_SUFFIX).removesuffix(".amc")
    folder = path.absolute().parent
    here = _skeletons_in(folder)
    by_name = named.lower().removesuffix(".asf")
    if by_name in here:
        return here[by_name], "named by the clip"
    ancestor, skeletons = folder, here
    for _ in range(1 + _ANCESTORS):
        # Up to a character that is no letter or digit.
        prefixes = [p for p in skeletons if p and stem.startswith(p) and not stem[len(p) : len(p) + 1].isalnum()]
        if prefixes:
            return skeletons[max(prefixes, key=len)], "the clip's name begins with its name"
        if ancestor == ancestor.parent:
            break
        ancestor = ancestor.parent
        skeletons = _skeletons_in(ancestor)
    if len(here) == 1:
        return next(iter(here.values())), "the only one in the clip's folder"
    wanted = f"{named!r} or " if named else ""
    raise ClipError(
        f"no skeleton: {wanted}an .asf whose name the clip's begins with, in its folder or the "
        f"{_ANCESTORS} above, or one .asf alone in its folder (it has {len(here)})"
    )


@dataclass
class _Preamble:
    """What an AMC file says before its first frame."""

    start: int = 0
    asf: str = ""
    radians: bool | None = None
    rate: str = ""

    @classmethod
    def of(cls, data: bytes) -> _Preamble:
        found = cls()
        while found.start < len(data):
            if found.start > PREAMBLE_BYTES:
                raise ClipError("no frame in its first 128 KiB")
            newline = data.find(b"\n", found.start)
            stop = len(data) if newline < 0 else newline + 1
            words = data[found.start : min(stop, found.start + HEAD_BYTES)].decode("latin-1").split()
            if words and words[0][0] not in "#:":
                break
            found.note(words)
            found.start = stop
        return found

    def note(self, words: list[str]) -> None:
        key = words[0].upper() if words else ""
        if key == "#!OML:ASF":
            self.asf = _FOLDERS.sub("", " ".join(words[1:]))
        elif key in (":DEGREES", ":RADIANS"):
            self.radians = key == ":RADIANS"
        elif key == ":SAMPLES-PER-SECOND" and len(words) > 1:
            self.rate = words[1]

    @property
    def fps(self) -> float:
        if not self.rate:
            return DEFAULT_FPS
        try:
            return float(self.rate)
        except ValueError:
            raise ClipError(f"{self.rate[:40]!r} is not a frame rate: say --fps") from None


def _to_channels(raw: Float64Array, skeleton: Skeleton) -> tuple[Float64Array, list[str]]:
    """The values of an AMC in the order and meaning of `Hierarchy`, and notes on what was changed."""
    notes: list[str] = []
    parts: list[Float64Array] = []
    column = 0
    for bone in skeleton.bones.values():
        values = {dof: raw[:, column + i] for i, dof in enumerate(bone.dof)}
        column += len(bone.dof)
        stretch = values.pop("l", None)
        if stretch is not None and stretch.any():
            notes.append(f"changes of the length of bone {bone.name!r} left out")
        if bone.moves:
            offset = skeleton.bones[skeleton.parents[bone.name]].vector
            shift = np.stack([values.pop(f"t{axis}", np.zeros(len(raw))) for axis in "xyz"], -1)
            parts.append(offset + rotate(bone.axis, shift))
            notes.append(f"bone {bone.name!r} leaves its place: its rest offset was added to its channels")
        elif bone.name == ROOT:
            for axis, start in zip("xyz", skeleton.position, strict=True):
                if f"t{axis}" in values:
                    values[f"t{axis}"] = values[f"t{axis}"] + start
        parts.extend(value[:, None] for value in values.values())
    return np.concatenate(parts, axis=1), notes


class AmcReader:
    """Reader of .amc files with their .asf."""

    name = "ASF/AMC"
    suffixes = (".amc",)

    def companions(self, path: Path) -> list[Path]:
        """The .asf file; `ClipError` where there is none."""
        try:
            with path.open("rb") as raw:
                compressed = path.name.lower().endswith(COMPRESSED_SUFFIX)
                stream = cast(BinaryIO, GzipFile(fileobj=raw)) if compressed else raw
                head = stream.read(HEAD_BYTES)
        except (EOFError, OSError, zlib.error) as error:
            raise ClipError(f"cannot be read: {error}") from error
        return [find_skeleton(path, _Preamble.of(head).asf)[0]]

    def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
        """Read an AMC file and the ASF file it belongs to; `fps` stands in place of the file's rate.

        Raises:
            ClipError: with the line, for frames that are not numbered one after another, bones unknown, missing or
                doubled in a frame, and tokens that are no number; or where its skeleton is not found or not readable.
        """
        preamble = _Preamble.of(data)
        asf, why = find_skeleton(path, preamble.asf)
        skeleton, hierarchy = load_asf(asf)
        turns = [dof.startswith("r") for bone in skeleton.bones.values() for dof in bone.dof]
        limits().check("joints", len(skeleton.bones), f"{asf.name} has too many bones")
        limits().check_memory(len(data))
        channels = parse_frames(data, preamble.start, skeleton.widths, np.where(turns, MOST_DEGREES, FARTHEST))
        if skeleton.radians if preamble.radians is None else preamble.radians:
            channels[:, turns] = np.rad2deg(channels[:, turns])
        notes = [f"skeleton {asf.name}: {why}"]
        if not skeleton.plain:
            channels, changes = _to_channels(channels, skeleton)
            notes += changes
        if fps is None:
            fps = preamble.fps
            if not preamble.rate:
                notes.append(f"frame rate {DEFAULT_FPS:g}/s assumed: the format has none")
        unit = skeleton.metres_per_unit
        return [SourceClip(hierarchy, channels, fps, metres_per_unit=unit, notes=tuple(notes))]


READER: Final = AmcReader()
