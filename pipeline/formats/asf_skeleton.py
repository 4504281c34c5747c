"""What an ASF file describes: bones that hang from one root, and the joint tree that they make."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.amc_frames import Layout
from motionlake.motion.clip import ChannelKind, Hierarchy
from motionlake.motion.rotations import from_euler

ROOT: Final = "root"
_METRES_PER_INCH: Final = 0.0254
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
    direction: tuple[float, float, float] = (0.0, 0.0, 0.0)
    length: float = 0.0
    angles: tuple[float, float, float] = (0.0, 0.0, 0.0)
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
        return ("Xposition", "Yposition", "Zposition", *rotations) if self.moves else rotations


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
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
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
    def layout(self) -> Layout:
        """What an AMC's lines hold for this skeleton; `ClipError` where no bone moves."""
        widths = {bone.name: len(bone.dof) for bone in self.bones.values() if bone.dof}
        if not widths:
            raise ClipError("its skeleton has no bone that moves")
        return Layout.of(widths)

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
