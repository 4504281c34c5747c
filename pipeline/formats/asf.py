"""ASF (Acclaim skeleton file): units, root, bones and hierarchy; the skeleton that an AMC file moves."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.limits_config import FARTHEST, limits
from motionlake.formats.registry import load_bytes
from motionlake.formats.remembered import Remembered
from motionlake.motion.clip import POSITION_CHANNELS, ChannelKind, Hierarchy, depth_first
from motionlake.motion.rotations import from_euler

ROOT: Final = "root"
_METRES_PER_INCH: Final = 0.0254
MAX_BYTES: Final = 8 * 1024**2  # lines take twenty times as much
CHANNELS: Final = {
    f"{kind}{axis}".lower(): f"{axis}{what}" for kind, what in (("t", "position"), ("r", "rotation")) for axis in "XYZ"
}
LENGTH: Final = "l"


@dataclass
class Bone:
    """One bone as its file writes it.

    Attributes:
        name: the file's name for it, "root" for the root.
        direction: unit vector of the bone at rest, in the world's axes.
        length: in file units.
        angles: degrees of its own axes, turned in `order` about fixed axes.
        order: axis letters such as "XYZ".
        dof: what an AMC line of this bone holds, in order: "tx" .. "rz" and "l".
    """

    name: str
    direction: tuple[float, ...] = (0.0, 0.0, 0.0)
    length: float = 0.0
    angles: tuple[float, ...] = (0.0, 0.0, 0.0)
    order: str = "XYZ"
    dof: tuple[str, ...] = ()

    @property
    def vector(self) -> Float64Array:
        """From the bone's start to its end at rest, file units [3]."""
        direction = np.array(self.direction)
        return direction * (self.length / (np.linalg.norm(direction) or 1.0))

    @property
    def axis(self) -> Float64Array:
        """The bone's own axes as a rotation [4]."""
        return from_euler(np.array(self.angles), self.order, fixed=True)

    @property
    def moves(self) -> bool:
        """Whether the bone's start can leave its place, other than the root's."""
        return self.name != ROOT and any(channel.startswith("t") for channel in self.dof)

    @property
    def channels(self) -> tuple[str, ...]:
        """Channel names as `Hierarchy` has them; a bone that moves has all three positions first."""
        rotations = tuple(CHANNELS[channel] for channel in self.dof if channel.startswith("r"))
        if self.name == ROOT:
            return tuple(CHANNELS[channel] for channel in self.dof if channel != LENGTH)
        return POSITION_CHANNELS + rotations if self.moves else rotations


@dataclass
class Skeleton:
    """An ASF file.

    Attributes:
        bones: by name, parents before children, the root first.
        parents: name of each bone's parent.
        position: of the root, added to its translation, file units.
        length_unit: the file's `length`: its unit is this fraction of an inch to the power -1.
        radians: whether angles, the AMC's too unless it says otherwise, are in radians.
    """

    bones: dict[str, Bone] = field(default_factory=lambda: {ROOT: Bone(ROOT)})
    parents: dict[str, str] = field(default_factory=dict)
    position: tuple[float, ...] = (0.0, 0.0, 0.0)
    length_unit: float = 1.0
    radians: bool = False

    @property
    def metres_per_unit(self) -> float:
        """Length of the file's unit: `length` 0.45 says that 0.45 units are an inch."""
        return _METRES_PER_INCH / self.length_unit

    @functools.cached_property
    def plain(self) -> bool:
        """Whether an AMC's values are the hierarchy's channels as they stand."""
        special = any(bone.moves or LENGTH in bone.dof for bone in self.bones.values())
        return not special and not any(self.position)

    @functools.cached_property
    def widths(self) -> dict[str, int]:
        """How many values an AMC has of each bone that moves; `ClipError` where none does."""
        widths = {bone.name: len(bone.dof) for bone in self.bones.values() if bone.dof}
        if not widths:
            raise ClipError("its skeleton has no bone that moves")
        return widths

    def hierarchy(self) -> Hierarchy:
        """The skeleton as joints at the bones' starts; bones without children end in an end site."""
        names = tuple(self.bones)
        bones = list(self.bones.values())
        starts = [bone.vector for bone in bones]
        parents = [-1] + [names.index(self.parents[name]) for name in names[1:]]
        return Hierarchy(
            joints=names,
            parents=tuple(parents),
            offsets=np.array([np.zeros(3) if parent < 0 else starts[parent] for parent in parents]),
            channels=tuple(bone.channels for bone in bones),
            kind=ChannelKind.EULER,
            axes=np.array([bone.axis for bone in bones]),
            fixed_axes=True,
            end_sites=tuple(
                (i, (float(end[0]), float(end[1]), float(end[2]))) for i, end in enumerate(starts) if i not in parents
            ),
        )


