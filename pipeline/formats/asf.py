"""ASF (Acclaim skeleton file): units, root, bones and hierarchy; the skeleton that an AMC file moves."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.errors import ClipError
from motionlake.formats.asf_skeleton import CHANNELS, LENGTH, ROOT, Bone, Skeleton
from motionlake.formats.registry import load_bytes
from motionlake.formats.remembered import Remembered
from motionlake.motion.clip import Hierarchy


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

    def push_back(self) -> None:
        """Give the last line again."""
        self.number -= 1

    def section(self) -> Iterator[list[str]]:
        """The lines up to the next section's heading."""
        for words in self:
            if words[0].startswith(":"):
                self.push_back()
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
        return values

    def vector(self, words: list[str]) -> tuple[float, float, float]:
        """Three numbers."""
        x, y, z = self.numbers(words, 3)
        return x, y, z

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
                skeleton.position = lines.vector(words[1:])
            case "orientation":
                root.angles = lines.vector(words[1:])


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
                bone.direction = lines.vector(words[1:])
            case "length":
                (bone.length,) = lines.numbers(words[1:], 1)
            case "axis":
                bone.angles, bone.order = lines.vector(words[1:]), lines.order(words[4:])
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
    children: dict[str, list[str]] = {}
    for child, parent in skeleton.parents.items():
        children.setdefault(parent, []).append(child)
    ordered, waiting = {}, [ROOT]
    while waiting:
        bone = waiting.pop()
        ordered[bone] = skeleton.bones[bone]
        waiting.extend(reversed(children.get(bone, [])))
    loose = next((bone for bone in skeleton.bones if bone not in ordered), None)
    if loose is not None:
        raise ClipError(f"{name}: bone {loose!r} does not hang from the root")
    skeleton.bones = ordered


def parse_asf(data: bytes, name: str) -> Skeleton:
    """Read an ASF file.

    Args:
        data: the file.
        name: its name, for messages.

    Raises:
        ClipError: with the file's name and line.
    """
    lines = _Lines(data.decode("latin-1"), name)
    skeleton = Skeleton()
    sections = {
        ":units": _read_units,
        ":root": _read_root,
        ":bonedata": _read_bones,
        ":hierarchy": _read_hierarchy,
    }
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
            x, y, z = np.rad2deg(bone.angles).tolist()
            bone.angles = (x, y, z)
    return skeleton


def _load(path: Path) -> tuple[Skeleton, Hierarchy]:
    skeleton = parse_asf(load_bytes(path), path.name)
    return skeleton, skeleton.hierarchy()


_loaded: Final = Remembered(_load, size=64)


def load_asf(path: Path) -> tuple[Skeleton, Hierarchy]:
    """Read an ASF file, or remember it: many clips share one skeleton. `ClipError` where it fails."""
    try:
        return _loaded(path)
    except OSError as error:
        raise ClipError(f"{path.name}: cannot be read: {error.strerror or error}") from error
