"""Marker sets: which markers on the skin make which joint centre, as data (one TOML file a set)."""

from __future__ import annotations

import functools
import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.motion.rigs import MAX_LISTED
from motionlake.motion.rotations import MIN_LENGTH

# The joints of the rig `markers`.
JOINT_CENTRES: Final = (
    "hip_centre", "neck_centre", "head_centre",
    "left_shoulder_centre", "left_elbow_centre", "left_wrist_centre",
    "right_shoulder_centre", "right_elbow_centre", "right_wrist_centre",
    "left_hip_centre", "left_knee_centre", "left_ankle_centre", "left_toe_end",
    "right_hip_centre", "right_knee_centre", "right_ankle_centre", "right_toe_end",
)  # fmt: skip
HEAD: Final = "head_centre"
JOINT_CENTRE_PARENTS: Final = (-1, 0, 1, 1, 3, 4, 1, 6, 7, 0, 9, 10, 11, 0, 13, 14, 15)


@dataclass(frozen=True)
class Pelvis:
    """Markers of the pelvis: the front spines of both sides, and those at its back, whose mean is taken."""

    left_front: str
    right_front: str
    back: tuple[str, ...]


@dataclass(frozen=True)
class MarkerSet:
    """A way to place markers.

    Attributes:
        name, description, source: what it is called, what it is, where its names come from.
        joints: joint centre -> markers, of which it is the mean; the head may lack.
        pelvis: markers from which the centres of the hips follow; None where they are among `joints`.
        centres: whether its points are joint centres that a program has computed, rather than places on the skin.
    """

    name: str
    description: str
    source: str
    joints: Mapping[str, tuple[str, ...]]
    pelvis: Pelvis | None = None
    centres: bool = False

    @property
    def centres_made(self) -> tuple[str, ...]:
        """The `JOINT_CENTRES` that it places, in their order: all, or all but the head."""
        return tuple(joint for joint in JOINT_CENTRES if joint != HEAD or joint in self.joints)

    @property
    def required(self) -> tuple[str, ...]:
        """Markers that a file of this set must have."""
        pelvis = self.pelvis
        of_pelvis = () if pelvis is None else (pelvis.left_front, pelvis.right_front, *pelvis.back)
        of_joints = (marker for markers in self.joints.values() for marker in markers)
        return tuple(dict.fromkeys((*of_pelvis, *of_joints)))

    def lacking(self, markers: Collection[str]) -> list[str]:
        """Required markers that are not among these; letter case does not matter."""
        there = {marker.casefold() for marker in markers}
        return [marker for marker in self.required if marker.casefold() not in there]


@functools.cache
def marker_sets() -> tuple[MarkerSet, ...]:
    """The marker sets of the package, in the order of their names."""
    folder = resources.files("motionlake.motion").joinpath("marker_sets")
    texts = [file.read_text(encoding="utf-8") for file in folder.iterdir() if file.name.endswith(".toml")]
    return tuple(sorted((_parse(text) for text in texts), key=lambda marker_set: marker_set.name))


def _parse(text: str) -> MarkerSet:
    table = tomllib.loads(text)
    pelvis = table.get("pelvis")
    return MarkerSet(
        name=table["name"],
        description=table["description"],
        source=table["source"],
        joints={joint: tuple(markers) for joint, markers in table["joints"].items()},
        pelvis=None if pelvis is None else Pelvis(pelvis["left_front"], pelvis["right_front"], tuple(pelvis["back"])),
        centres=table.get("centres", False),
    )


def fitting_sets(markers: Collection[str]) -> list[MarkerSet]:
    """The sets of which all markers are among these, the best first: of joint centres, then with a head, then of more
    markers.

    Raises:
        ClipError: none fits; the reason names the nearest one and the markers that the file lacks, if it has any.
    """
    sets = marker_sets()
    fitting = [marker_set for marker_set in sets if not marker_set.lacking(markers)]
    if fitting:
        return sorted(fitting, key=lambda one: (not one.centres, HEAD not in one.joints, -len(one.required)))
    nearest = min(sets, key=lambda marker_set: len(marker_set.lacking(markers)) / len(marker_set.required))
    lacking = nearest.lacking(markers)
    if len(lacking) == len(nearest.required):
        shown = ", ".join(list(markers)[:3])
        raise ClipError(f"its markers fit no marker set: none has any of its {len(markers)} points ({shown}, …)")
    more = f" and {len(lacking) - MAX_LISTED} more" if len(lacking) > MAX_LISTED else ""
    raise ClipError(
        f"its markers fit no marker set; the nearest, {nearest.name}, lacks {', '.join(lacking[:MAX_LISTED])}{more}"
    )


def joint_centres(marker_set: MarkerSet, positions: Float64Array, markers: Sequence[str]) -> Float64Array:
    """[F, J, 3] the J joint centres that the set places (`centres_made`), metres, in the axes of the markers.

    Args:
        marker_set: one that fits the markers.
        positions: [F, M, 3] of the markers, metres, finite.
        markers: their M names.

    Raises:
        ClipError: the markers of the pelvis are in one line.
    """
    place = {marker.casefold(): index for index, marker in enumerate(markers)}

    def mean(names: Sequence[str]) -> Float64Array:
        return np.asarray(sum(positions[:, place[name.casefold()]] for name in names) / len(names))

    centres = {joint: mean(names) for joint, names in marker_set.joints.items()}
    pelvis = marker_set.pelvis
    if pelvis is not None:
        hips = hip_centres(mean([pelvis.left_front]), mean([pelvis.right_front]), mean(pelvis.back))
        centres["left_hip_centre"], centres["right_hip_centre"] = hips
    centres["hip_centre"] = 0.5 * (centres["left_hip_centre"] + centres["right_hip_centre"])
    return np.stack([centres[joint] for joint in marker_set.centres_made], axis=1)


def hip_centres(
    left_front: Float64Array, right_front: Float64Array, back: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """The left and the right hip [F, 3] from the front spines of the pelvis and the middle of its back [F, 3], metres.

    M. Harrington et al., "Prediction of the hip joint centre in adults, children, and patients with cerebral palsy
    based on magnetic resonance imaging" (2007): by the width and depth of the pelvis, here their means over the clip.

    Raises:
        ClipError: the markers are in one line, in some frame.
    """
    middle = 0.5 * (left_front + right_front)
    width = float(np.linalg.norm(right_front - left_front, axis=1).mean())
    depth = float(np.linalg.norm(middle - back, axis=1).mean())
    right = _unit(right_front - left_front)
    ahead = middle - back
    ahead = _unit(ahead - (ahead * right).sum(axis=1, keepdims=True) * right)
    origin = middle + (-0.24 * depth - 0.0099) * ahead + (-0.30 * width - 0.0109) * np.cross(right, ahead)
    aside = (0.33 * width + 0.0073) * right
    return origin - aside, origin + aside


def _unit(vectors: Float64Array) -> Float64Array:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    if (lengths < MIN_LENGTH).any():
        raise ClipError("the markers of the pelvis are in one line, so that its hips cannot be found")
    unit: Float64Array = vectors / lengths
    return unit