class _Lines:
    """The file's lines as words, one after another, without comments and blank lines."""

    def __init__(self, text: str, name: str) -> None:
        self.name = name
        self.number = 0
        self._lines = text.split("\n")

    def __iter__(self) -> Iterator[list[str]]:
        while self.number < len(self._lines):
            words = self._lines[self.number].split("#", 1)[0].split()
            self.number += 1
            if words:
                yield words

    def section(self) -> Iterator[list[str]]:
        """The lines up to the next section's heading."""
        for words in self:
            if words[0].startswith(":"):
                self.number -= 1  # give this line again
                return
            yield words

    def fault(self, reason: str) -> ClipError:
        """A `ClipError` that says where in this file, which is not the clip's own."""
        return ClipError(f"{self.name}, line {self.number}: {reason}")

    def numbers(self, words: list[str], count: int) -> tuple[float, ...]:
        """The first `count` words as numbers."""
        try:
            values = tuple(float(word) for word in words[:count])
        except ValueError:
            values = ()
        if len(values) != count or not np.isfinite(values).all():
            raise self.fault(f"{count} number(s) expected, not {' '.join(words)[:60]!r}")
        if max(map(abs, values)) > FARTHEST:
            raise self.fault(f"an absurdly large number in {' '.join(words)[:60]!r}")
        return values

    def order(self, words: list[str]) -> str:
        """A word such as "XYZ"."""
        order = "".join(words).upper()
        if sorted(order) != ["X", "Y", "Z"]:
            raise self.fault(f"{order[:20]!r} is not an order of axes")
        return order

    def dof(self, words: list[str]) -> tuple[str, ...]:
        """Degrees of freedom, in lower case."""
        dof = tuple(word.lower() for word in words)
        unknown = [word for word in dof if word not in CHANNELS and word != LENGTH]
        if unknown or len(set(dof)) != len(dof):
            raise self.fault(f"{' '.join(words)[:60]!r} are not degrees of freedom")
        return dof


def _read_units(lines: _Lines, skeleton: Skeleton) -> None:
    for words in lines.section():
        match words[0].lower():
            case "length":
                (skeleton.length_unit,) = lines.numbers(words[1:], 1)
                if not skeleton.length_unit > 0:
                    raise lines.fault("the unit of length is not above 0")
            case "angle":
                skeleton.radians = words[1:2] != [] and words[1].lower().startswith("rad")


def _read_root(lines: _Lines, skeleton: Skeleton) -> None:
    root = skeleton.bones[ROOT]
    for words in lines.section():
        match words[0].lower():
            case "order":
                root.dof = lines.dof(words[1:])
            case "axis":
                root.order = lines.order(words[1:])
            case "position":
                skeleton.position = lines.numbers(words[1:], 3)
            case "orientation":
                root.angles = lines.numbers(words[1:], 3)


def _read_bone(lines: _Lines) -> Bone:
    bone = Bone("")
    for words in lines.section():
        match words[0].lower():
            case "end":
                if not bone.name:
                    raise lines.fault("a bone without a name")
                return bone
            case "name":
                bone.name = " ".join(words[1:])
            case "direction":
                bone.direction = lines.numbers(words[1:], 3)
            case "length":
                (bone.length,) = lines.numbers(words[1:], 1)
            case "axis":
                bone.angles, bone.order = lines.numbers(words[1:], 3), lines.order(words[4:])
            case "dof":
                bone.dof = lines.dof(words[1:])
    raise lines.fault("a bone without 'end'")


def _read_bones(lines: _Lines, skeleton: Skeleton) -> None:
    for words in lines.section():
        if words[0].lower() != "begin":
            raise lines.fault(f"'begin' expected, not {words[0][:20]!r}")
        bone = _read_bone(lines)
        if bone.name in skeleton.bones:
            raise lines.fault(f"bone {bone.name!r} twice")
        skeleton.bones[bone.name] = bone
        limits().check("joints", len(skeleton.bones), f"{lines.name} has too many bones")


def _read_hierarchy(lines: _Lines, skeleton: Skeleton) -> None:
    for words in lines.section():
        if len(words) == 1 and words[0].lower() in ("begin", "end"):
            continue
        unknown = next((word for word in words if word not in skeleton.bones), None)
        if unknown is not None:
            raise lines.fault(f"unknown bone {unknown!r}")
        for child in words[1:]:
            if child in skeleton.parents or child == ROOT:
                raise lines.fault(f"bone {child!r} has two parents")
            skeleton.parents[child] = words[0]


def _sort(skeleton: Skeleton, name: str) -> None:
    """Put the bones into depth-first order."""
    names = [ROOT, *skeleton.parents]
    places = {name: place for place, name in enumerate(names)}
    parents = [places.get(parent, len(names)) for parent in skeleton.parents.values()]
    ordered = {names[place]: skeleton.bones[names[place]] for place in depth_first([-1, *parents])}
    loose = next((bone for bone in skeleton.bones if bone not in ordered), None)
    if loose is not None:
        raise ClipError(f"{name}: bone {loose!r} does not hang from the root")
    skeleton.bones = ordered


def parse_asf(data: bytes, name: str) -> Skeleton:
    """Read an ASF file; `ClipError` with its `name` and the line where it fails."""
    lines = _Lines(data.decode("latin-1"), name)
    skeleton = Skeleton()
    sections = {":units": _read_units, ":root": _read_root, ":bonedata": _read_bones, ":hierarchy": _read_hierarchy}
    seen = set()
    for words in lines:
        heading = words[0].lower()
        if heading in sections:
            seen.add(heading)
            sections[heading](lines, skeleton)
    missing = [heading for heading in (":root", ":bonedata", ":hierarchy") if heading not in seen]
    if missing:
        raise ClipError(f"{name}: is no ASF file, or cut short: no {missing[0]}")
    _sort(skeleton, name)
    if skeleton.radians:
        for bone in skeleton.bones.values():
            bone.angles = tuple(np.rad2deg(bone.angles).tolist())
    return skeleton


def _load(path: Path) -> tuple[Skeleton, Hierarchy]:
    skeleton = parse_asf(load_bytes(path, MAX_BYTES), path.name)
    return skeleton, skeleton.hierarchy()


_loaded: Final = Remembered(_load, size=64)


def load_asf(path: Path) -> tuple[Skeleton, Hierarchy]:
    """Read an ASF file, or remember it: many clips share one skeleton. `ClipError` where it fails."""
    try:
        return _loaded(path)
    except OSError as error:
        raise ClipError(f"{path.name}: cannot be read: {error.strerror or error}") from error
