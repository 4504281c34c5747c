"""C3D: points of optical systems and gait laboratories, turned into joints."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from motionlake.errors import ClipError
from motionlake.formats.markers import clips_of_markers
from motionlake.formats.parse.c3d_blocks import OWN_GROUP, PARENTS, C3dPoints, Parameter, read_points
from motionlake.motion.clip import Hierarchy, SourceClip
from motionlake.motion.units import UNITS, named_unit
from motionlake.names import printable

# A screen shows these axes of the file to the right, up, and towards the viewer.
_SCREEN: Final = ("X_SCREEN", "Y_SCREEN", "Z_SCREEN")
_AXES: Final = {"X": np.array([1, 0, 0]), "Y": np.array([0, 1, 0]), "Z": np.array([0, 0, 1])}
_NO_UNIT: Final = "mm"  # what the C3D User Guide tells programs to write


class C3dReader:
    """Markers, joint centres, or points that are called as joints: a clip for each `SUBJECT:` of their names."""

    name = "C3D"
    suffixes = (".c3d",)

    def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
        """Read every subject, at `fps` in place of `POINT:RATE`.

        Raises:
            ClipError: the file is damaged or cut short, its unit is none, or its points are no body's.
        """
        points = read_points(data)
        unit = _unit(points)
        rate = points.rate if fps is None else fps
        own = points.parameters.get((OWN_GROUP, PARENTS))
        if own is not None:
            return [_written_here(points, own, unit, rate)]
        places = points.places * unit
        nowhere = (places[..., 0] == 0.0) & (places[..., 1] == 0.0) & (places[..., 2] == 0.0)
        places[nowhere] = np.nan
        names = [printable(name) for name in points.names]
        return clips_of_markers(places, names, rate, up=_up(points), tell_up=True)


def _unit(points: C3dPoints) -> float:
    """Metres a unit of length."""
    texts = points.parameters.get(("POINT", "UNITS"), Parameter()).texts
    word = next((text for text in texts if text.strip()), _NO_UNIT).strip()
    metres = named_unit(word)
    if metres is None:
        raise ClipError(f"POINT:UNITS is {printable(word)!r:.40}, not one of {', '.join(UNITS)}")
    return metres


def _up(points: C3dPoints) -> str | None:
    """The axis that a screen shows upwards: said itself, or at right angles to the two that are."""
    shown = {}
    for name in _SCREEN:
        texts = points.parameters.get(("POINT", name), Parameter()).texts
        word = texts[0].strip().upper() if texts else ""
        if word[-1:] in _AXES and word[:-1] in ("", "+", "-"):
            shown[name[0]] = _AXES[word[-1]] * (-1 if word[0] == "-" else 1)
    if "Y" in shown:
        up = shown["Y"]
    elif {"X", "Z"} <= shown.keys():
        up = np.cross(shown["Z"], shown["X"])
    else:
        return None
    axis = int(np.argmax(np.abs(up)))
    return ("-" if up[axis] < 0 else "") + "xyz"[axis] if up.any() else None


def _written_here(points: C3dPoints, own: Parameter, unit: float, rate: float) -> SourceClip:
    """The clip of a file that motionlake wrote: every point is a joint, and the tree is there."""
    parents = tuple(int(number) - 1 for number in own.numbers)
    if len(parents) != len(points.names):
        raise ClipError(f"has {len(points.names)} joints and {len(parents)} parents")
    if not np.isfinite(points.places).all():
        raise ClipError("has a joint that is nowhere in some frame")
    return SourceClip(
        hierarchy=Hierarchy.of_positions(tuple(map(printable, points.names)), parents),
        channels=(points.places * unit).reshape(len(points.places), -1),
        fps=rate,
        metres_per_unit=1.0,
        up=_up(points),
        notes=("points are joints, as motionlake wrote them",),
    )


READER: Final = C3dReader()
